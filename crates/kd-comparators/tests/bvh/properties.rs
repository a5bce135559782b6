//! Random meshes, random rays.

use std::sync::Arc;

use kd_core::{CostModel, Ray};
use kd_oracle::effort;
use kd_oracle::strategies::{coordinate, mesh, point};
use proptest::prelude::*;

use crate::check::{self, Pair, check};
use crate::packets::check_packet;
use crate::sweep::check_same_tree;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(60, 300)))]

    #[test]
    fn all_hierarchies_agree_with_brute_force(mesh in mesh(), seed: u64) {
        let mesh = Arc::new(mesh);
        let pairs = Pair::all(&mesh);
        let mut rays = check::rays(&mesh, &pairs, seed);
        let rays: Vec<Ray> = (0..40).map(|_| rays.draw()).collect();
        for ray in &rays {
            check("random", &mesh, &pairs, ray);
        }
        for pair in &pairs {
            check_packet("random", &pair.bvh, &rays);
        }
    }

    #[test]
    fn any_origin_and_direction(
        mesh in mesh(),
        rays in prop::collection::vec((point(), point(), [coordinate(), coordinate()]), 8),
    ) {
        let mesh = Arc::new(mesh);
        let pairs = Pair::all(&mesh);
        for (origin, direction, [start, end]) in rays {
            let ray = Ray::new(origin, direction);
            for ray in [ray, ray.with_range(start, end)] {
                check("random", &mesh, &pairs, &ray);
            }
        }
    }

    #[test]
    fn the_sweep_finds_what_a_search_finds(mesh in mesh(), max_leaf in 1..6_u32) {
        check_same_tree(&Arc::new(mesh), CostModel::CLASSIC, max_leaf);
    }
}
