//! Draws a slice through the signed distance field of a closed mesh, a file or three gears, to `signed-distance.png`: blue inside, orange
//! outside, with a line at each hundredth of the diagonal.
//!
//! ```text
//! cargo run --release --example signed_distance [-- bunny.ply]
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;

use image::{Rgb, RgbImage};
use kd::glam::Vec3;
use kd::{BuildOptions, KdTree, load_mesh};
use kd_scene::Spd;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
/// Lines for each diagonal.
const LINES: f32 = 100.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mesh = match std::env::args().nth(1) {
        Some(path) => load_mesh(path)?,
        None => Spd::Gears.generate(1)?.mesh,
    };
    let is_closed = mesh.is_closed();
    let bounds = mesh.bounds();
    let tree = KdTree::build(mesh, &BuildOptions::balanced())?;

    // A rectangle through the middle, a fifth larger than the box, seen along z.
    let per_pixel = (1.2 * bounds.extent().truncate()
        / Vec3::new(WIDTH as f32, HEIGHT as f32, 1.0).truncate())
    .max_element();
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let points: Vec<Vec3> = pixels
        .map(|(x, y)| {
            let (right, up) = (
                x as f32 - 0.5 * WIDTH as f32,
                0.5 * HEIGHT as f32 - y as f32,
            );
            bounds.center() + per_pixel * Vec3::new(right, up, 0.0)
        })
        .collect();
    let mut distances = vec![None; points.len()];
    tree.par_signed_distance_batch(&points, &mut distances);

    let distances: Vec<f32> = distances.into_iter().flatten().collect();
    let inside = distances.iter().filter(|distance| **distance < 0.0).count();
    let unit = bounds.diagonal() / LINES;
    let image = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        Rgb(color(distances[(y * WIDTH + x) as usize] / unit))
    });
    image.save("signed-distance.png")?;
    let share = 100.0 * inside as f32 / distances.len() as f32;
    let deepest = distances.iter().copied().fold(f32::INFINITY, f32::min);
    println!(
        "signed-distance.png: {share:.1} % inside, at most {:.4} deep; closed: {is_closed}",
        -deepest
    );
    Ok(())
}

/// The color of a distance in lines: darker next to a line, and white on the surface.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts from float to u8 saturate"
)]
fn color(lines: f32) -> [u8; 3] {
    let surface = Vec3::splat(1.0);
    let far = if lines < 0.0 {
        Vec3::new(0.1, 0.3, 0.7)
    } else {
        Vec3::new(0.95, 0.6, 0.2)
    };
    let faded = surface.lerp(far, 1.0 - (-0.12 * lines.abs()).exp());
    let to_line = (lines - lines.round()).abs();
    let shade = if lines.abs() < 0.2 {
        0.15
    } else {
        0.8 + 0.2 * (to_line / 0.12).min(1.0)
    };
    (shade * faded * 255.0).to_array().map(|x| x as u8)
}
