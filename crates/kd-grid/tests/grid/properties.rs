//! Random meshes, random grids, random rays.

use std::sync::Arc;

use kd_core::Ray;
use kd_grid::{GridOptions, Overlap};
use kd_oracle::check;
use kd_oracle::effort;
use kd_oracle::rays::Rays;
use kd_oracle::strategies::{coordinate, mesh, point};
use proptest::prelude::*;

use crate::grids::{borders, grid};

fn options() -> impl Strategy<Value = GridOptions> {
    let overlap = prop_oneof![Just(Overlap::Box), Just(Overlap::Exact)];
    (-4.0_f32..8.0, overlap).prop_map(|(log, overlap)| {
        GridOptions::new()
            .with_density(log.exp2())
            .with_overlap(overlap)
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(100, 500)))]

    #[test]
    fn any_grid_agrees_with_brute_force(mesh in mesh(), options in options(), seed: u64) {
        let mesh = Arc::new(mesh);
        let grid = grid(&mesh, &options);
        let mut rays = Rays::new(&mesh, borders(&grid), seed);
        for _ in 0..60 {
            check("random", &mesh, &[&grid], &rays.draw());
        }
    }

    #[test]
    fn any_origin_and_direction(
        mesh in mesh(),
        options in options(),
        origin in point(),
        direction in point(),
        range in [coordinate(), coordinate()],
    ) {
        let mesh = Arc::new(mesh);
        let grid = grid(&mesh, &options);
        let ray = Ray::new(origin, direction);
        for ray in [ray, ray.with_range(range[0], range[1])] {
            check("random", &mesh, &[&grid], &ray);
        }
    }
}
