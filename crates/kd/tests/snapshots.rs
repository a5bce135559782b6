//! Statistics of every builder on small scenes, as text. A change here is a change of trees: say so in the changelog.

use kd::tree::StatsOf;
use kd::{BuildOptions, CostModel, KdTree, Method};
use kd_scene::Spd;

/// Of what rays traverse, and of the kd-tree if that is something else.
fn stats(scene: Spd, size: u32, options: &BuildOptions) -> String {
    let mesh = scene.generate(size).expect("a small size").mesh;
    let tree = KdTree::build(mesh, options).expect("valid options");
    let traversed = tree.stats();
    match traversed.of {
        StatsOf::KdTree => traversed.to_string(),
        StatsOf::WideNodes => {
            let kd_tree = tree.kd_tree().expect("within limits");
            format!("{traversed}\n{}", kd_tree.stats())
        }
    }
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
    // Leaves of one block: costs alone do not end this builder.
    check("median", &by(Method::Median).with_small_leaf(8));
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

#[test]
fn binned() {
    check("binned", &by(Method::Binned { bins: 32 }));
}

#[test]
fn sampled() {
    check("sampled", &by(Method::Sampled { all_axes: true }));
}

/// Coarser above and exact further up than any preset.
#[test]
fn hybrid() {
    let method = Method::Hybrid {
        bins: 16,
        exact_below: 256,
    };
    check("hybrid", &by(method));
}

fn by(method: Method) -> BuildOptions {
    BuildOptions::best().with_method(method)
}

/// With the constants of the literature, to compare with it.
#[test]
fn exact_15_20() {
    check("exact_15_20", &literature());
}

/// The slow builders have no snapshots of their own: theirs are those of the exact one.
#[test]
fn slow_builders_are_exact() {
    for (scene, size) in SCENES {
        let of = |method| stats(scene, size, &literature().with_method(method));
        let exact = of(Method::Exact);
        assert_eq!(of(Method::Naive), exact, "{}: naive", scene.name());
        assert_eq!(of(Method::Resort), exact, "{}: resort", scene.name());
        assert_eq!(of(Method::Sweep), exact, "{}: sweep", scene.name());
    }
}

fn literature() -> BuildOptions {
    BuildOptions::best()
        .with_method(Method::Exact)
        .with_cost(CostModel::CLASSIC)
        .with_small_leaf(6)
        .with_bad_refines(3)
}
