//! Long builds report their progress, and can be cancelled.

use std::ops::ControlFlow;
use std::sync::Mutex;

use kd_core::Mesh;
use kd_sah::{BuildError, BuildOptions, Method, build, build_with_progress};
use kd_scene::Spd;

/// Upper limit on calls, as documented.
const MOST_CALLS: usize = 256;

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
    assert!(mesh.len() > 4_000, "enough work: {}", mesh.len());
    mesh
}

/// The reported fractions, of a callback that breaks at call `break_at`, and the error of the build.
#[track_caller]
fn reported(
    mesh: &Mesh,
    options: &BuildOptions,
    break_at: Option<usize>,
) -> (Vec<f32>, Option<BuildError>) {
    let reported = Mutex::new(Vec::new());
    let built = build_with_progress(mesh, options, &|done| {
        let mut reported = reported.lock().expect("no callback panics");
        reported.push(done);
        if Some(reported.len()) == break_at {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    let reported = reported.into_inner().expect("no callback panics");
    assert!(
        reported.len() <= MOST_CALLS,
        "{options:?}: {} calls",
        reported.len()
    );
    assert!(
        reported.iter().all(|done| (0.0..=1.0).contains(done)),
        "{options:?}: {reported:?}"
    );
    if let Ok(tree) = &built {
        let unwatched = build(mesh, options).expect("valid options");
        assert!(
            tree.nodes() == unwatched.nodes() && tree.refs() == unwatched.refs(),
            "{options:?}: the watched build gives another tree"
        );
    }
    (reported, built.err())
}

#[test]
fn on_one_thread_progress_increases_and_ends_at_one() {
    let mesh = scene();
    for options in builders() {
        let (reported, error) = reported(&mesh, &options.clone().with_threads(1), None);
        assert_eq!(error, None, "{options:?}");
        assert!(reported.is_sorted(), "{options:?}: {reported:?}");
        assert_eq!(reported.last(), Some(&1.0), "{options:?}: done at the end");
    }
}

#[test]
fn on_several_threads_progress_ends_at_one() {
    let mesh = scene();
    let (mut alone, _) = reported(&mesh, &BuildOptions::best().with_threads(1), None);
    assert!(alone.len() > MOST_CALLS / 2, "few jumps: {}", alone.len());
    for threads in [2, 4] {
        for options in builders() {
            let options = options.with_threads(threads);
            let (mut reported, error) = reported(&mesh, &options, None);
            assert_eq!(error, None, "{options:?}");
            reported.sort_by(f32::total_cmp);
            assert_eq!(reported.last(), Some(&1.0), "{options:?}: done at the end");
        }
    }
    alone.dedup();
    assert!(alone.len() > MOST_CALLS / 2, "no part is reported twice");
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
            let (reported, error) = reported(&mesh, &options, None);
            assert_eq!(error, None, "{options:?} {triangles:?}");
            assert_eq!(
                reported.last(),
                Some(&1.0),
                "{options:?} {triangles:?}: {reported:?}"
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
            let (all, _) = reported(&mesh, &options, None);
            let mut breaks = vec![1, all.len().div_ceil(2)];
            if threads == 1 {
                // On several threads, shares that finish together are reported in fewer calls.
                breaks.push(all.len());
            }
            for break_at in breaks {
                let (reported, error) = reported(&mesh, &options, Some(break_at));
                assert_eq!(
                    error,
                    Some(BuildError::Cancelled),
                    "{options:?} at {break_at}"
                );
                if threads == 1 {
                    assert_eq!(reported.len(), break_at, "{options:?}: no call after it");
                }
            }
        }
    }
}
