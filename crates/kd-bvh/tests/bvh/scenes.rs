//! Small meshes: generated scenes, closed surfaces, and what is hard on hierarchies.

use std::collections::HashMap;

use glam::Vec3;
use kd_core::Mesh;
use kd_scene::Spd;

use crate::rng::Rng;

/// A mesh of triangles that share no vertices.
pub(crate) fn soup(triangles: &[[Vec3; 3]]) -> Mesh {
    let positions = triangles.iter().flatten().map(|p| p.to_array()).collect();
    let indices = (0_u32..).step_by(3).take(triangles.len());
    let indices = indices.map(|i| [i, i + 1, i + 2]).collect();
    Mesh::new(positions, indices).expect("finite, in range")
}

/// The mesh with every vertex moved.
pub(crate) fn moved(mesh: &Mesh, to: impl Fn(Vec3) -> Vec3) -> Mesh {
    let positions = mesh.positions().iter();
    let positions = positions.map(|p| to(Vec3::from(*p)).to_array()).collect();
    mesh.with_positions(positions).expect("still finite")
}

/// A closed octahedron whose faces are divided in four, so many times, put on the unit sphere.
pub(crate) fn sphere(levels: usize) -> Mesh {
    let mut points = vec![Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
    let mut faces: Vec<[u32; 3]> = (0..8)
        .map(|octant| [0, 1, 2].map(|axis| axis + 3 * (octant >> axis & 1)))
        .collect();
    for _ in 0..levels {
        let mut middles = HashMap::new();
        let mut middle = |i: u32, j: u32| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                points.push((points[i as usize] + points[j as usize]).normalize());
                u32::try_from(points.len() - 1).expect("small")
            })
        };
        let divided = faces.iter().flat_map(|&[i, j, k]| {
            let [a, b, c] = [middle(i, j), middle(j, k), middle(k, i)];
            [[i, a, c], [a, j, b], [c, b, k], [a, b, c]]
        });
        faces = divided.collect();
    }
    Mesh::new(points.iter().map(|p| p.to_array()).collect(), faces).expect("valid")
}

/// The closed surface of the cube [-1, 1]³, `n` × `n` squares a side: many triangles in each of six planes.
pub(crate) fn cube(n: usize) -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let at = |i: usize| 2.0 * i as f32 / n as f32 - 1.0;
    for (axis, side) in [
        (0, -1.0),
        (0, 1.0),
        (1, -1.0),
        (1, 1.0),
        (2, -1.0),
        (2, 1.0),
    ] {
        for (i, j) in (0..n * n).map(|square| (square / n, square % n)) {
            let first = u32::try_from(positions.len()).expect("small");
            for (di, dj) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                let mut corner = [side; 3];
                corner[(axis + 1) % 3] = at(i + di);
                corner[(axis + 2) % 3] = at(j + dj);
                positions.push(corner);
            }
            triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    Mesh::new(positions, triangles).expect("valid")
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
