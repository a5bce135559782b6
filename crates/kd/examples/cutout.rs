//! Renders a tree whose fronds are squares with a mask: rays go on through what is no leaf, to leaves behind, to the ground, to the sun.
//!
//! ```text
//! cargo run --release --example cutout [-- cutout.png]
//! ```

#![allow(clippy::print_stdout, reason = "a program that a person runs")]

use std::error::Error;

use fastrand::Rng;
use image::{Rgb, RgbImage};
use kd::glam::Vec3;
use kd::{BuildOptions, Hit, KdTree, Mesh, MeshError, Ray, Verdict};
use kd_scene::Camera;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
/// Triangles of the ground and of the trunk; all others are of fronds.
const GROUND: u32 = 2;
const TRUNK: u32 = GROUND + 8;
const TO_SUN: Vec3 = Vec3::new(0.5, -0.35, 0.79);

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1);
    let path = path.unwrap_or_else(|| "cutout.png".to_owned());
    let tree = KdTree::build(mesh()?, &BuildOptions::balanced())?;

    let camera = Camera {
        eye: Vec3::new(-2.2, -7.5, 2.6),
        target: Vec3::new(-0.5, 0.0, 1.65),
        up: Vec3::Z,
        fov_degrees: 33.0,
    };
    let view = camera.view(WIDTH as f32 / HEIGHT as f32);
    // Nine rays to a pixel, one after the other.
    let rays: Vec<Ray> = (0..9 * WIDTH * HEIGHT)
        .map(|i| {
            let (pixel, part) = (i / 9, i % 9);
            let x = 3 * (pixel % WIDTH) + part % 3;
            let y = 3 * (pixel / WIDTH) + part / 3;
            Ray::new(view.eye, view.through_pixel(x, y, 3 * WIDTH, 3 * HEIGHT))
        })
        .collect();
    let mut hits = vec![None; rays.len()];
    tree.intersect_filtered_batch(&rays, &mut hits, |_, hit| verdict(hit));

    // A ray to the sun from the lit side of each hit. Where there is none, a ray without a direction hits nothing.
    let to_sun: Vec<Ray> = hits
        .iter()
        .map(|hit| match hit {
            Some(hit) => {
                let normal = tree.mesh().normal(hit.triangle);
                let lit_side = normal.dot(TO_SUN).signum() * normal;
                Ray::new(tree.mesh().offset_origin(hit, lit_side), TO_SUN)
            }
            None => Ray::new(Vec3::ZERO, Vec3::ZERO),
        })
        .collect();
    let mut in_shadow = vec![false; rays.len()];
    tree.occluded_filtered_batch(&to_sun, &mut in_shadow, |_, hit| verdict(hit));

    let color = |i: usize| match &hits[i] {
        Some(hit) => surface_color(tree.mesh(), &rays[i], hit, in_shadow[i]),
        None => sky_color(rays[i].direction),
    };
    let image = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let first = 9 * (y * WIDTH + x) as usize;
        let sum: Vec3 = (first..first + 9).map(color).sum();
        Rgb((sum / 9.0).to_array().map(to_byte))
    });
    image.save(&path)?;
    println!("{path}: {} triangles", tree.mesh().len());
    Ok(())
}

/// Whether a ray ends at a hit: everywhere but beside the leaves of a frond.
fn verdict(hit: &Hit) -> Verdict {
    if hit.triangle < TRUNK || is_leaf(hit) {
        Verdict::Accept
    } else {
        Verdict::Reject
    }
}

/// The mask: a stem with leaflets on both sides, which get shorter towards its tip.
fn is_leaf(hit: &Hit) -> bool {
    // The second triangle of a square begins at the same corner as the first, and has the last two corners of the square.
    let [x, y] = if hit.triangle.is_multiple_of(2) {
        [hit.u + hit.v, hit.v]
    } else {
        [hit.u, hit.u + hit.v]
    };
    let side = 2.0 * (x - 0.5).abs();
    let length = (1.0 - y).min(6.0 * y).sqrt();
    let across = 2.0 * ((7.0 * (y - 0.25 * side)).rem_euclid(1.0) - 0.5);
    let along = side / length.max(0.01);
    side < 0.04 || across * across < 0.8 * (1.0 - along * along).max(0.0)
}

/// All squares: the ground, a trunk, and fronds around its top.
fn mesh() -> Result<Mesh, MeshError> {
    let mut corners: Vec<[f32; 3]> = Vec::new();
    let mut add = |square: [Vec3; 4]| corners.extend(square.map(<[f32; 3]>::from));
    let ground = [[-40.0, -20.0], [40.0, -20.0], [40.0, 60.0], [-40.0, 60.0]];
    add(ground.map(|[x, y]| Vec3::new(x, y, 0.0)));
    let top = 2.4 * Vec3::Z;
    let sides = [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y, Vec3::X];
    for side in sides.windows(2) {
        let [a, b] = [side[0], side[1]];
        add([0.16 * a, 0.16 * b, top + 0.06 * b, top + 0.06 * a]);
    }
    let mut rng = Rng::with_seed(7);
    let mut random = || 2.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - Vec3::ONE;
    for _ in 0..130 {
        let out = (random() + 0.2 * Vec3::Z).normalize_or(Vec3::Z);
        let from = top + 0.6 * out + 0.35 * random();
        let stem = 0.75 * (out + 0.5 * random() - 0.3 * Vec3::Z).normalize_or(out);
        let half = 0.3 * stem.cross(Vec3::Z + 0.8 * random()).normalize_or(Vec3::X);
        add([
            from - half,
            from + half,
            from + stem + half,
            from + stem - half,
        ]);
    }
    let firsts = (0..).step_by(4).take(corners.len() / 4);
    let pairs = firsts.map(|a: u32| [[a, a + 1, a + 2], [a, a + 2, a + 3]]);
    let triangles = pairs.flatten().collect();
    Mesh::new(corners, triangles)
}

fn sky_color(direction: Vec3) -> Vec3 {
    let up = direction.normalize_or_zero().z.clamp(0.0, 1.0);
    Vec3::new(0.62, 0.78, 0.92).lerp(Vec3::new(0.2, 0.42, 0.78), up.sqrt())
}

/// Linear color, 0 to 1. The sun also shines through leaves from behind.
fn surface_color(mesh: &Mesh, ray: &Ray, hit: &Hit, in_shadow: bool) -> Vec3 {
    let normal = mesh.normal(hit.triangle);
    let normal = -normal.dot(ray.direction).signum() * normal;
    let (color, through) = match hit.triangle {
        0..GROUND => (Vec3::new(0.42, 0.36, 0.22), 0.0),
        GROUND..TRUNK => (Vec3::new(0.25, 0.16, 0.1), 0.0),
        _ => (Vec3::new(0.2, 0.42, 0.08), 0.5),
    };
    let facing = normal.dot(TO_SUN);
    let sun = if in_shadow {
        0.0
    } else {
        facing.max(-through * facing)
    };
    let sky = (0.35 + 0.15 * normal.z) * sky_color(Vec3::new(0.0, 1.0, 0.3));
    color * (1.6 * sun * Vec3::new(1.0, 0.92, 0.78) + sky)
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "casts from float to u8 saturate"
)]
fn to_byte(linear: f32) -> u8 {
    (linear.max(0.0).sqrt() * 255.0) as u8
}
