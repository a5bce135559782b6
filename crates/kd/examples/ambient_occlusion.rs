//! Renders how much of its surroundings each point of a generated room sees (ambient occlusion): any hits in batches on all threads.
//!
//! ```text
//! cargo run --release --example ambient_occlusion [-- ambient_occlusion.png]
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;
use std::f32::consts::TAU;

use fastrand::Rng;
use image::{GrayImage, Luma};
use kd::glam::Vec3;
use kd::{BuildOptions, KdTree, Ray};
use kd_scene::Room;

const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;
/// Rays through each pixel, and rays from each point that they hit.
const PER_PIXEL: u32 = 4;
const PER_POINT: u32 = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1);
    let path = path.unwrap_or_else(|| "ambient_occlusion.png".to_owned());
    let room = Room::Library.generate(60)?;
    let tree = KdTree::build(room.mesh, &BuildOptions::balanced())?;
    // What is farther away does not darken.
    let reach = 0.1 * tree.mesh().bounds().diagonal();

    let view = room.camera.view(WIDTH as f32 / HEIGHT as f32);
    let mut random = Rng::with_seed(1);
    let mut image = GrayImage::new(WIDTH, HEIGHT);
    let mut count = 0;
    // A row at a time bounds the memory for rays.
    for y in 0..HEIGHT {
        let mut rays = Vec::new();
        for i in 0..WIDTH * PER_PIXEL {
            let (x, quarter) = (i / PER_PIXEL, i % PER_PIXEL);
            let (x, y) = (2 * x + quarter % 2, 2 * y + quarter / 2);
            rays.push(Ray::new(
                view.eye,
                view.through_pixel(x, y, 2 * WIDTH, 2 * HEIGHT),
            ));
        }
        let mut hits = vec![None; rays.len()];
        tree.par_intersect_batch(&rays, &mut hits);

        let mut probes = Vec::new();
        for (ray, hit) in rays.iter().zip(&hits) {
            let Some(hit) = hit else { continue };
            let normal = tree.mesh().normal(hit.triangle);
            let normal = -normal.dot(ray.direction).signum() * normal;
            let from = tree.mesh().offset_origin(hit, normal);
            let turn = [random.f32(), random.f32()];
            let directions = (0..PER_POINT).map(|i| cosine_around(normal, i, turn));
            probes.extend(directions.map(|to| Ray::new(from, to).with_range(0.0, reach)));
        }
        let mut occluded = vec![false; probes.len()];
        tree.par_occluded_batch(&probes, &mut occluded);
        count += rays.len() + probes.len();

        let mut free = vec![0; WIDTH as usize];
        let mut points = occluded.chunks(PER_POINT as usize);
        for (x, hit) in (0..WIDTH * PER_PIXEL).map(|i| i / PER_PIXEL).zip(hits) {
            free[x as usize] += match hit {
                Some(_) => points
                    .next()
                    .unwrap_or_default()
                    .iter()
                    .map(|occluded| u32::from(!occluded))
                    .sum(),
                None => PER_POINT,
            };
        }
        for (x, free) in (0..).zip(free) {
            let level = 255 * free / (PER_PIXEL * PER_POINT);
            image.put_pixel(x, y, Luma([u8::try_from(level)?]));
        }
    }
    image.save(&path)?;
    println!("{path}: {} triangles, {count} rays", tree.mesh().len());
    Ok(())
}

/// Direction `i` of [`PER_POINT`] above a surface, whose density is proportional to the cosine to the normal: the share of free ones is
/// the share of even light that arrives. They are spread evenly, and shifted for each point.
fn cosine_around(normal: Vec3, i: u32, [shift, turn]: [f32; 2]) -> Vec3 {
    let z = 2.0 * (i as f32 + shift) / PER_POINT as f32 - 1.0;
    let (sine, cosine) = (TAU * (0.618 * i as f32 + turn)).sin_cos();
    let on_sphere = (1.0 - z * z).max(0.0).sqrt() * Vec3::new(cosine, sine, 0.0) + z * Vec3::Z;
    (normal + on_sphere).normalize_or(normal)
}
