//! Renders twenty thousand spheres to `spheres.png`: a tree over primitives of its own, closest hits for what is seen, any hits for
//! shadows.
//!
//! ```text
//! cargo run --release --example spheres [-- spheres.png]
//! ```

#[path = "shapes/picture.rs"]
mod picture;
#[path = "shapes/sphere.rs"]
mod sphere;

use std::error::Error;

use kd::custom::PrimitiveTree;
use kd::glam::Vec3;
use kd::{BuildOptions, Ray, RayQuery, offset_origin};
use kd_scene::Camera;
use sphere::{Sphere, Spheres};

/// Spheres of the flower.
const COUNT: u16 = 20_000;

fn main() -> Result<(), Box<dyn Error>> {
    let tree = PrimitiveTree::build(flower(), &BuildOptions::balanced())?;
    let camera = Camera {
        eye: Vec3::new(0.0, -2.6, 1.9),
        target: Vec3::new(0.0, -0.1, 0.0),
        up: Vec3::Z,
        fov_degrees: 40.0,
    };
    let light = Vec3::new(-2.0, -1.0, 3.0);
    picture::write("spheres.png", &camera, |ray| shade(&tree, ray, light))
}

/// Spheres in the order of a sunflower's seeds, on a sphere for ground.
fn flower() -> Spheres {
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0_f32.sqrt());
    let seeds = (0..COUNT).map(|seed| {
        let part = (f32::from(seed) + 0.5) / f32::from(COUNT);
        let (sin, cos) = (golden_angle * f32::from(seed)).sin_cos();
        let away = part.sqrt();
        let wave = 0.08 * (20.0 * away).cos() * (1.0 - away);
        Sphere {
            center: Vec3::new(away * cos, away * sin, 0.02 + wave.abs()),
            radius: 0.004 + 0.008 * away,
        }
    });
    let ground = Sphere {
        center: Vec3::new(0.0, 0.0, -1000.0),
        radius: 1000.0,
    };
    Spheres(seeds.chain([ground]).collect())
}

/// Linear color, 0 to 1: sky, or a sphere lit by one lamp.
fn shade(tree: &PrimitiveTree<Spheres>, ray: &Ray, light: Vec3) -> Vec3 {
    let Some(hit) = tree.intersect(ray) else {
        return Vec3::new(0.55, 0.72, 0.9);
    };
    let spheres = &tree.primitives().0;
    let sphere = spheres[hit.triangle as usize];
    let point = hit.point(ray);
    let normal = (point - sphere.center).normalize();
    let start = offset_origin(point, normal);
    let to_light = (light - start).normalize();
    let is_lit = normal.dot(to_light) > 0.0 && !tree.occluded(&Ray::between(start, light));
    let diffuse = if is_lit { normal.dot(to_light) } else { 0.0 };
    let is_ground = hit.triangle == u32::from(COUNT);
    let color = if is_ground {
        Vec3::new(0.45, 0.5, 0.4)
    } else {
        let part = hit.triangle as f32 / f32::from(COUNT);
        Vec3::new(0.95, 0.75 - 0.6 * part, 0.12)
    };
    let sky = 0.25 + 0.15 * normal.z;
    (0.9 * diffuse + sky) * color
}
