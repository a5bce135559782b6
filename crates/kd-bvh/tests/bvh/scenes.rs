//! Small meshes: generated scenes, closed surfaces, and what is hard on hierarchies.

use glam::Vec3;
use kd_core::Mesh;
pub(crate) use kd_oracle::scenes::{cube, moved, sphere};
use kd_scene::Spd;

use crate::rng::Rng;

/// A mesh of triangles that share no vertices.
pub(crate) fn soup(triangles: &[[Vec3; 3]]) -> Mesh {
    let positions = triangles.iter().flatten().map(|p| p.to_array()).collect();
    let indices = (0_u32..).step_by(3).take(triangles.len());
    let indices = indices.map(|i| [i, i + 1, i + 2]).collect();
    Mesh::new(positions, indices).expect("finite, in range")
}

/// Triangles of all sizes, anywhere.
pub(crate) fn confetti(count: usize, seed: u64) -> Mesh {
    let mut rng = Rng(seed);
    let triangles: Vec<[Vec3; 3]> = (0..count)
        .map(|_| {
            let (center, size) = (2.0 * rng.vec3(), 0.05 + 0.5 * rng.unit());
            [(); 3].map(|()| center + size * rng.vec3())
        })
        .collect();
    soup(&triangles)
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

/// All in the plane y = 1: boxes have no height.
fn flat() -> Mesh {
    moved(&confetti(150, 7), |p| Vec3::new(p.x, 1.0, p.z))
}

/// Points, lines, and a few triangles that have an area.
fn zero_area() -> Mesh {
    let mut rng = Rng(9);
    let triangles: Vec<[Vec3; 3]> = (0..300)
        .map(|i| {
            let [a, b, c] = [rng.vec3(), rng.vec3(), rng.vec3()];
            [[a, a, a], [a, b, a], [a, b, a.midpoint(b)], [a, b, c]][(i % 16).min(3)]
        })
        .collect();
    soup(&triangles)
}

/// So many times the same triangle, and one beside it.
pub(crate) fn coincident(count: usize) -> Mesh {
    let positions = [
        [0.0, 0.0, 2.0],
        [1.0, 0.0, 2.0],
        [0.0, 1.0, 2.5],
        [2.0, 2.0, 2.0],
    ];
    let mut triangles = vec![[0, 1, 2]; count];
    triangles.push([1, 2, 3]);
    Mesh::new(positions.to_vec(), triangles).expect("valid")
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

/// Triangles each twice as far as the last and twice as large, over all of f32: dividing in the middle parts one at a time.
pub(crate) fn doubling() -> Mesh {
    let triangles: Vec<[Vec3; 3]> = (-70..70)
        .map(|power| {
            let far = 2.0_f32.powi(power);
            let at = |y: f32, z: f32| far * Vec3::new(1.0, y, z);
            [at(-0.1, -0.1), at(0.1, -0.1), at(0.0, 0.2)]
        })
        .collect();
    soup(&triangles)
}

/// Scenes of the SPD, by name.
pub(crate) fn generated() -> Vec<(&'static str, Mesh)> {
    [
        (Spd::Balls, 1),
        (Spd::Gears, 1),
        (Spd::Mount, 4),
        (Spd::Teapot, 4),
        (Spd::Tetra, 5),
        (Spd::Tree, 1),
    ]
    .map(|(scene, size)| (scene.name(), scene.generate(size).expect("small").mesh))
    .into()
}

/// Each hard in its own way, by name. There is at least one triangle.
pub(crate) fn nasty() -> Vec<(&'static str, Mesh)> {
    let one = [
        Vec3::ZERO,
        Vec3::new(1.0, 0.5, 0.0),
        Vec3::new(0.0, 1.0, 1.0),
    ];
    let confetti = confetti(250, 4);
    vec![
        ("one", soup(&[one])),
        ("confetti", confetti.clone()),
        ("slivers", slivers()),
        ("flat", flat()),
        ("zero area", zero_area()),
        ("coincident", coincident(100)),
        ("stadium", stadium()),
        ("doubling", doubling()),
        ("huge", moved(&confetti, |p| 1e30 * p)),
        ("largest", moved(&confetti, |p| 1.3e38 * p)),
        ("tiny", moved(&confetti, |p| 1e-30 * p)),
        (
            "far off",
            moved(&confetti, |p| p + Vec3::new(1e5, -3e4, 7e6)),
        ),
        ("cube", cube(4)),
    ]
}
