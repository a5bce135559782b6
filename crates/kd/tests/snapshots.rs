//! Statistics of every builder on small scenes, as text. A change here is a change of trees: say so in the changelog.

use kd::{BuildOptions, CostModel, KdTree, Method, TreeStats};
use kd_scene::Spd;

fn stats(scene: Spd, size: u32, options: &BuildOptions) -> TreeStats {
    let mesh = scene.generate(size).expect("a small size").mesh;
    KdTree::build(mesh, options).expect("valid options").stats()
}

/// Even and uneven density, axis-aligned and oblique planes, coplanar faces, overlap.
const SCENES: [(Spd, u32); 6] = [
    (Spd::Balls, 1),
    (Spd::Gears, 1),
    (Spd::Mount, 5),
    (Spd::Teapot, 4),
    (Spd::Tetra, 5),
    (Spd::Tree, 2),
];

#[track_caller]
fn check(builder: &str, options: &BuildOptions) {
    for (scene, size) in SCENES {
        let name = format!("{builder}__{}_{size}", scene.name());
        insta::assert_snapshot!(name, stats(scene, size, options));
    }
}

#[test]
fn median() {
    check(
        "median",
        &BuildOptions::balanced().with_method(Method::Median),
    );
}

#[test]
fn fast() {
    check("fast", &BuildOptions::fast());
}

#[test]
fn balanced() {
    check("balanced", &BuildOptions::balanced());
}

#[test]
fn best() {
    check("best", &BuildOptions::best());
}

/// With the constants of the literature, to compare with it.
#[test]
fn exact_15_20() {
    check("exact_15_20", &literature());
}

/// The slow builders have no snapshots of their own: theirs are those of the exact one.
#[test]
fn naive_and_resort_are_exact() {
    for (scene, size) in SCENES {
        let of = |method| stats(scene, size, &literature().with_method(method)).to_string();
        let exact = of(Method::Exact);
        assert_eq!(of(Method::Naive), exact, "{}: naive", scene.name());
        assert_eq!(of(Method::Resort), exact, "{}: resort", scene.name());
    }
}

fn literature() -> BuildOptions {
    BuildOptions::best()
        .with_method(Method::Exact)
        .with_cost(CostModel::CLASSIC)
        .with_small_leaf(6)
        .with_bad_refines(3)
}
