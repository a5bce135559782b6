//! Random meshes, random trees, random rays.

use kd_core::Ray;
use kd_oracle::effort;
use kd_oracle::strategies::{coordinate, mesh, point};
use kd_sah::{BuildOptions, build};
use proptest::prelude::*;

use crate::check::{self, Subject, check};
use crate::random_tree::random_tree;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(100, 600)))]

    #[test]
    fn all_trees_agree_with_brute_force(mesh in mesh(), seed: u64) {
        let trees = [
            build(&mesh, &BuildOptions::best()).expect("valid"),
            random_tree(&mesh, seed),
            random_tree(&mesh, seed ^ 1),
        ]
        .map(|tree| Subject::new(&mesh, tree));
        let mut rays = check::rays(&mesh, &trees, seed);
        for _ in 0..60 {
            check("random", &mesh, &trees, &rays.draw());
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
