//! Texture lookup.

use image::{ImageError, RgbaImage};
use kd::glam::{FloatExt, Vec3};
use kd_scene::{ColorSpace, TextureSource};

/// An image that repeats in both directions.
#[derive(Clone, Debug)]
pub(crate) struct TextureImage {
    width: u32,
    height: u32,
    /// Row by row from the top: red, green, blue, and alpha, which is 255 in an image without it.
    texels: Vec<[u8; 4]>,
    /// Whether all texels are opaque.
    is_opaque: bool,
    /// The value of a color channel for each byte, decoded from the color space of the scene.
    decoded: Box<[f32; 256]>,
}

impl TextureImage {
    /// Decodes PNG, JPEG, WebP or PNM. The content decides the format, not the file name.
    pub(crate) fn load(source: &TextureSource, colors: ColorSpace) -> Result<Self, ImageError> {
        let image = match source {
            TextureSource::File(path) => image::ImageReader::open(path)?
                .with_guessed_format()?
                .decode()?,
            TextureSource::Bytes(bytes) => image::load_from_memory(bytes)?,
        };
        Ok(Self::new(&image.to_rgba8(), colors))
    }

    fn new(image: &RgbaImage, colors: ColorSpace) -> Self {
        let byte = |i: usize| u8::try_from(i).expect("below 256");
        Self {
            width: image.width(),
            height: image.height(),
            texels: image.pixels().map(|pixel| pixel.0).collect(),
            is_opaque: image.pixels().all(|pixel| pixel.0[3] == u8::MAX),
            decoded: Box::new(std::array::from_fn(|i| colors.decoded([byte(i); 3]).x)),
        }
    }

    /// The bilinearly filtered color at texture coordinates `[u, v]`, which repeat with period 1. White if they are not finite.
    #[inline]
    pub(crate) fn at(&self, uv: [f32; 2]) -> Vec3 {
        let color = |[red, green, blue, _]: [u8; 4]| {
            Vec3::from([red, green, blue].map(|byte| self.decoded[usize::from(byte)]))
        };
        let Some(texels) = self.texels_at(uv) else {
            return Vec3::ONE;
        };
        let [upper, lower] = texels
            .rows
            .map(|[left, right]| color(left).lerp(color(right), texels.across));
        upper.lerp(lower, texels.down)
    }

    /// The bilinearly filtered alpha at texture coordinates, as [`at`](Self::at). 1 if they are not finite.
    #[inline]
    pub(crate) fn alpha_at(&self, uv: [f32; 2]) -> f32 {
        self.share_at(uv, |[_, _, _, alpha]| f32::from(alpha) / 255.0)
    }

    /// What a picture of alpha alone says at texture coordinates: its alpha, or its brightness if all of it is opaque. 1 if they are not
    /// finite.
    pub(crate) fn mask_at(&self, uv: [f32; 2]) -> f32 {
        if !self.is_opaque {
            return self.alpha_at(uv);
        }
        self.share_at(uv, |[red, green, blue, _]| {
            let sum: u16 = [red, green, blue].map(u16::from).iter().sum();
            f32::from(sum) / (3.0 * 255.0)
        })
    }

    /// The bilinearly filtered value of texels.
    #[inline]
    fn share_at(&self, uv: [f32; 2], of: impl Fn([u8; 4]) -> f32) -> f32 {
        let Some(texels) = self.texels_at(uv) else {
            return 1.0;
        };
        let [upper, lower] = texels
            .rows
            .map(|[left, right]| of(left).lerp(of(right), texels.across));
        upper.lerp(lower, texels.down)
    }

    /// The four texels around texture coordinates; `None` if the coordinates are not finite.
    #[inline]
    fn texels_at(&self, [u, v]: [f32; 2]) -> Option<Neighbors> {
        if self.texels.is_empty() || !(u.is_finite() && v.is_finite()) {
            return None;
        }
        // Texel centers are at half-integers.
        let neighbors = |x: f32, count: u32| {
            let x = (x - x.floor()) * count as f32 - 0.5;
            let before = x.floor();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "-0.5 wraps to the last texel; a value rounded up to `count` wraps to the first"
            )]
            let first = if before < 0.0 {
                count - 1
            } else {
                before as u32 % count
            };
            (first, (first + 1) % count, x - before)
        };
        let (left, right, across) = neighbors(u, self.width);
        let (above, below, down) = neighbors(v, self.height);
        let texel = |column: u32, row: u32| {
            self.texels[row as usize * self.width as usize + column as usize]
        };
        Some(Neighbors {
            rows: [above, below].map(|row| [texel(left, row), texel(right, row)]),
            across,
            down,
        })
    }
}

/// Four texels, and the place between them.
struct Neighbors {
    /// The upper row and the lower one, each from left to right.
    rows: [[[u8; 4]; 2]; 2],
    /// From 0 at the left to 1 at the right.
    across: f32,
    /// From 0 above to 1 below.
    down: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_picture_or_too_large_is_an_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a texture.png");
        for content in [
            &b""[..],
            b"text",
            b"\x89PNG\r\n\x1a\n",
            b"P6 100000 100000 255\n",
        ] {
            let bytes = TextureSource::Bytes(content.into());
            std::fs::write(&path, content).expect("a temporary file");
            let file = TextureSource::File(path.clone());
            for source in [bytes, file] {
                let loaded = TextureImage::load(&source, ColorSpace::Display);
                assert!(loaded.is_err(), "{:?}", String::from_utf8_lossy(content));
            }
        }
        let none = TextureSource::File(folder.path().join("none.png"));
        assert!(
            TextureImage::load(&none, ColorSpace::Display).is_err(),
            "missing"
        );
        let is_folder = TextureSource::File(folder.path().to_owned());
        assert!(
            TextureImage::load(&is_folder, ColorSpace::Display).is_err(),
            "a folder"
        );
    }

    #[test]
    fn lookups_are_bilinear_and_periodic() {
        let mut image = RgbaImage::new(2, 1);
        image.put_pixel(0, 0, image::Rgba([255, 0, 0, 255]));
        image.put_pixel(1, 0, image::Rgba([0, 0, 255, 51]));
        let texture = TextureImage::new(&image, ColorSpace::Display);
        assert_eq!(texture.at([0.25, 0.9]), Vec3::X, "center of a texel");
        assert_eq!(
            texture.at([0.5, 0.5]),
            Vec3::new(0.5, 0.0, 0.5),
            "halfway between two texels"
        );
        assert_eq!(
            texture.at([0.0, 0.5]),
            Vec3::new(0.5, 0.0, 0.5),
            "across the border"
        );
        assert_eq!(texture.at([-4.75, 7.0]), Vec3::X, "several periods away");
        for uv in [[1e30, -1e30], [1.0 - f32::EPSILON / 2.0, 1.0], [-1e-9, 0.0]] {
            assert!(texture.at(uv).is_finite(), "{uv:?}");
        }
        assert_eq!(texture.at([f32::NAN, 0.0]), Vec3::ONE, "not finite");
        for (uv, expected) in [
            ([0.25, 0.9], 1.0),
            ([0.75, 0.1], 0.2),
            ([0.5, 0.5], 0.6),
            ([0.0, 0.5], 0.6),
            ([f32::INFINITY, 0.0], 1.0),
        ] {
            let found = texture.alpha_at(uv);
            assert!((found - expected).abs() < 1e-6, "{uv:?}: {found}");
            assert_eq!(texture.mask_at(uv), found, "a picture with alpha");
        }
    }

    #[test]
    fn a_picture_without_alpha_is_opaque() {
        let path = tempfile::tempdir().expect("a temporary folder");
        let path = path.path().join("plain.png");
        let plain = image::RgbImage::from_pixel(3, 2, image::Rgb([0, 128, 255]));
        plain.save(&path).expect("a temporary file");
        let file = TextureSource::File(path);
        let texture = TextureImage::load(&file, ColorSpace::Linear).expect("a picture");
        assert_eq!(texture.alpha_at([0.1, 0.7]), 1.0);
        let mean = 383.0 / 765.0;
        assert!(
            (texture.mask_at([0.1, 0.7]) - mean).abs() < 1e-6,
            "brightness"
        );
        assert_eq!(texture.at([0.1, 0.7]).z, 1.0);
    }
}
