//! Trees that are built where rays enter them, against testing all triangles: equal to the bit, after any rays.

mod rays;

use std::sync::Arc;
use std::thread;

use fastrand::Rng;
use kd::glam::Vec3;
use kd::tree::{Axis, NodeView};
use kd::{BuildError, BuildOptions, Hit, KdTree, LazyTree, Mesh, Method, Ray};
use kd_oracle::{check_batch, check_ray, effort};
use kd_scene::Spd;
use kd_trace::brute_force;
use rays::{rays_for, vertex_of};

/// Large enough for several generations of cells that are divided one by one.
const SCENES: [(Spd, u32); 4] = [
    (Spd::Lattice, 3),
    (Spd::Gears, 3),
    (Spd::Tree, 6),
    (Spd::Tetra, 7),
];

/// Rays of the usual kinds, and rays that start on planes of the tree.
const RAYS: usize = effort::count(1_200, 10_000);
const RAYS_ON_PLANES: usize = effort::count(1_000, 2_000);

fn builders() -> [(&'static str, BuildOptions); 4] {
    [
        ("fast", BuildOptions::fast()),
        ("balanced", BuildOptions::balanced()),
        ("best", BuildOptions::best()),
        (
            "median",
            BuildOptions::balanced()
                .with_method(Method::Median)
                .with_small_leaf(16),
        ),
    ]
}

fn mesh_of(scene: Spd, size: u32) -> Arc<Mesh> {
    let mesh = scene.generate(size).expect("a small size").mesh;
    assert!(mesh.len() > 10_000, "{}: {}", scene.name(), mesh.len());
    Arc::new(mesh)
}

/// Starts on planes of the tree: in the plane, or across it towards a vertex.
fn rays_on_planes(mesh: &Mesh, options: &BuildOptions, count: usize, seed: u64) -> Vec<Ray> {
    let tree = KdTree::build(mesh.clone(), options).expect("valid options");
    let planes: Vec<(Axis, f32)> = tree
        .nodes()
        .iter()
        .filter_map(|node| match node.view() {
            NodeView::Interior { axis, split, .. } => Some((axis, split)),
            NodeView::Leaf { .. } => None,
        })
        .collect();
    // Large cells are the ones that are opened one by one, and the first nodes are the largest on their path.
    let large = planes.len().min(64);
    let mut rng = Rng::with_seed(seed);
    let bounds = mesh.bounds();
    (0..count)
        .map(|i| {
            let among = if i % 2 == 0 { large } else { planes.len() };
            let (axis, split) = planes[rng.usize(..among)];
            let part = Vec3::from_array([(); 3].map(|()| rng.f32()));
            let mut origin = bounds.min + part * bounds.extent();
            origin[axis.index()] = split;
            let mut direction = vertex_of(&mut rng, mesh) - origin;
            if rng.bool() {
                direction[axis.index()] = if rng.bool() { 0.0 } else { -0.0 };
            }
            Ray::new(origin, direction)
        })
        .collect()
}

#[test]
fn every_query_equals_brute_force() {
    thread::scope(|scope| {
        for (scene, size) in SCENES {
            scope.spawn(move || every_query_of_a_scene_equals_brute_force(scene, size));
        }
    });
}

fn every_query_of_a_scene_equals_brute_force(scene: Spd, size: u32) {
    let mesh = mesh_of(scene, size);
    let mut rays = rays_for(&mesh, RAYS, 1);
    let half = RAYS_ON_PLANES / 2;
    rays.extend(rays_on_planes(&mesh, &BuildOptions::best(), half, 2));
    rays.extend(rays_on_planes(&mesh, &BuildOptions::fast(), half, 3));
    let expected: Vec<Option<Hit>> = rays
        .iter()
        .map(|ray| brute_force::intersect(&mesh, ray))
        .collect();
    let hit = expected.iter().flatten().count();
    assert!(10 * hit >= 3 * rays.len(), "{}: {hit} hit", scene.name());
    for (builder, options) in builders() {
        let what = format!("{} by {builder}", scene.name());
        // One tree for each query, so that each meets cells that no ray has entered.
        let [closest, any, ordered] =
            [(); 3].map(|()| LazyTree::new(Arc::clone(&mesh), &options).expect("valid"));
        let mut hits = vec![None; rays.len()];
        closest.intersect_batch(&rays, &mut hits);
        let mut occluded = vec![false; rays.len()];
        any.occluded_batch(&rays, &mut occluded);
        for (i, (ray, expected)) in rays.iter().zip(&expected).enumerate() {
            assert_eq!(hits[i], *expected, "{what}: closest hit of {ray:?}");
            let is_hit = expected.is_some();
            assert_eq!(occluded[i], is_hit, "{what}: any hit of {ray:?}");
            if let Some(hit) = expected {
                // A range that ends at the hit contains it, and one that ends just before it contains none.
                let until = ray.with_range(ray.t_min, hit.t);
                assert_eq!(any.intersect(&until), Some(*hit), "{what}: {until:?}");
                let before = ray.with_range(ray.t_min, hit.t.next_down());
                assert!(!closest.occluded(&before), "{what}: {before:?}");
            }
        }
        // Every query, filters and batches on all threads included.
        let some: Vec<Ray> = rays.iter().copied().step_by(49).collect();
        let all_hits = some.iter().map(|ray| {
            let mut hits = Vec::new();
            brute_force::hits(&mesh, ray, usize::MAX, &mut hits);
            hits
        });
        let all_hits: Vec<Vec<Hit>> = all_hits.collect();
        check_batch(&what, &ordered, &some, &all_hits);
        for (ray, hits) in some.iter().zip(&all_hits) {
            check_ray(&what, &ordered, ray, hits);
        }
        for tree in [closest, any, ordered] {
            let opened = tree.opened();
            assert!(opened > 20, "{what}: only {opened} cells were opened");
        }
    }
}

#[test]
fn threads_that_open_cells_at_once_get_the_same_answers() {
    const THREADS: usize = 4;
    for (scene, size) in SCENES {
        let mesh = mesh_of(scene, size);
        let rays = rays_for(&mesh, RAYS, 4);
        for (builder, options) in builders() {
            let what = format!("{} by {builder}", scene.name());
            let built = KdTree::build(Arc::clone(&mesh), &options).expect("valid");
            let mut expected = vec![None; rays.len()];
            built.intersect_batch(&rays, &mut expected);
            let tree = LazyTree::new(Arc::clone(&mesh), &options).expect("valid");
            let trace = |thread: usize| {
                // Half of the threads start at the same cells, the others elsewhere.
                let first = (thread / 2) * rays.len() / 2;
                for i in (first..rays.len()).chain(0..first) {
                    assert_eq!(
                        tree.intersect(&rays[i]),
                        expected[i],
                        "{what}: {:?}",
                        rays[i]
                    );
                }
            };
            thread::scope(|scope| {
                for thread in 0..THREADS {
                    scope.spawn(move || trace(thread));
                }
            });
            let alone = LazyTree::new(Arc::clone(&mesh), &options).expect("valid");
            alone.intersect_batch(&rays, &mut expected);
            assert_eq!(tree.opened(), alone.opened(), "{what}: the same cells");
        }
    }
}

#[test]
fn few_rays_open_few_cells() {
    for (scene, size) in SCENES {
        let mesh = mesh_of(scene, size);
        let rays = rays_for(&mesh, RAYS, 5);
        for (builder, options) in builders() {
            let what = format!("{} by {builder}", scene.name());
            let tree = LazyTree::new(Arc::clone(&mesh), &options).expect("valid");
            assert_eq!(tree.opened(), 0, "{what}: no ray has entered");

            let outside = mesh.bounds().max + Vec3::ONE;
            assert!(!tree.occluded(&Ray::new(outside, Vec3::X)), "{what}");
            assert_eq!(tree.opened(), 0, "{what}: past everything");

            // A short look at one triangle.
            let [a, b, c] = mesh.corners(0);
            let above = 1e-3 * mesh.bounds().diagonal() * mesh.normal(0);
            let look = Ray::new((a + b + c) / 3.0 + above, -above).with_range(0.0, 2.0);
            assert!(tree.intersect(&look).is_some(), "{what}: it is there");
            let few = tree.opened();
            assert!(tree.intersect(&look).is_some(), "{what}: and again");
            assert_eq!(tree.opened(), few, "{what}: nothing new to open");

            for ray in &rays {
                tree.intersect(ray);
            }
            let many = tree.opened();
            assert!(
                0 < few && 2 * few < many,
                "{what}: {few}, then {many} cells"
            );
        }
    }
}

#[test]
fn a_finished_tree_is_the_one_that_is_built_at_once() {
    let mesh = mesh_of(Spd::Gears, 3);
    let options = BuildOptions::balanced();
    let tree = LazyTree::new(Arc::clone(&mesh), &options).expect("valid");
    for ray in rays_for(&mesh, 100, 6) {
        tree.intersect(&ray);
    }
    let finished = tree.finish().expect("valid");
    let built = KdTree::build(mesh, &options).expect("valid");
    assert!(finished.nodes() == built.nodes(), "the same nodes");
    let [finished, built] = [&finished, &built].map(|tree| tree.kd_tree().expect("valid").refs());
    assert!(finished == built, "and leaves");
}

#[test]
fn an_empty_mesh_is_never_hit() {
    let empty = Mesh::new(vec![], vec![]).expect("valid");
    let tree = LazyTree::new(empty, &BuildOptions::default()).expect("valid");
    let ray = Ray::new([0.0; 3], [1.0, 0.0, 0.0]);
    let mut hits = Vec::new();
    tree.hits(&ray, usize::MAX, &mut hits);
    assert_eq!(
        (tree.intersect(&ray), tree.occluded(&ray), hits),
        (None, false, vec![]),
        "nothing there"
    );
    assert_eq!((tree.opened(), tree.mesh().len()), (0, 0), "nor opened");
    assert!(tree.finish().is_ok(), "nor in the way");
}

#[test]
fn a_few_triangles_are_one_cell() {
    let corners = vec![[-9.0, -9.0, 1.0], [9.0, -9.0, 1.0], [0.0, 9.0, 1.0]];
    let mesh = Mesh::new(corners, vec![[0, 1, 2]]).expect("valid");
    let tree = LazyTree::new(mesh, &BuildOptions::default()).expect("valid");
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    assert_eq!(tree.intersect(&ray).map(|hit| hit.t), Some(1.0), "{ray:?}");
    assert_eq!(tree.opened(), 1, "the cell of everything");
    for cannot_hit in [
        Ray::new([f32::NAN; 3], [0.0, 0.0, 1.0]),
        Ray::new([0.0; 3], [0.0; 3]),
        ray.with_range(2.0, 0.5),
        ray.with_mask(0),
    ] {
        assert!(!tree.occluded(&cannot_hit), "{cannot_hit:?}");
    }
}

#[test]
fn wrong_options_are_refused_before_any_ray() {
    let mesh = Mesh::new(vec![], vec![]).expect("valid");
    let too_deep = BuildOptions::default().with_max_depth(65);
    let error = LazyTree::new(mesh, &too_deep).expect_err("65 is too deep");
    let is_named = matches!(error, BuildError::InvalidOption { name, .. } if name == "max_depth");
    assert!(is_named, "{error}");
}

#[test]
#[should_panic(expected = "one answer per ray")]
fn batches_of_unequal_length_are_refused() {
    let empty = Mesh::new(vec![], vec![]).expect("valid");
    let tree = LazyTree::new(empty, &BuildOptions::default()).expect("valid");
    tree.occluded_batch(&[], &mut [false]);
}
