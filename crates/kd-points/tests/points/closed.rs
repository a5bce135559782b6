//! Inside and outside of closed surfaces with known answers.

use std::f32::consts::TAU;

use glam::Vec3;
use kd_core::Mesh;
use kd_oracle::rng::Rng;
use kd_oracle::{effort, scenes};
use kd_points::{PointTree, brute_force, closest_point, contains, signed_distance};
use kd_wide::WideTree;

use crate::hard::Trees;

/// A closed torus around the z axis.
fn torus(around: usize, across: usize) -> Mesh {
    let angle = |i: usize, of: usize| TAU * (i % of) as f32 / of as f32;
    let mut positions = Vec::new();
    let mut triangles = Vec::new();
    let index =
        |i: usize, j: usize| u32::try_from((i % around) * across + j % across).expect("small");
    for i in 0..around {
        for j in 0..across {
            let (far, turn) = (angle(j, across), angle(i, around));
            let radius = 2.0 + 0.5 * far.cos();
            positions.push([radius * turn.cos(), radius * turn.sin(), 0.5 * far.sin()]);
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(x, y)| index(i + x, j + y));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    Mesh::new(positions, triangles).expect("valid")
}

/// A mesh around the origin that is seen whole from there, with all triangles counter-clockwise from outside.
fn outward(mesh: &Mesh) -> Mesh {
    let turned = (0..).zip(mesh.triangles()).map(|(triangle, &[a, b, c])| {
        let is_outward = mesh.normal(triangle).dot(mesh.corners(triangle)[0]) > 0.0;
        if is_outward { [a, b, c] } else { [a, c, b] }
    });
    Mesh::new(mesh.positions().to_vec(), turned.collect()).expect("valid")
}

/// Checks that a point is inside or not, in every layout.
fn check(trees: &Trees, point: Vec3, is_inside: bool) {
    for (tree, trees) in trees.all() {
        assert_eq!(contains(&trees, point), is_inside, "{tree}, {point}");
        let distance = signed_distance(&trees, point).expect("triangles");
        let nearest = closest_point(&trees, point, f32::INFINITY).expect("triangles");
        assert_eq!(distance.abs(), nearest.distance, "{tree}, {point}");
        assert_eq!(is_inside, distance <= 0.0, "{tree}, {point}: {distance}");
    }
}

/// Rays from points of a lattice meet corners, edges and diagonals of the walls, and run in walls.
#[test]
fn lattice_points_of_a_cube() {
    for n in [1, 2, 4] {
        let trees = Trees::new(&scenes::cube(n));
        for i in 0..7_u8 {
            for j in 0..7_u8 {
                for k in 0..7_u8 {
                    let point = Vec3::new(f32::from(i), f32::from(j), f32::from(k)) * 0.5 - 1.5;
                    let is_inside = point.abs().max_element() <= 1.0;
                    check(&trees, point, is_inside);
                    if point.abs().max_element() == 1.0 {
                        let (_, trees) = trees.all().next().expect("some");
                        assert_eq!(signed_distance(&trees, point), Some(0.0), "on it: {point}");
                    }
                }
            }
        }
    }
}

/// The middle of a sphere whose ray meets corners, and points far from its surface.
#[test]
fn points_of_a_sphere() {
    let trees = Trees::new(&scenes::sphere(2));
    let mut rng = Rng(5);
    check(&trees, Vec3::ZERO, true);
    for _ in 0..effort::count(300, 3000) {
        check(&trees, rng.direction() * rng.between(0.0, 0.94), true);
        check(&trees, rng.direction() * rng.between(1.01, 3.0), false);
    }
}

#[test]
fn points_of_a_torus() {
    let mesh = torus(48, 24);
    assert!(mesh.is_closed(), "it is closed");
    let trees = Trees::new(&mesh);
    let mut rng = Rng(6);
    check(&trees, Vec3::ZERO, false);
    for _ in 0..effort::count(300, 3000) {
        let point = rng.vec3() * Vec3::new(2.7, 2.7, 0.7);
        let from_ring = (point.truncate().length() - 2.0).hypot(point.z);
        if (from_ring - 0.5).abs() > 0.02 {
            check(&trees, point, from_ring < 0.5);
        }
    }
}

/// A ball in a hollow of a ball: the parity counts.
#[test]
fn nested_spheres() {
    let shells = [1.0, 0.75, 0.5].map(|radius| scenes::moved(&scenes::sphere(2), |p| p * radius));
    let mesh = Mesh::concatenated(&shells).expect("small");
    let trees = Trees::new(&mesh);
    let mut rng = Rng(7);
    for _ in 0..effort::count(200, 2000) {
        let direction = rng.direction();
        for (radius, is_inside) in [(0.4, true), (0.6, false), (0.85, true), (1.1, false)] {
            check(&trees, direction * radius, is_inside);
        }
    }
    // As several trees.
    let trees = shells.map(|shell| WideTree::from_objects(&shell));
    let trees = trees.each_ref().map(PointTree::from);
    assert!(contains(&trees, Vec3::new(0.4, 0.0, 0.0)), "the inner ball");
    assert!(!contains(&trees, Vec3::new(0.6, 0.0, 0.0)), "the hollow");
}

/// Points that are exactly on the surface are inside, at distance 0.
#[test]
fn points_on_the_surface() {
    for mesh in [scenes::sphere(2), scenes::cube(3), scenes::bumpy()] {
        let trees = Trees::new(&mesh);
        for &position in mesh.positions() {
            let corner = Vec3::from(position);
            for (tree, trees) in trees.all() {
                assert!(contains(&trees, corner), "{tree}, {corner}");
                assert_eq!(
                    signed_distance(&trees, corner),
                    Some(0.0),
                    "{tree}, {corner}"
                );
                let found = closest_point(&trees, corner, 0.0).map(|nearest| nearest.point);
                assert_eq!(found, Some(corner), "{tree}, {corner}");
            }
        }
    }
}

/// Against the winding number, an independent sum of solid angles.
#[test]
fn parity_agrees_with_solid_angles() {
    for mesh in [
        outward(&scenes::sphere(1)),
        outward(&scenes::bumpy()),
        torus(20, 10),
    ] {
        assert!(mesh.is_closed(), "closed, with one winding");
        let trees = Trees::new(&mesh);
        let mut rng = Rng(8);
        for _ in 0..effort::count(300, 3000) {
            let point = rng.vec3() * mesh.bounds().max * 1.1;
            let winding = brute_force::winding_number(&mesh, point).abs();
            assert!(
                (winding - winding.round()).abs() < 1e-9,
                "closed: {winding}"
            );
            check(&trees, point, winding > 0.5);
        }
    }
}
