//! A picture, ray by ray.

use std::error::Error;

use image::{Rgb, RgbImage};
use kd::Ray;
use kd::glam::Vec3;
use kd_scene::Camera;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

/// Writes what a camera sees to a file, or to the one that the first argument names, and prints its size. `color` is that of a ray, linear, 0 to 1. Four rays to a pixel: an image of
/// twice the size, averaged.
#[allow(clippy::print_stdout, reason = "a program that a person runs")]
pub(crate) fn write(
    file: &str,
    camera: &Camera,
    color: impl Fn(&Ray) -> Vec3,
) -> Result<(), Box<dyn Error>> {
    let view = camera.view(WIDTH as f32 / HEIGHT as f32);
    let image = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let colors = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, down)| {
            let direction = view.through_pixel(2 * x + right, 2 * y + down, 2 * WIDTH, 2 * HEIGHT);
            color(&Ray::new(view.eye, direction))
        });
        let mean = 0.25 * colors.into_iter().sum::<Vec3>();
        Rgb(mean.to_array().map(to_byte))
    });
    let named = std::env::args().nth(1);
    let file = named.as_deref().unwrap_or(file);
    image.save(file)?;
    println!("{file}: {WIDTH} x {HEIGHT}");
    Ok(())
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts from float to u8 saturate"
)]
fn to_byte(linear: f32) -> u8 {
    (linear.sqrt() * 255.0) as u8
}
