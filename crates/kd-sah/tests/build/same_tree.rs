//! Exact builders give the same tree, and trees do not depend on the number of threads.

use kd_core::{CostModel, Mesh, Tree};
use kd_oracle::effort;
use kd_sah::{BuildOptions, Method, build};
use kd_scene::Spd;
use proptest::prelude::*;

/// Asserts that two trees are equal bit for bit, and reports the first difference.
#[track_caller]
fn assert_same(a: &Tree, b: &Tree, what: &str) {
    let differs = a.nodes().iter().zip(b.nodes()).position(|(a, b)| a != b);
    if let Some(at) = differs {
        panic!(
            "{what}: node {at} is {:?} or {:?}",
            a.nodes()[at].view(),
            b.nodes()[at].view()
        );
    }
    assert_eq!(a.nodes().len(), b.nodes().len(), "{what}: number of nodes");
    assert!(a.refs() == b.refs(), "{what}: references differ");
    assert_eq!(a.bounds(), b.bounds(), "{what}: bounds");
}

#[track_caller]
fn check_same_tree(mesh: &Mesh, options: &BuildOptions) -> Tree {
    let by = |method| build(mesh, &options.clone().with_method(method)).expect("valid options");
    let naive = by(Method::Naive);
    assert_same(&naive, &by(Method::Resort), "naive and resort");
    assert_same(&naive, &by(Method::Sweep), "naive and sweep");
    assert_same(&naive, &by(Method::Exact), "naive and exact");
    naive
        .check_coverage(mesh)
        .expect("the tree covers the mesh");
    naive
}

/// A row for each option that affects planes or leaves.
fn option_rows() -> Vec<BuildOptions> {
    let packed = CostModel {
        traverse: 1.0,
        intersect: 0.1,
        lanes: 8,
        empty_bonus: 0.8,
    };
    vec![
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
        BuildOptions::best().with_cost(packed),
        BuildOptions::best()
            .with_retraction(false)
            .with_bad_refines(8),
        BuildOptions::best().with_max_depth(5),
        BuildOptions::best().with_max_refs(40),
        BuildOptions::best().with_cost(CostModel {
            empty_bonus: 1.0,
            ..CostModel::CLASSIC
        }),
        BuildOptions::best().with_cost(CostModel::CLASSIC),
        BuildOptions::best().with_longest_axis(true),
        BuildOptions::best()
            .with_longest_axis(true)
            .with_cost(CostModel::CLASSIC),
        BuildOptions::best().with_median_levels(2),
    ]
}

#[test]
fn slow_and_fast_builders_agree_on_scenes() {
    let mut differing = 0;
    for (scene, size) in [
        (Spd::Balls, 1),
        (Spd::Gears, 1),
        (Spd::Mount, 5),
        (Spd::Teapot, 3),
        (Spd::Tetra, 5),
        (Spd::Jacks, 2),
        (Spd::Sombrero, 1),
    ] {
        let mesh = scene.generate(size).expect("a small size").mesh;
        let name = scene.name();
        assert!(mesh.len() > 50, "{name}: {} triangles", mesh.len());
        assert!(mesh.len() < 3500, "{name}: O(N²) for {}", mesh.len());
        let best = check_same_tree(&mesh, &BuildOptions::best());
        let longest = BuildOptions::best().with_longest_axis(true);
        let longest = check_same_tree(&mesh, &longest);
        for tree in [&best, &longest] {
            let depth = tree.depth();
            assert!(depth > 6, "{name}: depth {depth} is too small to compare");
        }
        differing += usize::from(best.nodes() != longest.nodes());
    }
    // The trees do not differ where all cells are cubes, as in `tetra`.
    assert!(
        differing >= 3,
        "the longest axis gives another tree in only {differing} scenes"
    );
}

#[test]
fn trees_do_not_depend_on_the_number_of_threads() {
    let mesh = Spd::Lattice
        .generate(if effort::IS_LONG { 4 } else { 3 })
        .expect("a small size")
        .mesh;
    assert!(
        mesh.len() > 10_000,
        "{} triangles are too few for several tasks",
        mesh.len()
    );
    let limited_refs = BuildOptions::best().with_max_refs(3 * mesh.len() as u64 / 2);
    let methods = [
        Method::Median,
        Method::Sweep,
        Method::Binned { bins: 32 },
        Method::Sampled { all_axes: false },
        Method::Sampled { all_axes: true },
        Method::Hybrid {
            bins: 16,
            exact_below: 100,
        },
    ]
    .map(|method| BuildOptions::fast().with_method(method));
    // Levels of median splits above each preset.
    let with_median_levels = [
        BuildOptions::fast().with_median_levels(1),
        BuildOptions::balanced().with_median_levels(3),
        BuildOptions::best().with_median_levels(5),
    ];
    for options in option_rows()
        .into_iter()
        .chain([limited_refs])
        .chain(methods)
        .chain(with_median_levels)
    {
        let with =
            |threads| build(&mesh, &options.clone().with_threads(threads)).expect("valid options");
        let alone = with(1);
        for threads in [0, 2, 3, 8] {
            assert_same(
                &alone,
                &with(threads),
                &format!("{threads} threads, {options:?}"),
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(effort::cases(60, 200)))]

    #[test]
    fn slow_and_fast_builders_agree_on_degenerate_meshes(mesh in crate::common::mesh(60), row in 0..option_rows().len()) {
        check_same_tree(&mesh, &option_rows()[row]);
    }

    #[test]
    fn approximate_builders_cover_the_mesh(mesh in crate::common::mesh(150), small_leaf in 0_u32..4, method in 0_usize..4) {
        let methods = [
            Method::Median,
            Method::Binned { bins: 7 },
            Method::Sampled { all_axes: false },
            Method::Hybrid { bins: 32, exact_below: 20 },
        ];
        let options = BuildOptions::balanced().with_method(methods[method]).with_small_leaf(small_leaf);
        let tree = build(&mesh, &options).expect("valid options");
        prop_assert_eq!(tree.check_coverage(&mesh), Ok(()));
    }
}
