//! Random meshes, random rays.

use glam::Vec3;
use kd_core::{Mesh, Ray};
use proptest::prelude::*;

use crate::check::{Subject, check};
use crate::rays::Rays;
use crate::scenes::Soup;

/// Coordinates that often coincide, with some far out and some that are close but not equal.
fn coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => (-3_i8..=3).prop_map(f32::from),
        3 => -3.0_f32..3.0,
        1 => (-3_i8..=3).prop_map(|x| f32::from(x).next_up()),
        1 => -1e5_f32..1e5,
        1 => -1e-5_f32..1e-5,
    ]
}

fn point() -> impl Strategy<Value = Vec3> {
    [coordinate(), coordinate(), coordinate()].prop_map(Vec3::from_array)
}

/// Triangles, some in a common plane, some twice, some without area.
fn mesh() -> impl Strategy<Value = Mesh> {
    let triangle = ([point(), point(), point()], 0..8_u8);
    prop::collection::vec(triangle, 1..40).prop_map(|triangles| {
        let mut soup = Soup::default();
        for ([a, b, c], kind) in triangles {
            match kind {
                0 => soup.triangle([a, b, c].map(|p| p.with_z(1.0))),
                1 => {
                    soup.triangle([a, b, c]);
                    soup.triangle([b, a, c]);
                }
                2 => soup.triangle([a, b, a]),
                3 => soup.quad([a, b, c, b.midpoint(c)]),
                _ => soup.triangle([a, b, c]),
            }
        }
        soup.mesh()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(350))]

    #[test]
    fn both_agree_with_brute_force(mesh in mesh(), seed: u64) {
        let subjects = Subject::all(&mesh);
        let mut rays = Rays::new(&mesh, seed);
        for _ in 0..40 {
            check("random", &mesh, &subjects, &rays.next());
        }
    }

    #[test]
    fn any_origin_and_direction(
        mesh in mesh(),
        origin in point(),
        direction in point(),
        range in [coordinate(), coordinate()],
    ) {
        let subjects = Subject::all(&mesh);
        let ray = Ray::new(origin, direction);
        for ray in [ray, ray.with_range(range[0], range[1])] {
            check("random", &mesh, &subjects, &ray);
        }
    }

    #[test]
    fn limits_hold(mesh in mesh(), depth in 0_u32..8, refs in 0_u64..200, small_leaf in 0_u32..5) {
        let options = kd_comparators::Options::default()
            .with_max_depth(depth)
            .with_max_refs(refs)
            .with_small_leaf(small_leaf);
        let subject = Subject::new(&mesh, options);
        for stats in [subject.octree.stats(), subject.bsp.stats()] {
            prop_assert!(stats.depth <= depth as usize, "{:?}", stats);
            let most = (mesh.len() as u64).max(refs);
            prop_assert!(stats.references as u64 <= most, "{:?}", stats);
        }
    }
}
