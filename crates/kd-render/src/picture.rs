//! The image that a rendering produces.

use std::path::Path;

use image::{ImageError, Rgb, RgbImage};
use kd::glam::Vec3;
use kd_scene::ColorSpace;

/// An image of `width` × `height` pixels, stored row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue of each pixel, from 0 to 1. Values above 1 are clamped on output.
    pub pixels: Vec<Vec3>,
    /// The color space of [`pixels`](Self::pixels).
    pub colors: ColorSpace,
}

impl Picture {
    /// An image of one color.
    pub fn new(width: u32, height: u32, color: Vec3, colors: ColorSpace) -> Self {
        Self {
            width,
            height,
            pixels: vec![color; width as usize * height as usize],
            colors,
        }
    }

    /// The pixel in `column` and `row`, both from 0 at the upper left.
    ///
    /// # Panics
    ///
    /// If `column` or `row` is outside of the image.
    pub fn at(&self, column: u32, row: u32) -> Vec3 {
        self.pixels[self.index(column, row)]
    }

    pub(crate) fn set(&mut self, column: u32, row: u32, color: Vec3) {
        let index = self.index(column, row);
        self.pixels[index] = color;
    }

    fn index(&self, column: u32, row: u32) -> usize {
        assert!(
            column < self.width && row < self.height,
            "pixel ({column}, {row}) of {} x {}",
            self.width,
            self.height
        );
        row as usize * self.width as usize + column as usize
    }

    /// The image as it is displayed and saved: eight bits per channel, clamped to 0..=255.
    pub fn to_image(&self) -> RgbImage {
        RgbImage::from_fn(self.width, self.height, |column, row| {
            Rgb(self.colors.encoded(self.at(column, row)))
        })
    }

    /// Saves the image; the extension of `path` selects the format.
    ///
    /// # Errors
    ///
    /// If the extension is unknown, or the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), ImageError> {
        self.to_image().save(path)
    }
}
