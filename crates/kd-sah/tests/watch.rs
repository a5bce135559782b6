//! Builds report their progress, and end when the watch cancels them.

use std::ops::ControlFlow;
use std::sync::Mutex;

use kd_core::Mesh;
use kd_sah::{BuildError, BuildOptions, Method, build, build_watched};
use kd_scene::Spd;

/// The documented limit of calls of a watch.
const MAX_CALLS: usize = 256;

fn builders() -> Vec<BuildOptions> {
    let by = |method| BuildOptions::best().with_method(method);
    vec![
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
        by(Method::Median),
        by(Method::Sweep),
        by(Method::Binned { bins: 32 }),
        by(Method::Sampled { all_axes: true }),
        BuildOptions::best().with_max_refs(0),
        BuildOptions::best().with_median_levels(3),
    ]
}

fn scene() -> Mesh {
    let mesh = Spd::Gears.generate(2).expect("a small size").mesh;
    assert!(mesh.len() > 4_000, "{} triangles are too few", mesh.len());
    mesh
}

/// Builds with a watch that cancels at call number `break_at`. Returns the fractions that the watch received, and the error
/// of the build.
#[track_caller]
fn watched(
    mesh: &Mesh,
    options: &BuildOptions,
    break_at: Option<usize>,
) -> (Vec<f32>, Option<BuildError>) {
    let calls = Mutex::new(Vec::new());
    let built = build_watched(mesh, options, &|done| {
        let mut calls = calls.lock().expect("no watch panics");
        calls.push(done);
        if Some(calls.len()) == break_at {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let calls = calls.into_inner().expect("no watch panics");
    assert!(
        calls.len() <= MAX_CALLS,
        "{options:?}: {} calls",
        calls.len()
    );
    assert!(
        calls.iter().all(|done| (0.0..=1.0).contains(done)),
        "{options:?}: {calls:?}"
    );
    if let Ok(tree) = &built {
        let unwatched = build(mesh, options).expect("valid options");
        assert!(
            tree.nodes() == unwatched.nodes() && tree.refs() == unwatched.refs(),
            "{options:?}: the watched build gives another tree"
        );
    }
    (calls, built.err())
}

#[test]
fn on_one_thread_progress_increases_and_ends_at_one() {
    let mesh = scene();
    for options in builders() {
        let (calls, error) = watched(&mesh, &options.clone().with_threads(1), None);
        assert_eq!(error, None, "{options:?}");
        assert!(calls.is_sorted(), "{options:?}: {calls:?}");
        assert_eq!(calls.last(), Some(&1.0), "{options:?}: the last fraction");
    }
}

#[test]
fn on_several_threads_progress_ends_at_one() {
    let mesh = scene();
    let (mut one_thread, _) = watched(&mesh, &BuildOptions::best().with_threads(1), None);
    assert!(
        one_thread.len() > MAX_CALLS / 2,
        "only {} calls",
        one_thread.len()
    );
    for threads in [2, 4] {
        for options in builders() {
            let options = options.with_threads(threads);
            let (mut calls, error) = watched(&mesh, &options, None);
            assert_eq!(error, None, "{options:?}");
            calls.sort_by(f32::total_cmp);
            assert_eq!(calls.last(), Some(&1.0), "{options:?}: the last fraction");
        }
    }
    one_thread.dedup();
    assert!(
        one_thread.len() > MAX_CALLS / 2,
        "fractions are reported several times"
    );
}

#[test]
fn tiny_builds_report_completion() {
    for triangles in [vec![], vec![[0, 1, 2]]] {
        let mesh = Mesh::new(
            vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]],
            triangles.clone(),
        )
        .expect("valid");
        for options in builders() {
            let (calls, error) = watched(&mesh, &options, None);
            assert_eq!(error, None, "{options:?} {triangles:?}");
            assert_eq!(
                calls.last(),
                Some(&1.0),
                "{options:?} {triangles:?}: {calls:?}"
            );
        }
    }
}

#[test]
fn a_watch_that_breaks_cancels_the_build() {
    let mesh = scene();
    for threads in [1, 2] {
        for options in builders() {
            let options = options.with_threads(threads);
            let (all, _) = watched(&mesh, &options, None);
            let mut breaks = vec![1, all.len().div_ceil(2)];
            if threads == 1 {
                // On several threads, shares that finish together are reported in fewer calls.
                breaks.push(all.len());
            }
            for break_at in breaks {
                let (calls, error) = watched(&mesh, &options, Some(break_at));
                assert_eq!(
                    error,
                    Some(BuildError::Cancelled),
                    "{options:?} at {break_at}"
                );
                if threads == 1 {
                    assert_eq!(calls.len(), break_at, "{options:?}: calls after the break");
                }
            }
        }
    }
}
