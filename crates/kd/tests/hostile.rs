//! Presets on meshes that ruin builds: answers, and limits of references.

mod rays;

use std::sync::Arc;

use kd::{BuildOptions, KdTree, Mesh, Ray};
use kd_oracle::effort;
use kd_scene::Hostile;
use kd_trace::brute_force;
use rays::rays_for;

fn presets() -> [BuildOptions; 3] {
    [
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
    ]
}

#[track_caller]
fn check(tree: &KdTree, mesh: &Mesh, rays: &[Ray], what: &str) {
    let mut batch = vec![None; rays.len()];
    tree.intersect_batch(rays, &mut batch);
    for (ray, in_batch) in rays.iter().zip(batch) {
        let expected = brute_force::intersect(mesh, ray);
        assert_eq!(tree.intersect(ray), expected, "{what}: {ray:?}");
        assert_eq!(in_batch, expected, "{what}, in a batch: {ray:?}");
        assert_eq!(tree.occluded(ray), expected.is_some(), "{what}: {ray:?}");
    }
}

/// The extent overflows in f32, and times the flat side it is no number.
#[test]
fn flat_triangles_at_both_ends_of_f32_are_built() {
    for count in [2, 9, 40, 3000_u16] {
        let corners = (0..count).flat_map(|number| {
            let x = if number % 2 == 0 { 3e38 } else { -3e38 };
            let y = f32::from(number);
            [[x, y, 0.0], [x, y + 0.5, 0.0], [0.9 * x, y, 0.0]]
        });
        let triangles = (0..u32::from(count)).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        let mesh = Mesh::new(corners.collect(), triangles.collect()).expect("finite");
        let mesh = Arc::new(mesh);
        let down = |x: f32, y: f32| Ray::new([x, y, 1.0], [0.0, 0.0, -1.0]);
        let rays = [
            down(2.9e38, 0.1),
            down(-2.9e38, 1.1),
            down(0.0, 0.0),
            down(2.9e38, 8.1),
        ];
        for options in presets() {
            let tree = KdTree::build(Arc::clone(&mesh), &options).expect("valid options");
            check(
                &tree,
                &mesh,
                &rays,
                &format!("{count}, {:?}", options.wide_nodes()),
            );
        }
    }
}

/// Large enough for planes, which take cells of more than 1024 triangles.
#[test]
fn presets_answer_and_keep_to_their_limits() {
    for hostile in Hostile::ALL {
        let mesh = Arc::new(hostile.generate(5000).expect("small"));
        let rays = rays_for(&mesh, effort::count(40, 1000), 5);
        for options in presets() {
            let build = |options: &BuildOptions| {
                KdTree::build(Arc::clone(&mesh), options).expect("valid options")
            };
            let what = format!("{hostile}, {:?}", options.wide_nodes());
            let tree = build(&options);
            check(&tree, &mesh, &rays, &what);
            let stats = tree.stats();
            let most = mesh.len() + mesh.len() / 2;
            assert!(
                (mesh.len()..=most).contains(&stats.references),
                "{what}: {stats}"
            );
            assert_eq!(
                build(&options.clone().with_threads(1)).stats(),
                stats,
                "{what}"
            );

            let limit = mesh.len() + mesh.len() / 50;
            let limited = build(&options.with_max_refs(limit as u64));
            let references = limited.stats().references;
            assert!(
                (mesh.len()..=limit).contains(&references),
                "{what}: {references} of {limit}"
            );
            check(&limited, &mesh, &rays[..10], &what);
        }
    }
}
