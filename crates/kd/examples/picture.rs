//! Renders a mesh file, or a generated scene without one, to `picture.png`: closest hits for what is seen, any hits for shadows.
//!
//! ```text
//! cargo run --release --example picture [-- bunny.ply]
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;

use image::{Rgb, RgbImage};
use kd::glam::Vec3;
use kd::{BuildOptions, KdTree, Ray, load_mesh};
use kd_scene::{Camera, Spd};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

fn main() -> Result<(), Box<dyn Error>> {
    let (mesh, camera, light) = match std::env::args().nth(1) {
        Some(path) => {
            let mesh = load_mesh(path)?;
            let camera = Camera::looking_at_whole(mesh.bounds(), Vec3::Y);
            let light = kd_scene::light_above(mesh.bounds(), Vec3::Y);
            (mesh, camera, light)
        }
        None => {
            let scene = Spd::Tree.generate(9)?;
            (scene.mesh, scene.camera, scene.lights[0])
        }
    };
    let tree = KdTree::build(mesh, &BuildOptions::balanced())?;
    println!("{}", tree.stats());

    // Four rays to a pixel: an image of twice the size, averaged.
    let view = camera.view(WIDTH as f32 / HEIGHT as f32);
    let image = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let colors = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, down)| {
            let direction = view.through_pixel(2 * x + right, 2 * y + down, 2 * WIDTH, 2 * HEIGHT);
            shade(&tree, &Ray::new(view.eye, direction), light)
        });
        let mean = 0.25 * colors.into_iter().sum::<Vec3>();
        Rgb(mean.to_array().map(to_byte))
    });
    image.save("picture.png")?;
    println!("picture.png: {WIDTH} x {HEIGHT}");
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

/// Linear color, 0 to 1: sky, or gray lit by one lamp.
fn shade(tree: &KdTree, ray: &Ray, light: Vec3) -> Vec3 {
    let Some(hit) = tree.intersect(ray) else {
        return Vec3::new(0.55, 0.72, 0.9);
    };
    let mut normal = tree.mesh().normal(hit.triangle);
    if normal.dot(ray.direction) > 0.0 {
        normal = -normal;
    }
    let point = tree.mesh().offset_origin(&hit, normal);
    let to_light = (light - point).normalize_or_zero();
    let lit = normal.dot(to_light) > 0.0 && !tree.occluded(&Ray::between(point, light));
    let diffuse = if lit { normal.dot(to_light) } else { 0.0 };
    let (sun, sky) = (Vec3::new(0.85, 0.75, 0.6), Vec3::new(0.08, 0.1, 0.14));
    diffuse * sun + (0.6 + 0.4 * normal.z) * sky
}
