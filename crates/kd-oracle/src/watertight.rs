//! No ray leaves a closed mesh.

use glam::Vec3;
use kd_core::{Mesh, Ray};

use crate::check::source;
use crate::rng::Rng;
use crate::scenes;

/// Aims rays from each origin inside a closed mesh at every corner, every edge's midpoint and other points of edges, and expects a
/// hit in both directions. `hits` returns the number of hits of a ray, and may check more.
///
/// # Panics
///
/// If a ray has no hit.
#[track_caller]
pub fn check_closed(name: &str, mesh: &Mesh, origins: &[Vec3], hits: impl Fn(&Ray) -> usize) {
    let mut rng = Rng(10);
    let mut rays = 0;
    for &origin in origins {
        for triangle in 0..u32::try_from(mesh.len()).expect("small") {
            let [a, b, c] = mesh.corners(triangle);
            let middles = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
            let edges = [(a, b), (b, c), (c, a)].map(|(p, q)| p.lerp(q, rng.unit()));
            for target in [[a, b, c], middles, edges].concat() {
                let ray = Ray::new(origin, target - origin);
                let back = ray.with_range(f32::NEG_INFINITY, 0.0);
                for ray in [ray, back] {
                    assert!(hits(&ray) > 0, "{name} leaks: {}", source(&ray));
                }
                rays += 1;
            }
        }
    }
    assert!(rays >= 9 * 20, "{name}: only {rays} rays");
}

/// Points within `radius` of the origin, among them some that give exact directions.
pub fn points(radius: f32) -> Vec<Vec3> {
    let mut rng = Rng(11);
    let mut points = vec![
        Vec3::ZERO,
        Vec3::new(0.0, 0.25, 0.0),
        Vec3::new(0.25, 0.25, -0.25),
        Vec3::new(-0.125, 0.0, 0.0625),
        Vec3::splat(0.125),
    ];
    points.extend((0..12).map(|_| radius * rng.unit() * rng.direction()));
    points
}

/// Closed meshes with points inside: a sphere, cubes of many triangles in each plane, a bumpy surface, and spheres of several sizes
/// and offsets, up to 10⁷.
pub fn closed_meshes() -> Vec<(String, Mesh, Vec<Vec3>)> {
    let mut in_cube = points(0.99);
    // On lattice lines, so that rays pass exactly through corners and along planes of edges.
    in_cube.extend([
        Vec3::splat(0.5),
        Vec3::new(0.5, -0.5, 0.0),
        Vec3::new(0.0, 0.0, 0.5),
    ]);
    let mut meshes = vec![
        ("sphere".to_owned(), scenes::sphere(2), points(0.95)),
        ("cube".to_owned(), scenes::cube(4), in_cube),
        ("bumpy".to_owned(), scenes::bumpy(), points(0.45)),
        ("odd cube".to_owned(), scenes::cube(3), points(0.99)),
    ];
    let far_off = |p: Vec3| 1e3 * p + Vec3::new(3e4, -7e5, 11.0);
    meshes.push((
        "far off".to_owned(),
        scenes::moved(&scenes::sphere(1), far_off),
        points(0.7).into_iter().map(far_off).collect(),
    ));
    // Vertices are whole numbers there.
    let farther_off = |p: Vec3| 200.0 * p + Vec3::new(1e7, -1e7, 1e7);
    meshes.push((
        "farther off".to_owned(),
        scenes::moved(&scenes::sphere(2), farther_off),
        points(0.9).into_iter().map(farther_off).collect(),
    ));
    for scale in [1e-3, 1.0, 1e4] {
        for offset in [0.0, 30.0, -1000.0] {
            for levels in [0, 1] {
                let place = |p: Vec3| (p + offset) * scale;
                meshes.push((
                    format!("sphere of {levels} levels * {scale} + {offset}"),
                    scenes::moved(&scenes::sphere(levels), place),
                    points(0.7).into_iter().map(place).collect(),
                ));
            }
        }
    }
    meshes
}
