//! Random meshes, random rays.

use glam::Vec3;
use kd_core::{CostModel, Mesh, Ray};
use proptest::prelude::*;

use crate::check::{Subject, check};
use crate::packets::check_packet;
use crate::rays::Rays;
use crate::scenes::soup;
use crate::sweep::check_same_tree;

/// Coordinates that often coincide, with some far out and some that are close but not equal.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-3_i8..=3).prop_map(f32::from),
        3 => -3.0_f32..3.0,
        1 => (-3_i8..=3).prop_map(|x| f32::from(x).next_down()),
        1 => Just(-0.0),
        1 => -1e5_f32..1e5,
        1 => -1e-5_f32..1e-5,
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
}

/// Triangles, some in a common plane, some twice, some without area.
fn mesh(most: usize) -> impl Strategy<Value = Mesh> {
    let triangle = ([point(), point(), point()], 0..8_u8);
    prop::collection::vec(triangle, 1..most).prop_map(|triangles| {
        let mut all = Vec::new();
        for ([a, b, c], kind) in triangles {
            match kind {
                0 => all.push([a, b, c].map(|p| p.with_z(1.0))),
                1 => all.extend([[a, b, c], [b, a, c]]),
                2 => all.push([a, b, a]),
                3 => all.extend([[a, b, c]; 3]),
                _ => all.push([a, b, c]),
            }
        }
        soup(&all)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn all_hierarchies_agree_with_brute_force(mesh in mesh(40), seed: u64) {
        let subjects = Subject::all(&mesh);
        let mut rays = Rays::new(&mesh, &subjects, seed);
        let rays: Vec<Ray> = (0..40).map(|_| rays.next()).collect();
        for ray in &rays {
            check("random", &mesh, &subjects, ray);
        }
        for subject in &subjects {
            check_packet("random", &mesh, &subject.bvh, &rays);
        }
    }

    #[test]
    fn any_origin_and_direction(
        mesh in mesh(12),
        rays in prop::collection::vec((point(), point(), [coordinate(), coordinate()]), 8),
    ) {
        let subjects = Subject::all(&mesh);
        for (origin, direction, [start, end]) in rays {
            let ray = Ray::new(origin, direction);
            for ray in [ray, ray.with_range(start, end)] {
                check("random", &mesh, &subjects, &ray);
            }
        }
    }

    #[test]
    fn the_sweep_finds_what_a_search_finds(mesh in mesh(40), max_leaf in 1..6_u32) {
        check_same_tree(&mesh, CostModel::CLASSIC, max_leaf);
    }
}
