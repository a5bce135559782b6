//! Meshes that are hard in different ways, of any size and offset.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use kd_core::{Mesh, Ray};

use super::{Over, Subject};
use crate::check::source;
use crate::effort;
use crate::rays::that_cannot_hit;
use crate::rng::Rng;
use crate::scenes::{self, Soup};
use crate::watertight::{check_closed, closed_meshes};

/// Meshes of no triangles, with a vertex and without.
#[track_caller]
pub fn no_triangles_no_hits(subject: &Subject) {
    for positions in [vec![], vec![[1.0; 3]]] {
        let mesh = Arc::new(Mesh::new(positions, vec![]).expect("valid"));
        let empty = Over::new(subject, "empty", &mesh);
        let mut rays = that_cannot_hit();
        rays.extend([
            Ray::new([0.0; 3], [1.0; 3]),
            Ray::new([0.0; 3], [0.0, 0.0, 1.0]),
            Ray::new([0.0; 3], [1.0, 2.0, 3.0]),
        ]);
        for ray in rays {
            empty.expect(&ray, 0);
        }
    }
}

/// One triangle, of ordinary size, of the largest and of the smallest; a line; a point.
#[track_caller]
pub fn one_triangle(subject: &Subject) {
    let corners = [[0.0, 0.0, 0.0], [3.0, 0.0, 1.0], [0.0, 2.0, 0.0]];
    let [a, b, _] = corners;
    let rows = [
        (corners, 30),
        ([[0.0; 3], [1.0, 0.0, 0.0], [0.3, 0.9, 0.4]], 30),
        ([[0.0; 3], [1.0, 0.5, 0.0], [0.0, 1.0, 1.0]], 30),
        ([a, b, b], 0),
        ([[0.0; 3], [1.0; 3], [2.0; 3]], 0),
        ([b; 3], 0),
        ([[1.0, 2.0, 3.0]; 3], 0),
        // The sides overflow, as do most rays around this triangle.
        (
            [[-3e38, -3e38, 0.0], [3e38, -3e38, 1.0], [0.0, 3e38, -1.0]],
            0,
        ),
        ([[0.0; 3], [1e-45, 0.0, 0.0], [0.0, 1e-45, 1e-45]], 0),
    ];
    for (corners, per_cent) in rows {
        let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]]);
        let mesh = Arc::new(mesh.expect("valid"));
        let one = Over::new(subject, format!("{corners:?}"), &mesh);
        one.check_random(5, subject.rays, per_cent);
    }
}

/// Points and lines, a few and many.
#[track_caller]
pub fn triangles_without_area_are_not_hit(subject: &Subject) {
    for (count, b) in [
        (1, Vec3::new(1.0, 0.0, 1.0)),
        (20, Vec3::new(1.0, 0.3, 1.2)),
    ] {
        let mut soup = Soup::default();
        let a = Vec3::new(-1.0, 0.0, 1.0);
        for _ in 0..count {
            for corners in [[a, a, a], [a, b, b], [a, b, a.midpoint(b)]] {
                soup.triangle(corners);
            }
        }
        let mesh = Arc::new(soup.mesh());
        let lines = Over::new(subject, "no area", &mesh);
        for target in [a, b, a.midpoint(b)] {
            lines.expect(&Ray::new([0.0; 3], target), 0);
        }
    }
}

/// Meshes without extent along an axis.
#[track_caller]
pub fn flat_along_each_axis(subject: &Subject) {
    for axis in 0..3 {
        let turned = |mut p: Vec3| {
            (p[1], p[axis]) = (p[axis], p[1]);
            p
        };
        let mesh = Arc::new(scenes::moved(&scenes::flat(), turned));
        let flat = Over::new(subject, format!("flat along {axis}"), &mesh);
        flat.check_random(6, subject.rays, 30);
    }
}

/// [`scenes::all`], and a bumpy surface.
#[track_caller]
pub fn nasty_scenes(subject: &Subject) {
    for (name, mesh) in scenes::all()
        .into_iter()
        .chain([("bumpy", scenes::bumpy())])
    {
        let mesh = Arc::new(mesh);
        let over = Over::new(subject, name, &mesh);
        over.check_random(9, subject.rays, 30);
    }
}

/// [`scenes::extreme`].
#[track_caller]
pub fn extreme_scenes(subject: &Subject) {
    for (name, mesh) in scenes::extreme() {
        // Far from the origin few coordinates differ, and at the limits of f32 most rays are not finite.
        let per_cent = if name == "largest" { 1 } else { 5 };
        let mesh = Arc::new(mesh);
        Over::new(subject, name, &mesh).check_random(1, subject.rays, per_cent);
    }
}

/// Scenes of any size and offset.
#[track_caller]
pub fn scales_and_offsets(subject: &Subject) {
    let rows: [(f32, f32); 11] = [
        (1e-38, 0.0),
        (1e-30, 0.0),
        (1e-20, 0.0),
        (1e-6, 1.0),
        (1e-3, 0.0),
        (1.0, 1e5),
        (1e4, 0.0),
        (1e8, -3e9),
        (1e18, 0.0),
        (1e30, 0.0),
        (1e37, 0.0),
    ];
    for (scale, offset) in rows {
        for (name, mesh) in [("soup", scenes::soup()), ("room", scenes::room())] {
            let mesh = Arc::new(scenes::moved(&mesh, |p| p * scale + offset));
            let name = format!("{name} * {scale:e} + {offset:e}");
            Over::new(subject, name, &mesh).check_random(9, subject.rays / 5, 30);
        }
    }
}

/// Triangles as large as every power of two, with smaller ones beside them: rays from near and far, alone, in a tile, in packets
/// and in a stream.
#[track_caller]
pub fn every_power_of_two(subject: &Subject) {
    /// Coherent rays, and as many others.
    const RAYS: u32 = effort::cases(18, 64);
    for exponent in -140..=127 {
        let scale = 2.0_f64.powi(exponent);
        let mut rng = Rng(exponent.unsigned_abs() as u64 + 1);
        let mesh = Arc::new(mixed_sizes(scale, &mut rng));
        let over = Over::new(subject, format!("2^{exponent}"), &mesh);
        // A length of 1 and one as large as the scene: the steps of a ray have another scale than the mesh.
        let lengths = [1.0, scale];
        let mut rays = Vec::new();
        for (number, length) in (0..RAYS).zip(lengths.into_iter().cycle()) {
            // Coherent: through a window, from a point in front of it.
            let across = [
                0.1 + 0.01 * f64::from(number % 8),
                0.01 * f64::from(number / 8),
            ];
            let from = [0.1, 0.0, -1.0];
            rays.push(scaled(
                from,
                scale,
                [across[0] - 0.1, across[1], 1.0],
                length,
            ));
        }
        for (number, length) in (0..RAYS).zip(lengths.into_iter().cycle()) {
            let [from, to] = [0, 1].map(|_| rng.vec3().as_dvec3().to_array());
            // Some come from far away, where that is finite.
            let away = if number % 4 == 0 { 64.0 } else { 1.0 };
            let [x, y, z] = [0, 1, 2].map(|axis| to[axis] - away * from[axis]);
            rays.push(scaled(from.map(|x| away * x), scale, [x, y, z], length));
        }
        let hits: usize = rays.iter().map(|ray| over.check(ray)).sum();
        let is_usual = (-118..=118).contains(&exponent);
        assert!(
            hits > RAYS as usize / 2 || !is_usual,
            "2^{exponent}: {hits} hits"
        );
        over.check_together(&rays);
    }
}

/// A large triangle, and triangles of half its size down to 2^-20 of it.
fn mixed_sizes(scale: f64, rng: &mut Rng) -> Mesh {
    let corner = |p: [f64; 3]| (scale * DVec3::from_array(p)).as_vec3();
    let mut soup = Soup::default();
    soup.triangle([
        corner([-1.0, -1.0, 0.0]),
        corner([1.0, -1.0, 0.0]),
        corner([0.0, 1.0, 0.1]),
    ]);
    for level in 1..=20 {
        let size = 0.5_f64.powi(level);
        let center = rng.vec3().as_dvec3() * 0.5;
        let corners = [0, 1, 2].map(|_| center + size * rng.vec3().as_dvec3());
        soup.triangle(corners.map(|p| corner(p.to_array())));
    }
    soup.mesh()
}

/// A ray with its origin and its direction scaled.
fn scaled(from: [f64; 3], scale: f64, direction: [f64; 3], length: f64) -> Ray {
    let [origin, direction] = [(from, scale), (direction, length)]
        .map(|(v, scale)| (scale * DVec3::from_array(v)).as_vec3());
    Ray::new(origin, direction)
}

/// Rays and directions of any length in scenes of any size.
#[track_caller]
pub fn directions_of_any_length(subject: &Subject) {
    for scale in [1e-30_f32, 1e-12, 1.0, 1e15, 1e30] {
        let mesh = Arc::new(scenes::moved(&scenes::soup(), |p| p * scale));
        let soup = Over::new(subject, format!("soup * {scale:e}"), &mesh);
        let mut rng = Rng(42);
        let mut hits = 0;
        for length in [1e-44_f32, 1e-38, 1e-25, 1e-18, 1.0, 1e19, 1e25, 3e38] {
            for _ in 0..40 {
                let ray = Ray::new(scale * rng.vec3(), length * rng.direction());
                hits += soup.check(&ray);
            }
        }
        assert!(hits > 50, "{scale:e}: {hits}");
    }
}

/// Meshes so small that every product of two coordinates underflows and coordinates have few bits or one, and so large that
/// sums overflow.
#[track_caller]
pub fn the_ends_of_f32(subject: &Subject) {
    let scales = [
        1e-44, 1e-38, 1e-37, 1e-32, 1e-25, 1e18, 1e19, 1e20, 1e30, 1e37, 3e38,
    ];
    for scale in scales {
        for squares in [2, 3] {
            let mesh = Arc::new(scenes::moved(&scenes::cube(squares), |p| p * scale));
            let name = format!("cube of {squares} squares * {scale:e}");
            let cube = Over::new(subject, name.clone(), &mesh);
            let mut some = 0;
            for direction in [
                [0.0, 0.0, 1.0],
                [0.1, 0.2, 1.0],
                [1e-30, -1e-19, 1.0],
                [1e30, 1e29, 1e30],
            ] {
                some += cube.check(&Ray::new(Vec3::new(0.1, 0.2, -0.3) * scale, direction));
            }
            assert!(some > 0, "{name}");
            // From outside, with directions of any length and with short ones; the largest f32 is 3e38.
            let outside = Vec3::new(0.1, 0.2, -3.0) * scale;
            for direction in [Vec3::Z, Vec3::new(0.01, 0.01, 1.0) * scale] {
                let ray = Ray::new(outside, direction);
                let must_hit = (1e-37..1e37).contains(&scale);
                let hits = cube.check(&ray);
                assert!(hits > 0 || !must_hit, "{name}: {}", source(&ray));
            }
            // A ray away from the mesh.
            cube.expect(&Ray::new(outside, -Vec3::Z), 0);
        }
    }
}

/// No ray leaves [`closed_meshes`].
#[track_caller]
pub fn closed_meshes_hold_every_ray(subject: &Subject) {
    for (name, mesh, inside) in closed_meshes() {
        let mesh = Arc::new(mesh);
        let closed = Over::new(subject, name.clone(), &mesh);
        let points = subject.points.min(effort::count(2, usize::MAX));
        let origins = &inside[..points.min(inside.len())];
        check_closed(&name, &mesh, origins, |ray| closed.check(ray));
    }
}
