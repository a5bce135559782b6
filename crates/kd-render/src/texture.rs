//! Pictures on surfaces.

use image::{ImageError, RgbImage};
use kd::glam::Vec3;
use kd_scene::{ColorSpace, TextureSource};

/// A picture, repeated in both directions.
#[derive(Clone, Debug)]
pub(crate) struct TextureImage {
    width: u32,
    height: u32,
    /// By rows from above; a fourth byte, which is not used, keeps each in one word.
    texels: Vec<[u8; 4]>,
    /// What each byte means.
    decoded: Box<[f32; 256]>,
}

impl TextureImage {
    /// Reads PNG, JPEG, or PPM and its kin, whatever the file is called.
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

    /// The colour at a place, blended from the four texels around it.
    pub(crate) fn at(&self, [u, v]: [f32; 2]) -> Vec3 {
        if self.texels.is_empty() || !(u.is_finite() && v.is_finite()) {
            return Vec3::ONE;
        }
        // Centres of texels are at halves.
        let place = |x: f32, count: u32| {
            let x = (x - x.floor()) * count as f32 - 0.5;
            let before = x.floor();
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "before the first is the last; beyond the last rounding leads to the first"
            )]
            let first = if before < 0.0 {
                count - 1
            } else {
                before as u32 % count
            };
            (first, (first + 1) % count, x - before)
        };
        let (left, right, across) = place(u, self.width);
        let (above, below, down) = place(v, self.height);
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
    fn colours_are_blended_and_repeat() {
        let mut image = RgbImage::new(2, 1);
        image.put_pixel(0, 0, image::Rgb([255, 0, 0]));
        image.put_pixel(1, 0, image::Rgb([0, 0, 255]));
        let texture = TextureImage::new(&image, ColorSpace::Display);
        assert_eq!(texture.at([0.25, 0.9]), Vec3::X, "the middle of a texel");
        assert_eq!(texture.at([0.5, 0.5]), Vec3::new(0.5, 0.0, 0.5), "half way");
        assert_eq!(
            texture.at([0.0, 0.5]),
            Vec3::new(0.5, 0.0, 0.5),
            "over the edge"
        );
        assert_eq!(texture.at([-4.75, 7.0]), Vec3::X, "far away");
        for place in [[1e30, -1e30], [1.0 - f32::EPSILON / 2.0, 1.0], [-1e-9, 0.0]] {
            assert!(texture.at(place).is_finite(), "{place:?}");
        }
        assert_eq!(texture.at([f32::NAN, 0.0]), Vec3::ONE, "nowhere");
    }
}
