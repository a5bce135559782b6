//! Draws a slice through the signed distance field of a closed mesh, a file or a knot, to `signed-distance.png`: blue inside, orange outside,
//! with a line at each hundredth of the diagonal.
//!
//! ```text
//! cargo run --release --example signed_distance [-- bunny.ply]
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;
use std::f32::consts::TAU;

use image::{Rgb, RgbImage};
use kd::glam::{Vec2, Vec3};
use kd::{BuildOptions, KdTree, Mesh, MeshError, load_mesh};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
/// Lines for each diagonal.
const LINES: f32 = 100.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mesh = match std::env::args().nth(1) {
        Some(path) => load_mesh(path)?,
        None => knot(300, 40)?,
    };
    let is_closed = mesh.is_closed();
    let bounds = mesh.bounds();
    let tree = KdTree::build(mesh, &BuildOptions::balanced())?;

    // A rectangle through the middle, a fifth larger than the box, seen along z.
    let size = Vec2::new(WIDTH as f32, HEIGHT as f32);
    let per_pixel = (1.2 * bounds.extent().truncate() / size).max_element();
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| Vec2::new(x as f32, y as f32)));
    let points: Vec<Vec3> = pixels
        .map(|pixel| {
            let from_middle = per_pixel * (pixel + 0.5 - 0.5 * size) * Vec2::new(1.0, -1.0);
            bounds.center() + from_middle.extend(0.0)
        })
        .collect();
    let mut distances = vec![None; points.len()];
    tree.par_signed_distance_batch(&points, &mut distances);

    let distances: Vec<f32> = distances
        .into_iter()
        .map(|distance| distance.unwrap_or(f32::INFINITY))
        .collect();
    let inside = distances.iter().filter(|distance| **distance < 0.0).count();
    let unit = bounds.diagonal() / LINES;
    let image = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        Rgb(color(distances[(y * WIDTH + x) as usize] / unit))
    });
    image.save("signed-distance.png")?;
    let share = 100.0 * inside as f32 / distances.len() as f32;
    println!("signed-distance.png: {share:.1} % inside; closed: {is_closed}");
    Ok(())
}

/// A tube around a trefoil knot.
fn knot(along: u32, around: u32) -> Result<Mesh, MeshError> {
    const RADIUS: f32 = 0.45;
    let center = |t: f32| {
        let (x, y) = (
            t.sin() + 2.0 * (2.0 * t).sin(),
            t.cos() - 2.0 * (2.0 * t).cos(),
        );
        Vec3::new(x, y, -(3.0 * t).sin())
    };
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    for i in 0..along {
        let t = TAU * i as f32 / along as f32;
        let forwards = (center(t + 0.01) - center(t - 0.01)).normalize();
        let across = forwards.cross(Vec3::Z).normalize();
        let up = across.cross(forwards);
        for j in 0..around {
            let (sin, cos) = (TAU * j as f32 / around as f32).sin_cos();
            positions.push((center(t) + RADIUS * (cos * across + sin * up)).to_array());
            let corner = |di: u32, dj: u32| (i + di) % along * around + (j + dj) % around;
            let [a, b, c, d] = [corner(0, 0), corner(0, 1), corner(1, 1), corner(1, 0)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Mesh::new(positions, triangles)
}

/// The color of a distance in lines: dark next to a line, and white at the surface.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts from float to u8 saturate"
)]
fn color(lines: f32) -> [u8; 3] {
    let far = if lines < 0.0 {
        Vec3::new(0.1, 0.3, 0.7)
    } else {
        Vec3::new(0.95, 0.6, 0.2)
    };
    let faded = Vec3::ONE.lerp(far, 1.0 - (-0.12 * lines.abs()).exp());
    let to_line = (lines - lines.round()).abs();
    let shade = if lines.abs() < 0.2 {
        0.15
    } else {
        0.75 + 0.25 * (to_line / 0.12).min(1.0)
    };
    (shade * faded * 255.0).to_array().map(|x| x as u8)
}
