//! Builders × layouts × every query against testing all triangles, on every generated scene: equal to the bit. The slow
//! builders give the tree of the exact one, so its answers are theirs.

mod rays;

use std::sync::Arc;
use std::thread;

use kd::layout::WideTree;
use kd::{BuildOptions, CostModel, Culling, Hit, KdTree, Layout, Mesh, Method, Ray};
use kd_oracle::{check_batch, check_ray, effort};
use kd_scene::Spd;
use kd_trace::brute_force;
use rays::rays_for;

/// Each scene at a size with few triangles, some more than once, and the number of rays traced through all of them in long tests.
/// The smallest `shells` is large.
const SCENES: [(Spd, u32, usize); 15] = [
    (Spd::Balls, 1, 100_000),
    (Spd::Gears, 1, 100_000),
    (Spd::Mount, 3, 100_000),
    (Spd::Rings, 1, 100_000),
    (Spd::Teapot, 3, 100_000),
    (Spd::Tetra, 4, 100_000),
    (Spd::Tree, 1, 100_000),
    (Spd::Lattice, 1, 100_000),
    (Spd::Shells, 1, 4_000),
    (Spd::Sombrero, 1, 100_000),
    (Spd::Jacks, 1, 100_000),
    (Spd::Gears, 2, 10_000),
    (Spd::Mount, 5, 10_000),
    (Spd::Tetra, 6, 10_000),
    (Spd::Tree, 4, 10_000),
];

/// Wide nodes follow the planes of the kd-tree in cells of more triangles.
const PLANES_ABOVE: usize = 1024;

/// Upper limit on the triangles of a scene for the O(N²) builder.
const NAIVE_UP_TO: usize = 1500;

fn builders() -> Vec<(&'static str, BuildOptions)> {
    let packed = CostModel {
        traverse: 1.0,
        intersect: 0.1,
        lanes: 8,
        empty_bonus: 0.8,
    };
    let by = |method| BuildOptions::balanced().with_method(method);
    vec![
        ("median", by(Method::Median)),
        ("binned", by(Method::Binned { bins: 32 })),
        (
            "sampled on one axis",
            by(Method::Sampled { all_axes: false }),
        ),
        (
            "sampled on all axes",
            by(Method::Sampled { all_axes: true }),
        ),
        (
            "hybrid of few bins",
            by(Method::Hybrid {
                bins: 4,
                exact_below: 8,
            }),
        ),
        ("fast", BuildOptions::fast()),
        ("balanced", BuildOptions::balanced()),
        ("best", BuildOptions::best()),
        (
            "exact 15:20",
            BuildOptions::best().with_cost(CostModel::CLASSIC),
        ),
        ("blocks of eight", BuildOptions::best().with_cost(packed)),
    ]
}

/// Every builder in both layouts; in the wide one only once for a mesh in which all builders have the same wide nodes.
fn trees_over(mesh: &Arc<Mesh>) -> impl Iterator<Item = (String, KdTree)> {
    let has_planes = mesh.len() > PLANES_ABOVE;
    builders().into_iter().flat_map(move |(builder, options)| {
        let layouts = [Layout::Binary, Layout::Wide]
            .into_iter()
            .filter(move |layout| *layout == Layout::Binary || has_planes || builder == "balanced");
        layouts.map(move |layout| {
            let options = options.clone().with_layout(layout);
            let tree = KdTree::build(Arc::clone(mesh), &options).expect("valid options");
            (format!("{builder}, {layout:?}"), tree)
        })
    })
}

fn mesh_of(scene: Spd, size: u32) -> Arc<Mesh> {
    Arc::new(scene.generate(size).expect("a small size").mesh)
}

fn refs_of(tree: &KdTree) -> &[kd::tree::Slot] {
    tree.kd_tree().expect("within limits").refs()
}

/// In small meshes all builders have the same wide nodes, so that only larger ones test how nodes follow planes.
#[test]
fn large_scenes_have_wide_nodes_of_planes() {
    let mut large = 0;
    for (scene, size, _) in SCENES {
        let mesh = mesh_of(scene, size);
        let wide = |options: &BuildOptions| {
            let binary = options.clone().with_layout(Layout::Binary);
            let tree = KdTree::build(Arc::clone(&mesh), &binary).expect("valid options");
            WideTree::new(tree.kd_tree().expect("binary"), &mesh)
        };
        let objects = WideTree::from_objects(&mesh);
        let name = format!("{} {size}, {} triangles", scene.name(), mesh.len());
        if mesh.len() <= PLANES_ABOVE {
            for (builder, options) in builders() {
                assert!(wide(&options) == objects, "{name} by {builder}");
            }
            continue;
        }
        let median = wide(&BuildOptions::balanced().with_method(Method::Median));
        let best = wide(&BuildOptions::best());
        if median != best && median != objects && best != objects {
            large += 1;
        }
    }
    assert!(
        large >= 6,
        "scenes whose planes show in wide nodes: {large}"
    );
}

#[test]
fn every_query_on_every_scene_equals_brute_force() {
    thread::scope(|scope| {
        for (scene, size, count) in SCENES {
            scope.spawn(move || every_query_equals_brute_force(scene, size, count));
        }
    });
}

fn every_query_equals_brute_force(scene: Spd, size: u32, count: usize) {
    let count = effort::count(count / 16, count);
    let mesh = mesh_of(scene, size);
    let rays = rays_for(&mesh, count, 1);
    let expected: Vec<Option<Hit>> = rays
        .iter()
        .map(|ray| brute_force::intersect(&mesh, ray))
        .collect();
    let hits = expected.iter().flatten().count();
    assert!(
        10 * hits >= 3 * count,
        "{}: only {hits} of {count} rays hit",
        scene.name()
    );
    for (builder, tree) in trees_over(&mesh) {
        let what = format!("{} {size} by {builder}", scene.name());
        // The default preset meets all rays, the others a quarter of them.
        let is_default = builder.starts_with("balanced");
        let count = if is_default { count } else { count / 4 };
        check(&tree, &rays[..count], &expected[..count], &what);
    }
}

#[test]
fn slow_builders_give_the_tree_that_met_brute_force() {
    let mut met_by_naive = 0;
    for (scene, size, _) in SCENES {
        let mesh = mesh_of(scene, size);
        let by = |method| {
            let options = BuildOptions::best().with_method(method);
            KdTree::build(Arc::clone(&mesh), &options).expect("valid options")
        };
        let exact = by(Method::Exact);
        let mut slow = vec![Method::Resort, Method::Sweep];
        if mesh.len() <= NAIVE_UP_TO {
            slow.push(Method::Naive);
            met_by_naive += 1;
        }
        for method in slow {
            let tree = by(method);
            let is_same = tree.nodes() == exact.nodes() && refs_of(&tree) == refs_of(&exact);
            assert!(is_same, "{} by {method:?}", scene.name());
        }
    }
    assert!(
        met_by_naive >= 4,
        "scenes small enough for O(N²): {met_by_naive}"
    );
}

/// Every query, filters and batches on all threads included, of rays that see both sides or one. It needs all hits, which take
/// longer, so fewer rays are traced.
#[test]
fn queries_of_all_hits_on_every_scene_equal_brute_force() {
    let sides = [Culling::NONE, Culling::BACK, Culling::NONE, Culling::FRONT];
    for (scene, size, count) in SCENES {
        let mesh = mesh_of(scene, size);
        let rays = rays_for(&mesh, effort::count(count / 160, count / 20), 2);
        let rays = rays.iter().zip(sides.into_iter().cycle());
        let rays: Vec<Ray> = rays.map(|(ray, side)| ray.with_culling(side)).collect();
        let all_hits = |ray: &Ray| {
            let mut hits = Vec::new();
            brute_force::hits(&mesh, ray, usize::MAX, &mut hits);
            hits
        };
        let expected: Vec<Vec<Hit>> = rays.iter().map(all_hits).collect();
        let several = expected.iter().filter(|hits| hits.len() > 1).count();
        assert!(
            20 * several > rays.len(),
            "{}: {several} rays with several hits",
            scene.name()
        );
        for (builder, tree) in trees_over(&mesh) {
            let name = format!("{} {size} by {builder}", scene.name());
            for (ray, expected) in rays.iter().zip(&expected) {
                check_ray(&name, &tree, ray, expected);
            }
            check_batch(&name, &tree, &rays, &expected);
        }
    }
}

#[track_caller]
fn check(tree: &KdTree, rays: &[Ray], expected: &[Option<Hit>], what: &str) {
    let mut hits = vec![None; rays.len()];
    tree.intersect_batch(rays, &mut hits);
    let mut occluded = vec![false; rays.len()];
    tree.occluded_batch(rays, &mut occluded);
    let answers = hits.iter().zip(occluded);
    for (i, ((ray, expected), (hit, occluded))) in
        rays.iter().zip(expected).zip(answers).enumerate()
    {
        assert_eq!(hit, expected, "{what}: closest hit of {ray:?}");
        assert_eq!(occluded, expected.is_some(), "{what}: any hit of {ray:?}");
        if let Some(hit) = hit
            && i % 4 == 0
        {
            // A range that ends at the hit contains it, and one that ends just before it contains none.
            let until = ray.with_range(ray.t_min, hit.t);
            assert_eq!(tree.intersect(&until), Some(*hit), "{what}: {until:?}");
            let before = ray.with_range(ray.t_min, hit.t.next_down());
            assert!(!tree.occluded(&before), "{what}: {before:?}");
        }
    }
}
