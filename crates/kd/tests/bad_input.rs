//! Invalid and extreme input: typed errors, no panics.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use kd::{BuildError, BuildOptions, CostModel, KdTree, Mesh, Method, Ray};
use kd_scene::Spd;

#[test]
fn an_empty_mesh_is_a_tree_that_nothing_hits() {
    for method in [Method::Median, Method::Naive, Method::Resort, Method::Exact] {
        let mesh = Mesh::new(vec![[1.0, 2.0, 3.0]], vec![]).expect("valid");
        let tree = KdTree::build(mesh, &BuildOptions::best().with_method(method)).expect("a tree");
        let ray = Ray::new([0.0; 3], [1.0, 2.0, 3.0]);
        let mut hits = vec![];
        tree.hits(&ray, 8, &mut hits);
        assert!(
            tree.intersect(&ray).is_none() && !tree.occluded(&ray) && hits.is_empty(),
            "{method:?}"
        );
        assert_eq!(tree.stats().leaves, 1, "{method:?}: one empty leaf");
    }
}

#[test]
fn zero_area_triangles_are_reported_and_harmless() {
    let positions = vec![
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [2.0, 0.0, 0.0],
    ];
    let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 1, 3], [2, 2, 2]]).expect("valid");
    let tree = KdTree::build(mesh, &BuildOptions::best()).expect("a tree");
    assert_eq!(tree.stats().zero_area, Some(2), "{}", tree.stats());
    let ray = Ray::new([0.25, 0.25, 1.0], [0.0, 0.0, -1.0]);
    assert_eq!(
        tree.intersect(&ray).map(|hit| hit.triangle),
        Some(0),
        "the real one"
    );
    let along = Ray::new([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]).with_range(2.5, 9.0);
    assert_eq!(tree.intersect(&along), None, "a line has nothing to hit");
}

#[test]
fn wrong_options_are_errors() {
    let mesh = Mesh::new(vec![], vec![]).expect("valid");
    let options = BuildOptions::best().with_cost(CostModel {
        traverse: -1.0,
        ..CostModel::CLASSIC
    });
    let error = KdTree::build(mesh, &options).expect_err("a negative cost");
    assert_eq!(
        error,
        BuildError::InvalidOption {
            name: "cost.traverse",
            rule: "positive and finite"
        },
        "by name"
    );
}

/// Coordinates from the least to the greatest that f32 holds: a tree, no panic, no NaN in the statistics.
#[test]
fn extreme_coordinates_build_and_trace() {
    for scale in [1e-44_f32, 1e-30, 1e-10, 1.0, 1e10, 1e30, 3e38] {
        let at = |x: f32, y: f32, z: f32| [x * scale, y * scale, z * scale];
        let positions = vec![
            at(-1.0, -1.0, 0.5),
            at(1.0, -1.0, 0.5),
            at(0.0, 1.0, 0.5),
            at(0.0, 0.0, -1.0),
        ];
        let mesh = Mesh::new(positions, vec![[0, 1, 2], [0, 1, 3], [1, 2, 3]]).expect("finite");
        let tree = KdTree::build(mesh, &BuildOptions::best()).expect("a tree");
        let text = tree.stats().to_string();
        assert!(
            !text.contains("NaN") && !text.contains("inf"),
            "{scale}: {text}"
        );
        let ray = Ray::new(at(0.0, 0.0, 1.0), [0.0, 0.0, -1.0]);
        let expected = kd_trace::brute_force::intersect(tree.mesh(), &ray);
        assert_eq!(tree.intersect(&ray), expected, "{scale}");
        if (1e-30..=1e30).contains(&scale) {
            assert_eq!(
                expected.map(|hit| hit.triangle),
                Some(0),
                "{scale}: the facing triangle"
            );
        }
    }
}

/// Progress belongs to the build of the same tree.
#[test]
fn a_build_reports_progress_and_can_be_cancelled() {
    let mesh = Arc::new(Spd::Gears.generate(1).expect("a small size").mesh);
    for threads in [1, 2] {
        let options = BuildOptions::balanced().with_threads(threads);
        let calls = AtomicUsize::new(0);
        let tree = KdTree::build_with_progress(Arc::clone(&mesh), &options, &|done| {
            calls.fetch_add(1, Ordering::Relaxed);
            assert!((0.0..=1.0).contains(&done), "{threads} threads: {done}");
            ControlFlow::Continue(())
        })
        .expect("not cancelled");
        let expected = KdTree::build(Arc::clone(&mesh), &options).expect("a tree");
        assert_eq!(tree.nodes(), expected.nodes(), "{threads} threads");
        assert_eq!(tree.stats(), expected.stats(), "{threads} threads");
        let calls = calls.into_inner();
        assert!(calls > 1, "{threads} threads: {calls} calls");
        let cancelled =
            KdTree::build_with_progress(Arc::clone(&mesh), &options, &|_| ControlFlow::Break(()));
        assert_eq!(
            cancelled.err(),
            Some(BuildError::Cancelled),
            "{threads} threads"
        );
    }
}
