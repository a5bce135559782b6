//! Builders × every query against testing all triangles, on every generated scene: equal to the bit. The slow builders
//! give the very tree of the exact one, so its answers are theirs.

mod rays;

use std::sync::Arc;
use std::thread;

use kd::{BuildOptions, CostModel, Hit, KdTree, Layout, Method, Ray};
use kd_oracle::effort;
use kd_scene::Spd;
use kd_trace::brute_force;
use rays::rays_for;

/// Each scene at a size with few triangles, and how many rays meet all of them in long tests. The smallest `shells` is large.
const SCENES: [(Spd, u32, usize); 11] = [
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
];

/// The most triangles of a scene that the O(N²) builder meets.
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
            "binary layout",
            BuildOptions::balanced().with_layout(Layout::Binary),
        ),
        (
            "exact 15:20",
            BuildOptions::best().with_cost(CostModel::CLASSIC),
        ),
        ("blocks of eight", BuildOptions::best().with_cost(packed)),
    ]
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
    let count = effort::count(count / 10, count);
    let mesh = Arc::new(scene.generate(size).expect("a small size").mesh);
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
    for (builder, options) in builders() {
        let tree = KdTree::build(Arc::clone(&mesh), &options).expect("valid options");
        let what = format!("{} by {builder}", scene.name());
        check(&tree, &rays, &expected, &what);
    }
}

#[test]
fn slow_builders_give_the_tree_that_met_brute_force() {
    let mut met_by_naive = 0;
    for (scene, size, _) in SCENES {
        let mesh = Arc::new(scene.generate(size).expect("a small size").mesh);
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
            let is_same =
                tree.nodes() == exact.nodes() && tree.tree().refs() == exact.tree().refs();
            assert!(is_same, "{} by {method:?}", scene.name());
        }
    }
    assert!(
        met_by_naive >= 4,
        "scenes small enough for O(N²): {met_by_naive}"
    );
}

/// Multi-hit is dearer to check, so fewer rays meet it.
#[test]
fn ordered_hits_on_every_scene_equal_brute_force() {
    let mut found = Vec::new();
    for (scene, size, count) in SCENES {
        let mesh = Arc::new(scene.generate(size).expect("a small size").mesh);
        let rays = rays_for(&mesh, effort::count(count / 100, count / 20), 2);
        let most = |i: usize| [1, 2, 4, usize::MAX][i % 4];
        let expected: Vec<Vec<Hit>> = rays
            .iter()
            .enumerate()
            .map(|(i, ray)| {
                let mut hits = Vec::new();
                brute_force::hits(&mesh, ray, most(i), &mut hits);
                hits
            })
            .collect();
        let several = expected.iter().filter(|hits| hits.len() > 1).count();
        assert!(
            20 * several > rays.len(),
            "{}: {several} rays with several hits",
            scene.name()
        );
        for (builder, options) in builders() {
            let tree = KdTree::build(Arc::clone(&mesh), &options).expect("valid options");
            for (i, (ray, expected)) in rays.iter().zip(&expected).enumerate() {
                let max = most(i);
                tree.hits(ray, max, &mut found);
                assert_eq!(
                    &found,
                    expected,
                    "{} by {builder}, first {max} hits of {ray:?}",
                    scene.name()
                );
            }
        }
    }
}

#[track_caller]
fn check(tree: &KdTree, rays: &[Ray], expected: &[Option<Hit>], what: &str) {
    let mut hits = vec![None; rays.len()];
    tree.intersect_batch(rays, &mut hits);
    let mut occluded = vec![false; rays.len()];
    tree.occluded_batch(rays, &mut occluded);
    for ((ray, expected), (hit, occluded)) in
        rays.iter().zip(expected).zip(hits.iter().zip(occluded))
    {
        assert_eq!(hit, expected, "{what}: closest hit of {ray:?}");
        assert_eq!(occluded, expected.is_some(), "{what}: any hit of {ray:?}");
        if let Some(hit) = hit {
            // A range that ends at the hit holds it, and one that ends just before it holds nothing.
            let until = ray.with_range(ray.t_min, hit.t);
            assert_eq!(tree.intersect(&until), Some(*hit), "{what}: {until:?}");
            let before = ray.with_range(ray.t_min, hit.t.next_down());
            assert!(!tree.occluded(&before), "{what}: {before:?}");
        }
    }
}
