//! Small meshes that are hard in different ways.

use std::collections::HashMap;

use glam::Vec3;
use kd_core::Mesh;

use crate::rng::Rng;

/// A list of triangles under construction.
#[derive(Clone, Debug, Default)]
pub struct Soup {
    /// Vertices.
    pub positions: Vec<[f32; 3]>,
    /// Three indices of vertices per triangle.
    pub triangles: Vec<[u32; 3]>,
}

impl Soup {
    /// Adds a triangle with vertices of its own.
    pub fn triangle(&mut self, corners: [Vec3; 3]) {
        let first = u32::try_from(self.positions.len()).expect("small");
        self.positions.extend(corners.map(|p| p.to_array()));
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// Adds a quadrilateral as two triangles.
    pub fn quad(&mut self, [a, b, c, d]: [Vec3; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// Adds the six walls of a box.
    pub fn cuboid(&mut self, min: Vec3, max: Vec3) {
        let corner = |i: usize| {
            Vec3::new(
                if i & 1 == 0 { min.x } else { max.x },
                if i & 2 == 0 { min.y } else { max.y },
                if i & 4 == 0 { min.z } else { max.z },
            )
        };
        for wall in [
            [0, 1, 3, 2],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 3, 7, 6],
            [0, 2, 6, 4],
            [1, 3, 7, 5],
        ] {
            self.quad(wall.map(corner));
        }
    }

    /// The mesh of all triangles.
    pub fn mesh(self) -> Mesh {
        Mesh::new(self.positions, self.triangles).expect("valid")
    }
}

/// The mesh with every vertex moved.
pub fn moved(mesh: &Mesh, to: impl Fn(Vec3) -> Vec3) -> Mesh {
    let positions = mesh
        .positions()
        .iter()
        .map(|&p| to(Vec3::from(p)).to_array())
        .collect();
    Mesh::new(positions, mesh.triangles().to_vec()).expect("still finite")
}

/// A closed icosahedron whose faces are divided in four `levels` times, projected to the unit sphere.
pub fn sphere(levels: usize) -> Mesh {
    let g = f32::midpoint(1.0, 5.0_f32.sqrt());
    let mut points: Vec<Vec3> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        points.extend([
            Vec3::new(0.0, a, b),
            Vec3::new(a, b, 0.0),
            Vec3::new(b, 0.0, a),
        ]);
    }
    // The faces are the triples of points at mutual distance 2.
    let mut faces = Vec::new();
    let near = |i: usize, j: usize| (points[i].distance(points[j]) - 2.0).abs() < 0.1;
    for i in 0..12 {
        for j in 0..i {
            for k in 0..j {
                if near(i, j) && near(j, k) && near(i, k) {
                    faces.push([i, j, k]);
                }
            }
        }
    }
    for point in &mut points {
        *point = point.normalize();
    }
    for _ in 0..levels {
        let mut middles: HashMap<(usize, usize), usize> = HashMap::new();
        let mut middle = |i: usize, j: usize| {
            *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
                points.push((points[i] + points[j]).normalize());
                points.len() - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[i, j, k]| {
                let (a, b, c) = (middle(i, j), middle(j, k), middle(k, i));
                [[i, a, c], [a, j, b], [c, b, k], [a, b, c]]
            })
            .collect();
    }
    let index = |i: usize| u32::try_from(i).expect("small");
    Mesh::new(
        points.iter().map(|p| p.to_array()).collect(),
        faces.iter().map(|face| face.map(index)).collect(),
    )
    .expect("valid")
}

/// A closed cube [-1, 1]³ whose faces are grids of `n` × `n` squares: many triangles in each of six planes.
pub fn cube(n: usize) -> Mesh {
    let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let at = |i: usize| 2.0 * i as f32 / n as f32 - 1.0;
    let mut vertex = |p: [f32; 3]| {
        let next = u32::try_from(numbers.len()).expect("small");
        *numbers
            .entry(p.map(|x| (x + 0.0).to_bits()))
            .or_insert_with(|| {
                positions.push(p);
                next
            })
    };
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            for i in 0..n {
                for j in 0..n {
                    let mut corner = |di: usize, dj: usize| {
                        let mut p = [side; 3];
                        p[(axis + 1) % 3] = at(i + di);
                        p[(axis + 2) % 3] = at(j + dj);
                        vertex(p)
                    };
                    let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
    }
    Mesh::new(positions, triangles).expect("valid")
}

/// A closed surface around the origin with hills and valleys, at distances of 0.55 to 1.
pub fn bumpy() -> Mesh {
    moved(&sphere(2), |p| {
        p * (0.55 + 0.45 * ((7.0 * p.x).sin() * (9.0 * p.y).cos() * (5.0 * p.z).sin()).abs())
    })
}

/// Boxes on a lattice in a box: walls that touch, walls that coincide, walls in the same plane.
pub fn room() -> Mesh {
    let mut rng = Rng(3);
    let mut soup = Soup::default();
    soup.cuboid(Vec3::ZERO, Vec3::splat(8.0));
    for _ in 0..20 {
        let mut side = || {
            let low = rng.below(7);
            (low as f32, (low + 1 + rng.below(2)).min(8) as f32)
        };
        let (x, y, z) = (side(), side(), side());
        soup.cuboid(Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1));
    }
    soup.mesh()
}

/// A point by its coordinates along an axis and along the two that follow it.
pub fn turned(axis: usize, [along, next, last]: [f32; 3]) -> Vec3 {
    let mut point = Vec3::ZERO;
    point[axis] = along;
    point[(axis + 1) % 3] = next;
    point[(axis + 2) % 3] = last;
    point
}

/// Triangles of any shape and position.
pub fn soup() -> Mesh {
    let mut rng = Rng(4);
    let mut soup = Soup::default();
    for _ in 0..250 {
        let center = rng.vec3() * 2.0;
        let size = rng.between(0.05, 0.7);
        soup.triangle([(); 3].map(|()| center + size * rng.vec3()));
    }
    soup.mesh()
}

/// Long thin triangles, some so thin that rounding their corners reverses them.
pub fn slivers() -> Mesh {
    let mut rng = Rng(5);
    let mut soup = Soup::default();
    for i in 0..250 {
        let (start, along) = (rng.vec3(), rng.direction() * 2.0);
        let width = [0.1, 1e-2, 1e-4, 1e-7][i % 4];
        let tip = start + along * rng.unit() + rng.direction() * width;
        soup.triangle([start, start + along, tip]);
    }
    soup.mesh()
}

/// Every triangle several times, in both windings, with triangles of zero area between.
pub fn duplicates() -> Mesh {
    let mut rng = Rng(6);
    let mut soup = Soup::default();
    for _ in 0..40 {
        let center = rng.vec3();
        let [a, b, c] = [(); 3].map(|()| center + 0.6 * rng.vec3());
        for corners in [
            [a, b, c],
            [a, c, b],
            [b, c, a],
            [a, b, b],
            [a, b, a.lerp(b, 0.5)],
        ] {
            soup.triangle(corners);
        }
    }
    soup.mesh()
}

/// Triangles in the plane y = 1: the box has no height.
pub fn flat() -> Mesh {
    let mut rng = Rng(7);
    let mut soup = Soup::default();
    let on_plane = |p: Vec3| Vec3::new(p.x, 1.0, p.z);
    for _ in 0..100 {
        let center = rng.vec3();
        soup.triangle([(); 3].map(|()| on_plane(center + 0.4 * rng.vec3())));
    }
    soup.mesh()
}

/// A tiny sphere on a floor of two huge triangles: the teapot in the stadium.
pub fn stadium() -> Mesh {
    let ball = sphere(2);
    let mut soup = Soup {
        positions: moved(&ball, |p| p * 1e-3 + Vec3::new(1.7, 1e-3, -2.3))
            .positions()
            .to_vec(),
        triangles: ball.triangles().to_vec(),
    };
    let corner = |x: f32, z: f32| Vec3::new(1000.0 * x, 0.0, 1000.0 * z);
    soup.quad([
        corner(-1.0, -1.0),
        corner(1.0, -1.0),
        corner(1.0, 1.0),
        corner(-1.0, 1.0),
    ]);
    soup.triangle([
        Vec3::new(-900.0, 0.0, 3.0),
        Vec3::new(1100.0, 0.0, 7.0),
        Vec3::new(2.0, 900.0, 5.0),
    ]);
    soup.mesh()
}

/// `count` triangles of all sizes and positions, different for each seed.
pub fn confetti(count: usize, seed: u64) -> Mesh {
    let mut rng = Rng(seed);
    let mut soup = Soup::default();
    for _ in 0..count {
        let (center, size) = (2.0 * rng.vec3(), 0.05 + 0.5 * rng.unit());
        soup.triangle([(); 3].map(|()| center + size * rng.vec3()));
    }
    soup.mesh()
}

/// Points, lines, and a few triangles with an area.
pub fn zero_area() -> Mesh {
    let mut rng = Rng(9);
    let mut soup = Soup::default();
    for i in 0..300 {
        let [a, b, c] = [rng.vec3(), rng.vec3(), rng.vec3()];
        let corners = [[a, a, a], [a, b, a], [a, b, a.midpoint(b)], [a, b, c]];
        soup.triangle(corners[(i % 16).min(3)]);
    }
    soup.mesh()
}

/// `count` copies of a triangle, and one triangle beside it.
pub fn coincident(count: usize) -> Mesh {
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

/// Triangles each twice as far and twice as large as the last, over the range of f32: a division in the middle separates one at a
/// time.
pub fn doubling() -> Mesh {
    let mut soup = Soup::default();
    for power in -70..70 {
        let far = 2.0_f32.powi(power);
        let at = |y: f32, z: f32| far * Vec3::new(1.0, y, z);
        soup.triangle([at(-0.1, -0.1), at(0.1, -0.1), at(0.0, 0.2)]);
    }
    soup.mesh()
}

/// Extreme meshes with their names: few triangles with an area, many in one place, all sizes, and the limits of size and offset.
pub fn extreme() -> Vec<(&'static str, Mesh)> {
    let confetti = confetti(250, 4);
    vec![
        ("zero area", zero_area()),
        ("coincident", coincident(100)),
        ("doubling", doubling()),
        ("huge", moved(&confetti, |p| 1e30 * p)),
        ("largest", moved(&confetti, |p| 1.3e38 * p)),
        ("tiny", moved(&confetti, |p| 1e-30 * p)),
        (
            "far off",
            moved(&confetti, |p| p + Vec3::new(1e5, -3e4, 7e6)),
        ),
    ]
}

/// Every scene with its name.
pub fn all() -> Vec<(&'static str, Mesh)> {
    vec![
        ("sphere", sphere(2)),
        ("cube", cube(4)),
        ("room", room()),
        ("soup", soup()),
        ("slivers", slivers()),
        ("duplicates", duplicates()),
        ("flat", flat()),
        ("stadium", stadium()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_meshes_are_closed() {
        for mesh in [sphere(0), sphere(2), cube(1), cube(4), bumpy()] {
            let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
            for &[i, j, k] in mesh.triangles() {
                for (a, b) in [(i, j), (j, k), (k, i)] {
                    *edges.entry((a.min(b), a.max(b))).or_default() += 1;
                }
            }
            assert!(
                edges.values().all(|&n| n == 2),
                "two triangles at every edge"
            );
            let euler = mesh.positions().len() + mesh.len() - edges.len();
            assert_eq!(euler, 2, "like a sphere");
            assert_eq!(mesh.zero_area_count(), 0, "no zero area");
        }
    }

    #[test]
    fn scenes_are_what_they_say() {
        assert_eq!(sphere(2).len(), 320, "20 * 4 * 4");
        assert_eq!(flat().bounds().extent().y, 0.0, "no height");
        assert!(duplicates().zero_area_count() >= 40, "some have no area");
        let with_area = 300 - zero_area().zero_area_count();
        assert!((50..300).contains(&with_area), "{with_area} have an area");
        let extent = doubling().bounds().extent().max_element();
        assert!(extent > 1e20, "from 2⁻⁷⁰ to 2⁷⁰: {extent:e}");
        for (name, mesh) in all().into_iter().chain(extreme()) {
            assert!((100..400).contains(&mesh.len()), "{name}: {}", mesh.len());
        }
    }
}
