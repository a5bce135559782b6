//! The limit of references: trees stay within it, report it, cover the mesh, and do not depend on the number of threads.

use kd_core::{Mesh, Tree};
use kd_sah::{BuildOptions, Method, build};
use kd_scene::Spd;

fn builders() -> [BuildOptions; 7] {
    let by = |method| BuildOptions::best().with_method(method);
    [
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
        by(Method::Binned { bins: 32 }),
        by(Method::Sampled { all_axes: false }),
        by(Method::Sampled { all_axes: true }),
        by(Method::Sweep),
    ]
}

fn scenes() -> [(&'static str, Mesh); 3] {
    [(Spd::Teapot, 6), (Spd::Gears, 2), (Spd::Jacks, 2)].map(|(scene, size)| {
        let mesh = scene.generate(size).expect("a small size").mesh;
        let (name, count) = (scene.name(), mesh.len());
        assert!(
            count > 2_000,
            "{name}: {count} triangles are too few for two tasks"
        );
        (name, mesh)
    })
}

/// Builds with a limit on 1, 2 and 5 threads, and checks the tree.
#[track_caller]
fn check(mesh: &Mesh, options: &BuildOptions, max_refs: u64, what: &str) -> Tree {
    let options = options.clone().with_max_refs(max_refs);
    let on = |threads| build(mesh, &options.clone().with_threads(threads)).expect("a tree");
    let tree = on(1);
    let references = tree.stats().references as u64;
    assert!(
        references <= max_refs.max(mesh.len() as u64),
        "{what}: {references} references, at most {max_refs} allowed"
    );
    tree.check_coverage(mesh).expect(what);
    for threads in [2, 5] {
        let other = on(threads);
        assert!(
            tree.nodes() == other.nodes() && tree.refs() == other.refs(),
            "{what}: another tree on {threads} threads"
        );
        assert_eq!(
            tree.limited_cells(),
            other.limited_cells(),
            "{what}: on {threads} threads"
        );
    }
    tree
}

#[test]
fn trees_stay_within_the_limit_and_report_it() {
    for (name, mesh) in scenes() {
        for options in builders() {
            let what = |limit: &str| format!("{name}, limit {limit}, {options:?}");
            let free = check(&mesh, &options, u64::MAX, &what("none"));
            // The default limit of 64 per primitive is reached only where sampling misses that a plane separates nothing
            // (gears).
            let by_default = build(&mesh, &options).expect("a tree");
            assert_eq!(
                free.nodes() == by_default.nodes(),
                by_default.limited_cells() == 0,
                "{}: the default tree, unless the default limit was reached",
                what("none")
            );
            assert_eq!(free.limited_cells(), 0, "{}", what("none"));
            let needed = free.stats().references as u64;
            let count = mesh.len() as u64;
            assert!(
                needed > count,
                "{}: no more references than triangles",
                what("none")
            );
            // Limits of 0 and `count` both leave one reference per triangle; the third allows half of the others.
            for limit in [0, count, u64::midpoint(count, needed)] {
                let what = what(&limit.to_string());
                let stats = check(&mesh, &options, limit, &what).stats();
                assert!(stats.limited_cells > 0, "{what}: {stats}");
                assert!(
                    stats.to_string().contains("cells limited"),
                    "{what}: {stats}"
                );
                assert!(stats.references as u64 <= needed, "{what}: {stats}");
            }
        }
    }
}

/// With one reference per triangle, only planes that no triangle straddles are possible, and the builders use them.
#[test]
fn refinement_continues_where_it_needs_no_references() {
    for options in builders() {
        // Twelve separate groups along a line.
        let group = |at: f32| {
            let corner = move |x: f32, y: f32| [10.0 * at + x, y, x * y];
            (0_u8..40)
                .map(f32::from)
                .flat_map(move |i| [corner(0.0, i), corner(1.0, i), corner(0.5, i + 0.5)])
        };
        let positions: Vec<_> = (0_u8..12).map(f32::from).flat_map(group).collect();
        let indices = (0..480).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(positions, indices).expect("valid");
        let what = format!("{options:?}");
        let stats = check(&mesh, &options, 0, &what).stats();
        assert_eq!(stats.references, 480, "{what}: {stats}");
        assert!(stats.leaves >= 12, "{what}: {stats}");
    }
}
