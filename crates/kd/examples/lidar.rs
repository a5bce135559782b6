//! Scans wooded hills from the air, with up to five returns of each pulse, and draws the points by the number of their return.
//!
//! ```text
//! cargo run --release --example lidar [-- lidar.png]
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;

use fastrand::Rng;
use image::{Rgb, RgbImage};
use kd::glam::Vec3;
use kd::{BuildOptions, KdTree, Mesh, MeshError, Ray};
use kd_scene::Lidar;

const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;
/// The first row of the section below the view from above.
const SECTION: f32 = 288.0;
const METERS_PER_PIXEL: f32 = 320.0 / 512.0;
const RETURNS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1);
    let path = path.unwrap_or_else(|| "lidar.png".to_owned());
    let tree = KdTree::build(wooded_hills()?, &BuildOptions::balanced())?;
    let pulses = pulses();
    let returns = tree.hits_batch(&pulses, RETURNS);

    let mut image = RgbImage::from_pixel(WIDTH, HEIGHT, Rgb([16, 18, 24]));
    // A pixel shows the highest point, or the nearest one of the section.
    let mut priority = vec![f32::NEG_INFINITY; (WIDTH * HEIGHT) as usize];
    for (pulse, hits) in pulses.iter().zip(returns.iter()) {
        for (number, hit) in hits.iter().enumerate() {
            let at = hit.point(pulse);
            let color = color_of(number, hits.len());
            let [x, y, z] = (at / METERS_PER_PIXEL).to_array();
            let from_above = 0.5 * SECTION - y;
            if from_above < SECTION {
                // A step brighter every 5 m.
                let color = (0.6 + 0.05 * (at.z / 5.0).floor()) * color;
                plot(&mut image, &mut priority, [x, from_above], z, color);
            }
            if at.y.abs() < 3.0 {
                let y_of_section = HEIGHT as f32 - 8.0 - z;
                plot(&mut image, &mut priority, [x, y_of_section], -y, color);
            }
        }
    }
    image.save(&path)?;
    let count = returns.hits().len();
    println!("{path}: {} pulses, {count} returns", pulses.len());
    Ok(())
}

/// The lines of a flight along x, at 300 m: a LiDAR that turns about the direction of flight, as far as it looks down.
fn pulses() -> Vec<Ray> {
    // Off the edges between squares, where a ray meets the triangles of both.
    let lines = (0..900).map(|line: u16| 0.37 + 320.0 * f32::from(line) / 900.0);
    let turns = lines.map(|x| Lidar {
        forward: Vec3::NEG_Z,
        channels: 1,
        elevation_degrees: [0.0, 0.0],
        steps: 6000,
        ..Lidar::new(Vec3::new(x, 0.37, 300.0), Vec3::X)
    });
    let down = (0..300).chain(5700..6000);
    turns
        .flat_map(|lidar| down.clone().map(move |step| lidar.ray(step, 0)))
        .collect()
}

fn ground_at(x: f32, y: f32) -> f32 {
    11.0 + 6.0 * (0.021 * x + 0.6).sin()
        + 4.0 * (0.034 * y - 0.017 * x).cos()
        + 0.4 * (0.2 * x).sin() * (0.17 * y).cos()
}

/// Squares of 4 m, and trees: cones of small leaves, between which pulses pass.
fn wooded_hills() -> Result<Mesh, MeshError> {
    let mut corners: Vec<[f32; 3]> = Vec::new();
    let mut add = |triangle: [Vec3; 3]| corners.extend(triangle.map(<[f32; 3]>::from));
    for square in 0..80 * 60_u16 {
        let [x, y] = [square % 80, square / 80].map(|i| 4.0 * f32::from(i));
        let [a, b, c, d] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(|[right, up]| {
            let (x, y) = (x + right, y + up - 120.0);
            Vec3::new(x, y, ground_at(x, y))
        });
        add([a, b, c]);
        add([a, c, d]);
    }
    let mut rng = Rng::with_seed(3);
    let mut random = || Vec3::new(rng.f32(), rng.f32(), rng.f32());
    for _ in 0..450 {
        let [x, y, size] = random().to_array();
        let [x, y, height] = [320.0 * x, 200.0 * y - 100.0, 9.0 + 13.0 * size];
        let foot = Vec3::new(x, y, ground_at(x, y));
        for _ in 0..500 {
            let [up, turn, out] = random().to_array();
            let up = 0.2 + 0.8 * up;
            let (sine, cosine) = (std::f32::consts::TAU * turn).sin_cos();
            let radius = 0.36 * (1.1 - up) * out.sqrt();
            let leaf = foot + height * Vec3::new(radius * cosine, radius * sine, up);
            add([0, 1, 2].map(|_| leaf + random() - 0.5));
        }
    }
    let firsts = (0..).step_by(3).take(corners.len() / 3);
    let triangles = firsts
        .map(|first: u32| [first, first + 1, first + 2])
        .collect();
    Mesh::new(corners, triangles)
}

/// Gray for the only return of a pulse, green for the first of several, yellow between, orange for the last.
fn color_of(number: usize, count: usize) -> Vec3 {
    match number {
        0 if count == 1 => Vec3::new(0.62, 0.62, 0.68),
        0 => Vec3::new(0.2, 0.8, 0.35),
        last if last + 1 == count => Vec3::new(1.0, 0.5, 0.15),
        _ => Vec3::new(1.0, 0.92, 0.35),
    }
}

/// Draws a point at a place in pixels over those of less priority.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within the image, and casts to u8 saturate"
)]
fn plot(image: &mut RgbImage, priority: &mut [f32], [x, y]: [f32; 2], of_point: f32, color: Vec3) {
    if x < 0.0 || y < 0.0 || x >= WIDTH as f32 || y >= HEIGHT as f32 {
        return;
    }
    let (x, y) = (x as u32, y as u32);
    let before = &mut priority[(y * WIDTH + x) as usize];
    if of_point > *before {
        *before = of_point;
        let color = (255.0 * color).to_array().map(|channel| channel as u8);
        image.put_pixel(x, y, Rgb(color));
    }
}
