//! Renders a mesh file, or a generated scene without one, to `picture.png`: closest hits for what is seen, any hits for shadows.
//!
//! ```text
//! cargo run --release --example picture [-- bunny.ply]
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;

use image::{Rgb, RgbImage};
use kd::glam::Vec3;
use kd::{BuildOptions, KdTree, Ray, load_mesh, offset_origin};
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
            let scene = Spd::Tree.generate(7)?;
            (scene.mesh, scene.camera, scene.lights[0])
        }
    };
    let tree = KdTree::build(mesh, &BuildOptions::balanced())?;
    println!("{}", tree.stats());

    let view = camera.view(WIDTH as f32 / HEIGHT as f32);
    let image = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let ray = Ray::new(view.eye, view.through_pixel(x, y, WIDTH, HEIGHT));
        Rgb(shade(&tree, &ray, light).map(to_byte))
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

/// Linear colour, 0 to 1: sky, or grey lit by one lamp.
fn shade(tree: &KdTree, ray: &Ray, light: Vec3) -> [f32; 3] {
    let Some(hit) = tree.intersect(ray) else {
        return [0.08, 0.36, 0.75];
    };
    let mut normal = tree.mesh().normal(hit.triangle);
    if normal.dot(ray.direction) > 0.0 {
        normal = -normal;
    }
    let point = offset_origin(hit.point(ray), normal);
    let to_light = (light - point).normalize_or_zero();
    let lit = normal.dot(to_light) > 0.0 && !tree.occluded(&Ray::between(point, light));
    let diffuse = if lit { normal.dot(to_light) } else { 0.0 };
    [0.1 + 0.8 * diffuse; 3]
}
