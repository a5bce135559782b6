//! Builders × every query against testing all triangles, on every generated scene: equal to the bit. (The slow
//! builders give the tree of the exact one, which the tests of `kd-sah` hold.)

mod rays;

use std::sync::Arc;

use kd::{BuildOptions, CostModel, Hit, KdTree, Method, Ray};
use kd_scene::Spd;
use kd_trace::brute_force;
use rays::rays_for;

/// Each scene at a size with few triangles, and how many rays meet all of them. The smallest `shells` is large.
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

fn builders() -> Vec<(&'static str, BuildOptions)> {
    let packed = CostModel {
        traverse: 1.0,
        intersect: 0.1,
        lanes: 8,
        empty_bonus: 0.8,
    };
    vec![
        (
            "median",
            BuildOptions::balanced().with_method(Method::Median),
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

#[test]
fn every_query_on_every_scene_equals_brute_force() {
    for (scene, size, count) in SCENES {
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
}

/// Multi-hit is dearer to check, so fewer rays meet it.
#[test]
fn ordered_hits_on_every_scene_equal_brute_force() {
    let (mut found, mut expected) = (Vec::new(), Vec::new());
    for (scene, size, count) in SCENES {
        let mesh = Arc::new(scene.generate(size).expect("a small size").mesh);
        let rays = rays_for(&mesh, count / 20, 2);
        for (builder, options) in builders() {
            let tree = KdTree::build(Arc::clone(&mesh), &options).expect("valid options");
            let mut several = 0;
            for (i, ray) in rays.iter().enumerate() {
                let max = [1, 2, 4, usize::MAX][i % 4];
                tree.hits(ray, max, &mut found);
                brute_force::hits(&mesh, ray, max, &mut expected);
                assert_eq!(
                    found,
                    expected,
                    "{} by {builder}, first {max} hits of {ray:?}",
                    scene.name()
                );
                several += usize::from(found.len() > 1);
            }
            assert!(
                20 * several > rays.len(),
                "{}: {several} rays with several hits",
                scene.name()
            );
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
