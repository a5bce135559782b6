//! The layout policy as a user sees it: every way to make a tree or a frame obeys the options.

use std::collections::HashSet;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use kd::glam::{Affine3A, Vec3};
use kd::scene::CommitError;
use kd::tree::StatsOf;
use kd::{
    BuildError, BuildOptions, KdTree, Layout, MergeMethod, Mesh, Ray, RayQuery, Scene, Strategy,
    WideNodes,
};
use kd_scene::{Room, Spd};
use kd_trace::{Division, WideTree};

/// Object splits leave boxes that overlap here, and planes cost less in the end.
fn mesh() -> Arc<Mesh> {
    Arc::new(Spd::Gears.generate(3).expect("a small size").mesh)
}

/// Walls around clutter, where other trees cost less than a division.
fn hall() -> Arc<Mesh> {
    Arc::new(Room::Hall.generate(20).expect("a small size").mesh)
}

fn presets() -> [BuildOptions; 3] {
    [
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
    ]
}

/// The presets, their methods as explicit ones, and both layouts of each.
fn all_options() -> Vec<BuildOptions> {
    let explicit = presets().map(|options| options.clone().with_method(options.method()));
    let both = presets().into_iter().chain(explicit);
    both.flat_map(|options| {
        [Layout::Binary, Layout::Wide].map(|layout| options.clone().with_layout(layout))
    })
    .collect()
}

fn built(options: &BuildOptions) -> KdTree {
    KdTree::build(mesh(), options).expect("valid options")
}

/// The bytes of a layout distinguish it from others here.
fn bytes(tree: &KdTree) -> kd::layout::LayoutBytes {
    tree.stats().layout_bytes.expect("a tree with a layout")
}

#[test]
fn bytes_distinguish_layouts() {
    let [fast, balanced, _] = presets();
    let explicit = balanced.clone().with_method(balanced.method());
    let binary = balanced.clone().with_layout(Layout::Binary);
    let options = [&fast, &balanced, &explicit, &binary];
    let all: HashSet<_> = options.map(|options| bytes(&built(options))).into();
    assert_eq!(all.len(), 4, "{all:?}");
}

#[test]
fn presets_make_wide_nodes_without_a_kd_tree() {
    let mesh = mesh();
    let most_references = 10 * mesh.len() as u64;
    let wide = |division| {
        let wide = WideTree::build(&mesh, division, false, None).expect("not cancelled");
        wide.bytes()
    };
    let [fast, balanced, best] = presets().map(|options| bytes(&built(&options)));
    assert_eq!(fast, wide(Division::Objects), "fast");
    assert_eq!(
        balanced,
        wide(Division::Planes { most_references }),
        "balanced"
    );
    assert_eq!(best, balanced, "planes cost least here");

    let hall = hall();
    let [fast, balanced, best] = presets().map(|options| {
        let tree = KdTree::build(Arc::clone(&hall), &options).expect("valid options");
        let stats = tree.stats();
        assert_eq!(stats.of, StatsOf::WideNodes, "{options:?}");
        stats.sah_cost_own
    });
    assert!(
        best < 0.97 * fast.min(balanced),
        "optimized: {best} below {fast} and {balanced}"
    );
}

/// Which of both is described depends on the options alone, not on what was built on demand.
#[test]
fn statistics_describe_what_rays_traverse() {
    for options in all_options() {
        let tree = built(&options);
        let stats = tree.stats();
        let is_preset = options.wide_nodes() != WideNodes::KdTree;
        let expected = if options.layout() == Layout::Wide && is_preset {
            StatsOf::WideNodes
        } else {
            StatsOf::KdTree
        };
        assert_eq!(stats.of, expected, "{options:?}");
        assert!(
            stats.references >= tree.mesh().len(),
            "{options:?}: {stats}"
        );
        let leaves: usize = stats.leaves_by_size.iter().sum();
        assert_eq!(leaves, stats.leaves, "{options:?}: {stats}");
        assert_eq!(
            stats.leaves_by_depth.len(),
            stats.depth + 1,
            "{options:?}: {stats}"
        );
        let kd_tree = tree.kd_tree().expect("within limits").stats();
        assert_eq!(kd_tree.of, StatsOf::KdTree, "{options:?}");
        assert_eq!(tree.stats(), stats, "{options:?}: as before");
    }
}

#[test]
fn the_kd_tree_is_that_of_the_method() {
    for options in presets() {
        let on_demand = built(&options);
        let at_once = built(&options.clone().with_method(options.method()));
        assert!(on_demand.nodes() == at_once.nodes(), "{options:?}");
    }
}

#[test]
fn a_kd_tree_on_demand_can_be_cancelled_and_can_fail() {
    let tree = built(&BuildOptions::balanced());
    let cancelled = tree.kd_tree_with_progress(&|_| ControlFlow::Break(()));
    assert_eq!(cancelled.err(), Some(BuildError::Cancelled));
    let calls = AtomicUsize::new(0);
    let count = |_: f32| {
        calls.fetch_add(1, Ordering::Relaxed);
        ControlFlow::Continue(())
    };
    let nodes = tree
        .kd_tree_with_progress(&count)
        .expect("not cancelled")
        .nodes()
        .len();
    assert!(calls.load(Ordering::Relaxed) > 10, "{calls:?} calls");
    // It is there now.
    let again = tree.kd_tree_with_progress(&|_| ControlFlow::Break(()));
    assert_eq!(again.expect("nothing to cancel").nodes().len(), nodes);
}

/// In the kd-tree and in each layout.
#[test]
fn a_build_is_cancelled_wherever_it_is() {
    for options in all_options() {
        for threads in [1, 2] {
            let options = options.clone().with_threads(threads);
            let calls = Mutex::new(Vec::new());
            let record = |done: f32| {
                calls.lock().expect("no panic").push(done);
                ControlFlow::Continue(())
            };
            KdTree::build_with_progress(mesh(), &options, &record).expect("not cancelled");
            let mut calls = calls.into_inner().expect("no panic");
            calls.sort_by(f32::total_cmp);
            assert_eq!(calls.last(), Some(&1.0), "{options:?}: {calls:?}");
            assert!((10..=512).contains(&calls.len()), "{options:?}: {calls:?}");
            for part in [0.0, 0.3, 0.7, 0.9, 0.99] {
                let stop = |done: f32| {
                    if done < part {
                        ControlFlow::Continue(())
                    } else {
                        ControlFlow::Break(())
                    }
                };
                let stopped = KdTree::build_with_progress(mesh(), &options, &stop);
                assert_eq!(
                    stopped.err(),
                    Some(BuildError::Cancelled),
                    "{options:?}, {part}"
                );
            }
        }
    }
}

/// There is little to do, or nothing.
#[test]
fn the_progress_of_any_build_ends_at_one() {
    let line = |count: u16| {
        let corners = (0..3 * count).map(|x| [f32::from(x), 0.0, 0.0]).collect();
        let triangles = (0..u32::from(count)).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        Mesh::new(corners, triangles.collect()).expect("finite")
    };
    for count in [0, 1, 100] {
        for options in all_options() {
            let last = Mutex::new(0.0_f32);
            let record = |done: f32| {
                let mut last = last.lock().expect("no panic");
                *last = last.max(done);
                ControlFlow::Continue(())
            };
            KdTree::build_with_progress(line(count), &options, &record).expect("not cancelled");
            let last = *last.lock().expect("no panic");
            assert_eq!(last, 1.0, "{count} triangles of no area, {options:?}");
            let stop = |_: f32| ControlFlow::Break(());
            let stopped = KdTree::build_with_progress(line(count), &options, &stop);
            assert_eq!(
                stopped.err(),
                Some(BuildError::Cancelled),
                "{count}, {options:?}"
            );
        }
    }
}

#[test]
fn wide_nodes_keep_to_the_limit_of_references() {
    let triangles = mesh().len();
    let references = |limit: Option<usize>| {
        let options = BuildOptions::balanced();
        let options = match limit {
            Some(limit) => options.with_max_refs(limit as u64),
            None => options,
        };
        built(&options).stats().references
    };
    let unlimited = references(None);
    assert!(
        unlimited > triangles + triangles / 50,
        "planes cut triangles: {unlimited}"
    );
    let half = triangles.midpoint(unlimited);
    let limited = references(Some(half));
    assert!(
        (triangles + 1..=half).contains(&limited),
        "{limited} of {half}"
    );
    assert_eq!(references(Some(0)), triangles, "one each");
}

#[test]
fn a_changed_layout_is_the_one_of_a_build() {
    for options in all_options() {
        for to in [Layout::Wide, Layout::Binary] {
            let changed = built(&options).with_layout(to).expect("within limits");
            let expected = built(&options.clone().with_layout(to));
            assert_eq!(changed.layout(), to, "{options:?}");
            assert_eq!(bytes(&changed), bytes(&expected), "{options:?}");
            assert_eq!(changed.stats(), expected.stats(), "{options:?}");
        }
    }
}

fn committed(options: BuildOptions, strategy: Strategy) -> Result<Scene, CommitError> {
    let mut scene = Scene::new(options);
    scene.set_strategy(strategy);
    scene.add_static(mesh()).expect("fits");
    let part = Spd::Tetra.generate(3).expect("a small size").mesh;
    let part = scene.add_dynamic(part).expect("fits");
    scene
        .set_transform(part, Affine3A::IDENTITY)
        .expect("finite");
    scene.commit()?;
    Ok(scene)
}

#[test]
fn the_static_parts_of_a_scene_are_laid_out_as_a_tree() {
    for options in presets() {
        let mut scene = Scene::new(options.clone());
        scene.add_static(mesh()).expect("fits");
        scene.commit().expect("a frame");
        assert_eq!(
            scene.frame().bytes(),
            bytes(&built(&options)),
            "{options:?}"
        );
    }
}

#[test]
fn strategies_have_the_documented_layouts() {
    let wide = BuildOptions::balanced();
    let binary = wide.clone().with_layout(Layout::Binary);
    let rows = [
        (Strategy::Auto, [Some(Layout::Wide), Some(Layout::Binary)]),
        (
            Strategy::Merge(MergeMethod::Guided),
            [Some(Layout::Wide), None],
        ),
        (Strategy::Refit, [Some(Layout::Wide), None]),
        (Strategy::Instances, [Some(Layout::Wide), None]),
        (Strategy::Dual, [Some(Layout::Wide), None]),
        (
            Strategy::Merge(MergeMethod::PartitionTrees),
            [Some(Layout::Binary); 2],
        ),
        (
            Strategy::Merge(MergeMethod::BspMerge),
            [Some(Layout::Binary); 2],
        ),
        (
            Strategy::Merge(MergeMethod::Insertion),
            [Some(Layout::Binary); 2],
        ),
        (Strategy::Rebuild(wide.clone()), [Some(Layout::Wide); 2]),
        (Strategy::Rebuild(binary.clone()), [Some(Layout::Binary); 2]),
    ];
    for (strategy, expected) in rows {
        for (options, expected) in [&wide, &binary].into_iter().zip(expected) {
            match (committed(options.clone(), strategy.clone()), expected) {
                (Ok(scene), Some(layout)) => {
                    assert_eq!(scene.frame().layout(), layout, "{strategy:?}");
                }
                (Err(CommitError::Layout { strategy: named }), None) => {
                    assert_eq!(named, strategy);
                }
                (result, _) => panic!("{strategy:?}: {:?}", result.map(|_| ())),
            }
        }
    }
    let merged = |strategy| committed(binary.clone(), strategy).expect("a frame");
    assert_eq!(
        merged(Strategy::Auto).frame().bytes(),
        merged(Strategy::Merge(MergeMethod::PartitionTrees))
            .frame()
            .bytes(),
        "Auto merges kd-trees"
    );
}

#[test]
fn a_refused_layout_leaves_the_frame_before() {
    let options = BuildOptions::balanced().with_layout(Layout::Binary);
    let mut scene = committed(options, Strategy::Auto).expect("a frame");
    let before = scene.snapshot();
    scene.set_strategy(Strategy::Refit);
    let error = scene.commit().expect_err("wide nodes only").to_string();
    assert!(error.contains("binary layout"), "{error}");
    assert!(Arc::ptr_eq(&before, &scene.snapshot()), "the same frame");
    scene.set_strategy(Strategy::Auto);
    scene.commit().expect("as before");
}

/// One generic function serves everything that rays can ask.
#[test]
fn every_structure_answers_the_same_trait() {
    fn hits_of<Q: RayQuery>(structure: &Q, rays: &[Ray]) -> Vec<bool> {
        let mut batch = vec![None; rays.len()];
        structure.intersect_batch(rays, &mut batch);
        let mut occluded = vec![false; rays.len()];
        structure.occluded_batch(rays, &mut occluded);
        let packet = kd::RayPacket8::new(&rays[..8]);
        assert_eq!(structure.intersect8(&packet), batch[..8], "packet");
        assert_eq!(structure.occluded8(&packet), occluded[..8], "packet");
        let mut first = Vec::new();
        for ((ray, hit), is_occluded) in rays.iter().zip(&batch).zip(&occluded) {
            assert_eq!(structure.intersect(ray), *hit, "{ray:?}");
            assert_eq!(structure.occluded(ray), *is_occluded, "{ray:?}");
            structure.hits(ray, 1, &mut first);
            assert_eq!(first.first(), hit.as_ref(), "{ray:?}");
        }
        batch.iter().map(Option::is_some).collect()
    }
    let mesh = mesh();
    let center = mesh.bounds().center();
    let rays: Vec<Ray> = (0..400_u16)
        .map(|i| {
            let (x, y) = (f32::from(i % 20) - 9.5, f32::from(i / 20) - 9.5);
            let from = center + mesh.bounds().diagonal() * Vec3::Z;
            Ray::new(
                from,
                center + 0.05 * mesh.bounds().diagonal() * Vec3::new(x, y, 0.0) - from,
            )
        })
        .collect();
    let tree = built(&BuildOptions::balanced());
    let expected = hits_of(&tree, &rays);
    assert!(
        expected.contains(&true) && expected.contains(&false),
        "both"
    );
    let binary = tree.with_layout(Layout::Binary).expect("within limits");
    assert_eq!(hits_of(&binary, &rays), expected, "binary");
    let lazy = kd::LazyTree::new(Arc::clone(&mesh), &BuildOptions::balanced()).expect("valid");
    assert_eq!(hits_of(&lazy, &rays), expected, "lazy");
    for strategy in [Strategy::Auto, Strategy::Rebuild(BuildOptions::fast())] {
        let mut scene = Scene::new(BuildOptions::balanced());
        scene.set_strategy(strategy);
        scene.add_static(Arc::clone(&mesh)).expect("fits");
        scene.commit().expect("a frame");
        assert_eq!(hits_of(&scene.frame(), &rays), expected, "frame");
        assert_eq!(hits_of(&*scene.snapshot(), &rays), expected, "snapshot");
    }
}
