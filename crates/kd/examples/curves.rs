//! Renders a meadow of curves to `curves.png`: a tree over primitives of its own, closest hits for what is seen, any hits for shadows.
//!
//! ```text
//! cargo run --release --example curves [-- curves.png]
//! ```

#[path = "shapes/curve.rs"]
mod curve;
#[path = "shapes/picture.rs"]
mod picture;

use std::error::Error;

use curve::{Curve, Curves};
use kd::custom::PrimitiveTree;
use kd::glam::Vec3;
use kd::{BuildOptions, Ray, RayQuery, offset_origin};
use kd_scene::Camera;

/// Blades of grass.
const COUNT: usize = 12_000;

fn main() -> Result<(), Box<dyn Error>> {
    let tree = PrimitiveTree::build(meadow(), &BuildOptions::balanced())?;
    let camera = Camera {
        eye: Vec3::new(0.0, -1.9, 0.9),
        target: Vec3::new(0.0, 0.0, 0.1),
        up: Vec3::Z,
        fov_degrees: 40.0,
    };
    let light = Vec3::new(-2.0, -1.5, 3.0);
    picture::write("curves.png", &camera, |ray| shade(&tree, ray, light))
}

/// Blades that bend in the wind, thin at their tips.
fn meadow() -> Curves {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut signed = move || 2.0 * rng.f32() - 1.0;
    let wind = Vec3::new(0.10, 0.02, 0.0);
    let blade = |_| {
        let root = loop {
            let at = Vec3::new(signed(), signed(), 0.0);
            if at.length() <= 1.0 {
                break at;
            }
        };
        let height = 0.21 + 0.09 * signed();
        let bend = wind + 0.12 * Vec3::new(signed(), signed(), 0.0);
        let up = Vec3::Z * height;
        let points = [
            root,
            root + 0.4 * up,
            root + 0.8 * up + 0.3 * bend,
            root + 0.95 * up + bend,
        ];
        let radii = [0.004, 0.004, 0.003, 0.0005];
        Curve([0, 1, 2, 3].map(|k: usize| points[k].extend(radii[k])))
    };
    Curves((0..COUNT).map(blade).collect())
}

/// Linear color, 0 to 1: sky, ground, or a blade lit by one lamp.
fn shade(tree: &PrimitiveTree<Curves>, ray: &Ray, light: Vec3) -> Vec3 {
    let (point, normal, color) = if let Some(hit) = tree.intersect(ray) {
        let point = hit.point(ray);
        let center = tree.primitives().0[hit.triangle as usize]
            .at(hit.u)
            .truncate();
        let normal = (point - center).normalize();
        let shade = (hit.triangle % 64) as f32 / 64.0;
        let color = Vec3::new(0.25 + 0.3 * shade, 0.5 + 0.15 * hit.u, 0.1);
        (point, normal, color)
    } else {
        let t = -ray.origin.z / ray.direction.z;
        let point = ray.at(t);
        if t <= 0.0 || point.length() > 1.1 {
            return Vec3::new(0.62, 0.76, 0.9);
        }
        (point, Vec3::Z, Vec3::new(0.3, 0.22, 0.14))
    };
    let start = offset_origin(point, normal);
    let to_light = (light - start).normalize();
    let is_lit = normal.dot(to_light) > 0.0 && !tree.occluded(&Ray::between(start, light));
    let diffuse = if is_lit { normal.dot(to_light) } else { 0.0 };
    (0.9 * diffuse + 0.25 + 0.1 * normal.z) * color
}
