//! Rivals find the distances of brute force, within the rounding of f32.
#![allow(clippy::print_stderr, reason = "a skipped test reports it")]

use kd_oracle::rng::Rng;
use kd_oracle::scenes;
use kd_points::brute_force;
use kd_rivals::{PointRival, RivalError};

#[test]
fn distances_are_close() {
    for rival in [PointRival::Embree, PointRival::Parry3d] {
        for mesh in [scenes::sphere(2), scenes::room(), scenes::soup()] {
            let structure = match rival.build(&mesh, 1) {
                Ok(structure) => structure,
                Err(RivalError::NotCompiled(_)) => break,
                Err(RivalError::NotInstalled(why)) => {
                    eprintln!("skipped: {rival:?}: {why}");
                    break;
                }
                Err(error) => panic!("{rival:?}: {error}"),
            };
            let mut rng = Rng(1);
            let bounds = mesh.bounds();
            let point = |_| (bounds.center() + 1.5 * bounds.extent() * rng.vec3()).to_array();
            let points: Vec<[f32; 3]> = (0..200).map(point).collect();
            let mut found = vec![0.0; points.len()];
            structure.distances(&points, &mut found);
            for (point, found) in points.iter().zip(found) {
                let nearest = brute_force::closest_point(&mesh, *point, f32::INFINITY);
                let expected = nearest.expect("triangles").distance;
                let error = (found - expected).abs() / (expected + bounds.diagonal());
                assert!(error < 1e-5, "{rival:?}, {point:?}: {found}, {expected}");
            }
        }
    }
}
