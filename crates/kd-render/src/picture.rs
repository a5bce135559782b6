//! Pixels.

use std::path::Path;

use image::{ImageError, Rgb, RgbImage};
use kd::glam::Vec3;
use kd_scene::ColorSpace;

/// A picture, by rows from above.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// In pixels.
    pub width: u32,
    /// In pixels.
    pub height: u32,
    /// Red, green and blue, from 0 to 1 and above where it is too bright.
    pub pixels: Vec<Vec3>,
    /// What these numbers mean.
    pub colors: ColorSpace,
}

impl Picture {
    /// A picture of one colour.
    pub fn new(width: u32, height: u32, color: Vec3, colors: ColorSpace) -> Self {
        Self {
            width,
            height,
            pixels: vec![color; width as usize * height as usize],
            colors,
        }
    }

    /// The pixel in a column and row, from 0 at the upper left.
    ///
    /// # Panics
    ///
    /// If there is no such pixel.
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
            "there is such a pixel"
        );
        row as usize * self.width as usize + column as usize
    }

    /// As it is shown and written: eight bits for each colour, what is too bright cut off.
    pub fn to_image(&self) -> RgbImage {
        RgbImage::from_fn(self.width, self.height, |column, row| {
            Rgb(self.colors.encoded(self.at(column, row)))
        })
    }

    /// Writes it in the format that the name asks for.
    ///
    /// # Errors
    ///
    /// If the name asks for no known format, or the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), ImageError> {
        self.to_image().save(path)
    }
}
