//! Random meshes, random rays.

use std::sync::Arc;

use kd_comparators::CellOptions;
use kd_core::Ray;
use kd_oracle::effort;
use kd_oracle::strategies::{coordinate, mesh, point};
use proptest::prelude::*;

use crate::check::{Pair, check, rays};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(30, 150)))]

    #[test]
    fn both_agree_with_brute_force(mesh in mesh(), seed: u64) {
        let mesh = Arc::new(mesh);
        let pairs = Pair::all(&mesh);
        let mut rays = rays(&mesh, seed);
        for _ in 0..40 {
            check("random", &mesh, &pairs, &rays.draw());
        }
    }

    #[test]
    fn any_origin_and_direction(
        mesh in mesh(),
        origin in point(),
        direction in point(),
        range in [coordinate(), coordinate()],
    ) {
        let mesh = Arc::new(mesh);
        let pairs = Pair::all(&mesh);
        let ray = Ray::new(origin, direction);
        for ray in [ray, ray.with_range(range[0], range[1])] {
            check("random", &mesh, &pairs, &ray);
        }
    }

    #[test]
    fn limits_hold(mesh in mesh(), depth in 0_u32..8, refs in 0_u64..200, small_leaf in 0_u32..5) {
        let options = CellOptions::default()
            .with_max_depth(depth)
            .with_max_refs(refs)
            .with_small_leaf(small_leaf);
        let mesh = Arc::new(mesh);
        for stats in Pair::new(&mesh, &options).stats() {
            prop_assert!(stats.depth <= depth as usize, "{:?}", stats);
            let most = (mesh.len() as u64).max(refs);
            prop_assert!(stats.references as u64 <= most, "{:?}", stats);
        }
    }
}
