//! Input that makes builders deep, slow or wrong.

use std::sync::Arc;

use kd_comparators::{Bvh, BvhMethod, BvhOptions, ComparatorError};
use kd_core::{MAX_DEPTH, Mesh, Ray};
use kd_oracle::effort;
use kd_trace::{RayQuery as _, brute_force};

use crate::check::{METHODS, Pair, check_sound};
use crate::scenes;

fn build(mesh: &Arc<Mesh>, method: BvhMethod) -> Bvh {
    let options = BvhOptions::new().with_method(method);
    let bvh = Bvh::build(Arc::clone(mesh), &options).expect("valid options");
    check_sound(&bvh, &options);
    bvh
}

#[test]
fn the_depth_is_limited() {
    let mesh = Arc::new(scenes::doubling());
    let mut deepest = 0;
    for method in METHODS {
        let options = BvhOptions::new().with_method(method).with_max_leaf(1);
        let pair = Pair::new(&mesh, &options);
        deepest = deepest.max(pair.bvh.stats().depth);
    }
    assert_eq!(deepest, MAX_DEPTH, "the middle splits off one at a time");
}

#[test]
fn many_triangles_in_one_place() {
    for method in METHODS {
        // Sorting in each node is slow.
        let count = if method == BvhMethod::Sweep {
            20_000
        } else {
            effort::count(200_000, 1_000_000)
        };
        let mesh = Arc::new(scenes::coincident(count));
        let bvh = build(&mesh, method);
        // All divisions cost the same, and the sweep takes the first.
        let depth = bvh.stats().depth;
        let is_halved = depth < 40 || method == BvhMethod::Sweep;
        assert!(is_halved, "{method:?}: {depth}");
        for x in [0.25, 0.5, 0.75, 1.25] {
            let ray = Ray::new([x, 0.25, -1.0], [0.0, 0.0, 1.0]);
            let hit = brute_force::intersect(&mesh, &ray);
            assert_eq!(bvh.intersect(&ray), hit, "{method:?}, {x}");
        }
    }
}

#[test]
fn one_triangle_is_one_leaf() {
    let points = [[1.0_f32, 2.0, 3.0]; 3];
    let line = [[0.0; 3], [1.0; 3], [2.0; 3]];
    let huge = [[-3e38, -3e38, 0.0], [3e38, -3e38, 1.0], [0.0, 3e38, -1.0]];
    let tiny = [[0.0; 3], [1e-45, 0.0, 0.0], [0.0, 1e-45, 1e-45]];
    for corners in [points, line, huge, tiny] {
        let mesh = Arc::new(scenes::soup(&[corners.map(Into::into)]));
        for method in METHODS {
            let stats = build(&mesh, method).stats();
            assert_eq!(
                (stats.nodes, stats.leaves, stats.depth),
                (1, 1, 0),
                "{stats}"
            );
            assert!(stats.sah_cost_own > 0.0, "{stats}");
        }
    }
}

#[test]
fn options_out_of_range_are_refused() {
    let mesh = Arc::new(scenes::confetti(3, 1));
    let options = BvhOptions::new().with_max_leaf(0);
    let error = Bvh::build(mesh, &options).expect_err("no leaves");
    let expected = ComparatorError::InvalidOption {
        name: "max_leaf",
        rule: "at least 1",
    };
    assert_eq!(error, expected);
}

#[cfg(feature = "parallel")]
#[test]
fn too_many_threads_are_refused() {
    let mesh = Arc::new(scenes::confetti(3, 1));
    let options = BvhOptions::new().with_threads(usize::MAX);
    let error = Bvh::build(mesh, &options).expect_err("far too many");
    assert!(
        matches!(&error, ComparatorError::Threads(why) if why.threads == usize::MAX),
        "{error:?}"
    );
}
