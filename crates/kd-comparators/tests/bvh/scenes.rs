//! Small meshes: generated scenes, closed surfaces, and meshes that are hard on hierarchies.

use std::sync::Arc;

use glam::Vec3;
use kd_core::Mesh;
use kd_oracle::scenes::extreme;
pub(crate) use kd_oracle::scenes::{coincident, confetti, cube, doubling, moved, sphere};
use kd_scene::Spd;

use crate::rng::Rng;

/// A mesh of triangles that share no vertices.
pub(crate) fn soup(triangles: &[[Vec3; 3]]) -> Mesh {
    let positions = triangles.iter().flatten().map(|p| p.to_array()).collect();
    let indices = (0_u32..).step_by(3).take(triangles.len());
    let indices = indices.map(|i| [i, i + 1, i + 2]).collect();
    Mesh::new(positions, indices).expect("finite, in range")
}

/// Long thin triangles, down to 1e-7 of their length.
fn slivers() -> Mesh {
    let mut rng = Rng(5);
    let triangles: Vec<[Vec3; 3]> = (0..250)
        .map(|i| {
            let [a, b] = [rng.vec3(), rng.vec3()];
            let width = [0.1, 1e-2, 1e-4, 1e-7][i % 4];
            [a, b, a.lerp(b, rng.unit()) + width * rng.vec3()]
        })
        .collect();
    soup(&triangles)
}

/// Triangles in the plane y = 1: boxes without height.
fn flat() -> Mesh {
    moved(&confetti(150, 7), |p| Vec3::new(p.x, 1.0, p.z))
}

/// A tiny sphere on a huge floor, under a huge slope: the teapot in the stadium.
fn stadium() -> Mesh {
    let ball = moved(&sphere(2), |p| 1e-3 * p + Vec3::new(1.7, 1e-3, -2.3));
    let corner = |x: f32, y: f32, z: f32| 1000.0 * Vec3::new(x, y, z);
    let floor = soup(&[
        [
            corner(-1.0, 0.0, -1.0),
            corner(1.0, 0.0, -1.0),
            corner(1.0, 0.0, 1.0),
        ],
        [
            corner(-1.0, 0.0, -1.0),
            corner(1.0, 0.0, 1.0),
            corner(-1.0, 0.0, 1.0),
        ],
        [
            corner(-0.9, 0.0, 0.03),
            corner(1.1, 0.0, 0.07),
            corner(0.02, 0.9, 0.05),
        ],
    ]);
    Mesh::concatenated([&ball, &floor]).expect("few")
}

/// Scenes of the SPD, by name.
pub(crate) fn generated() -> Vec<(&'static str, Arc<Mesh>)> {
    [
        (Spd::Balls, 1),
        (Spd::Gears, 1),
        (Spd::Mount, 4),
        (Spd::Teapot, 4),
        (Spd::Tetra, 5),
        (Spd::Tree, 1),
    ]
    .map(|(scene, size)| {
        let mesh = scene.generate(size).expect("small").mesh;
        (scene.name(), Arc::new(mesh))
    })
    .into()
}

/// Hard meshes of at least one triangle, by name.
pub(crate) fn nasty() -> Vec<(&'static str, Arc<Mesh>)> {
    let one = [
        Vec3::ZERO,
        Vec3::new(1.0, 0.5, 0.0),
        Vec3::new(0.0, 1.0, 1.0),
    ];
    let mut scenes = vec![
        ("one", soup(&[one])),
        ("confetti", confetti(250, 4)),
        ("slivers", slivers()),
        ("flat", flat()),
        ("stadium", stadium()),
        ("cube", cube(4)),
    ];
    scenes.extend(extreme());
    let shared = scenes
        .into_iter()
        .map(|(name, mesh)| (name, Arc::new(mesh)));
    shared.collect()
}
