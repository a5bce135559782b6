//! Random meshes, random trees, random rays.

use glam::Vec3;
use kd_core::{Mesh, Ray};
use kd_sah::{BuildOptions, build};
use proptest::prelude::*;

use crate::check::{Subject, check};
use crate::random_tree::random_tree;
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
    prop::collection::vec(triangle, 1..24).prop_map(|triangles| {
        let mut soup = Soup::default();
        for ([a, b, c], kind) in triangles {
            let in_plane = |p: Vec3| Vec3::new(p.x, p.y, 1.0);
            match kind {
                0 => soup.triangle([a, b, c].map(in_plane)),
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
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn all_trees_agree_with_brute_force(mesh in mesh(), seed: u64) {
        let trees = [
            build(&mesh, &BuildOptions::best()).expect("valid"),
            random_tree(&mesh, seed),
            random_tree(&mesh, seed ^ 1),
        ]
        .map(|tree| Subject::new(&mesh, tree));
        let mut rays = Rays::new(&mesh, &trees, seed);
        for _ in 0..60 {
            check("random", &mesh, &trees, &rays.next());
        }
    }

    #[test]
    fn any_origin_and_direction(
        mesh in mesh(),
        origin in point(),
        direction in point(),
        range in [coordinate(), coordinate()],
    ) {
        let trees = [build(&mesh, &BuildOptions::best()).expect("valid"), random_tree(&mesh, 1)]
            .map(|tree| Subject::new(&mesh, tree));
        let ray = Ray::new(origin, direction);
        for ray in [ray, ray.with_range(range[0], range[1])] {
            check("random", &mesh, &trees, &ray);
        }
    }
}
