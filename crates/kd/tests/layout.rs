//! The layout policy as a user sees it: every way to make a tree or a frame obeys the options.

use std::sync::Arc;

use kd::glam::{Affine3A, Vec3};
use kd::scene::CommitError;
use kd::{BuildOptions, KdTree, Layout, MergeMethod, Mesh, Ray, RayQuery, Scene, Strategy};
use kd_scene::Spd;

/// Objects give cheaper wide nodes than planes here, so that the policies of the presets differ.
fn mesh() -> Arc<Mesh> {
    Arc::new(Spd::Sombrero.generate(2).expect("a small size").mesh)
}

fn presets() -> [BuildOptions; 3] {
    [
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
    ]
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
    let [_, balanced, best] = presets();
    let best = built(&best);
    let planes = kd_trace::WideTree::new(best.tree(), best.mesh()).bytes();
    assert_ne!(
        bytes(&best),
        planes,
        "the cheaper nodes are not those of planes"
    );
    assert_ne!(
        bytes(&built(&balanced.clone().with_layout(Layout::Binary))),
        bytes(&built(&balanced)),
        "binary and wide"
    );
}

#[test]
fn a_changed_layout_is_the_one_of_a_build() {
    for options in presets() {
        for (from, to) in [
            (Layout::Binary, Layout::Wide),
            (Layout::Wide, Layout::Binary),
        ] {
            let changed = built(&options.clone().with_layout(from)).with_layout(to);
            let expected = built(&options.clone().with_layout(to));
            assert_eq!(changed.layout(), to, "{options:?}");
            assert_eq!(bytes(&changed), bytes(&expected), "{options:?}");
        }
    }
}

#[test]
fn a_loaded_tree_obeys_options() {
    let name = format!("kd-layout-test-{}.kdtree", std::process::id());
    let path = std::env::temp_dir().join(name);
    for options in presets() {
        for layout in [Layout::Binary, Layout::Wide] {
            let options = options.clone().with_layout(layout);
            let tree = built(&options);
            tree.save(&path).expect("a folder for temporary files");
            let loaded = KdTree::load_with(&path, &options).expect("just written");
            assert_eq!(loaded.layout(), layout, "{options:?}");
            assert_eq!(bytes(&loaded), bytes(&tree), "{options:?}");
        }
    }
    let default = KdTree::load(&path).expect("just written");
    let balanced = KdTree::load_with(&path, &BuildOptions::balanced()).expect("just written");
    assert_eq!(bytes(&default), bytes(&balanced), "as `balanced`");
    assert_eq!(default.layout(), Layout::Wide, "the default");
    std::fs::remove_file(&path).expect("just written");
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
    let binary = tree.with_layout(Layout::Binary);
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
