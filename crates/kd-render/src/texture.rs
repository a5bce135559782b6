//! Texture lookup.

use image::{ImageError, RgbImage};
use kd::glam::Vec3;
use kd_scene::{ColorSpace, TextureSource};

/// An image that repeats in both directions.
#[derive(Clone, Debug)]
pub(crate) struct TextureImage {
    width: u32,
    height: u32,
    /// Row by row from the top; the unused fourth byte aligns a texel to 32 bits.
    texels: Vec<[u8; 4]>,
    /// The channel value of each byte, decoded from the color space of the scene.
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
        Ok(Self::new(&image.to_rgb8(), colors))
    }

    fn new(image: &RgbImage, colors: ColorSpace) -> Self {
        let texel = |pixel: &image::Rgb<u8>| {
            let [red, green, blue] = pixel.0;
            [red, green, blue, 0]
        };
        let byte = |i: usize| u8::try_from(i).expect("below 256");
        Self {
            width: image.width(),
            height: image.height(),
            texels: image.pixels().map(texel).collect(),
            decoded: Box::new(std::array::from_fn(|i| colors.decoded([byte(i); 3]).x)),
        }
    }

    /// The bilinearly filtered color at texture coordinates `[u, v]`, which repeat with period 1. White if they are not finite.
    pub(crate) fn at(&self, [u, v]: [f32; 2]) -> Vec3 {
        if self.texels.is_empty() || !(u.is_finite() && v.is_finite()) {
            return Vec3::ONE;
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
            let [red, green, blue, _] =
                self.texels[row as usize * self.width as usize + column as usize];
            Vec3::from([red, green, blue].map(|byte| self.decoded[usize::from(byte)]))
        };
        let upper = texel(left, above).lerp(texel(right, above), across);
        let lower = texel(left, below).lerp(texel(right, below), across);
        upper.lerp(lower, down)
    }
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
        let mut image = RgbImage::new(2, 1);
        image.put_pixel(0, 0, image::Rgb([255, 0, 0]));
        image.put_pixel(1, 0, image::Rgb([0, 0, 255]));
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
    }
}
