//! Input that has hung, crashed or exhausted other builders: bounded time and memory, and nothing lost.

mod common;

use common::soup;
use kd_core::{Aabb, Mesh, PrimSource, Tree};
use kd_sah::{BuildError, BuildOptions, Method, build};

const METHODS: [Method; 9] = [
    Method::Median,
    Method::Naive,
    Method::Resort,
    Method::Sweep,
    Method::Exact,
    Method::Binned { bins: 32 },
    Method::Sampled { all_axes: false },
    Method::Sampled { all_axes: true },
    Method::Hybrid {
        bins: 16,
        exact_below: 32,
    },
];

#[track_caller]
fn built(mesh: &Mesh, method: Method) -> Tree {
    let tree = build(mesh, &BuildOptions::best().with_method(method)).expect("a mesh has a tree");
    assert!(tree.depth() <= 48, "{method:?}: depth {}", tree.depth());
    tree.check_coverage(mesh).expect("nothing is missing");
    tree
}

#[test]
fn nothing_gives_one_empty_leaf() {
    for method in METHODS {
        let stats = built(&soup(&[]), method).stats();
        assert_eq!((stats.nodes, stats.empty_leaves), (1, 1), "{method:?}");
    }
}

#[test]
fn one_triangle_of_any_kind() {
    let point = [[1.0, 2.0, 3.0]; 3];
    let line = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]];
    let flat = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]];
    let huge = [[-3e38, -3e38, 0.0], [3e38, -3e38, 1.0], [0.0, 3e38, -1.0]];
    let tiny = [[0.0, 0.0, 0.0], [1e-45, 0.0, 0.0], [0.0, 1e-45, 1e-45]];
    for triangle in [point, line, flat, huge, tiny] {
        for method in METHODS {
            let stats = built(&soup(&[triangle]), method).stats();
            assert!(stats.references >= 1, "{method:?} lost {triangle:?}");
            assert!(
                stats.sah_cost_own.is_finite(),
                "{method:?} {triangle:?}: {stats}"
            );
        }
    }
}

/// A plane can separate no two of them, so they stay one leaf, and every sweep ends at the root.
#[test]
fn a_million_identical_triangles_are_one_leaf() {
    let mesh = soup(&vec![TILTED; 1_000_000]);
    let all_but_slow = METHODS
        .into_iter()
        .filter(|method| !matches!(method, Method::Median | Method::Naive));
    for method in all_but_slow {
        let stats = build(&mesh, &BuildOptions::best().with_method(method))
            .expect("a tree")
            .stats();
        assert_eq!(
            (stats.nodes, stats.references),
            (1, 1_000_000),
            "{method:?}: {stats}"
        );
    }
}

/// The median builder does not ask what a plane is worth; only the limit of references stops it.
#[test]
fn identical_triangles_do_not_multiply_without_end() {
    let mesh = soup(&vec![TILTED; 20_000]);
    let median = BuildOptions::best().with_method(Method::Median);
    for (max_refs, options) in [
        (64 * 20_000, median.clone()),
        (60_000, median.with_max_refs(60_000)),
    ] {
        let references = build(&mesh, &options).expect("a tree").stats().references;
        assert!(references <= max_refs, "{references} of at most {max_refs}");
    }
}

const TILTED: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.2], [0.3, 1.0, 0.5]];

#[test]
fn a_million_points_in_one_place_are_one_leaf() {
    let mesh = soup(&vec![[[1.0, 1.0, 1.0]; 3]; 1_000_000]);
    for method in METHODS
        .into_iter()
        .filter(|&method| method != Method::Naive)
    {
        let tree = build(&mesh, &BuildOptions::best().with_method(method)).expect("a tree");
        let stats = tree.stats();
        assert_eq!(
            (stats.nodes, stats.references),
            (1, 1_000_000),
            "{method:?}: {stats}"
        );
    }
}

#[test]
fn everything_in_one_plane_is_divided_within_it() {
    let cell = |x: f32, y: f32| [[x, y, 7.0], [x + 1.0, y, 7.0], [x, y + 1.0, 7.0]];
    let triangles: Vec<_> = (0_u8..20)
        .flat_map(|x| (0_u8..20).map(move |y| cell(f32::from(x), f32::from(y))))
        .collect();
    let mesh = soup(&triangles);
    for method in METHODS {
        let stats = built(&mesh, method).stats();
        assert!(
            stats.leaves > 50,
            "{method:?} divides along the plane: {stats}"
        );
    }
}

/// Slivers across the whole box, each straddling nearly every plane.
#[test]
fn slivers_stay_within_the_limit_of_references() {
    let sliver = |i: u16| {
        let s = f32::from(i) / 2000.0;
        [
            [-1.0, s, 1.0 - s],
            [1.0, 1.0 - s, s],
            [1.0, 1.0 - s + 1e-4, s],
        ]
    };
    let mesh = soup(&(0..2000).map(sliver).collect::<Vec<_>>());
    for max_refs in [0, 3_000, 20_000] {
        let options = BuildOptions::best().with_max_refs(max_refs);
        let tree = build(&mesh, &options).expect("a tree");
        tree.check_coverage(&mesh).expect("nothing is missing");
        let references = tree.stats().references as u64;
        assert!(
            references <= max_refs.max(2000),
            "{references} of at most {max_refs}"
        );
        let median = build(&mesh, &options.with_method(Method::Median)).expect("a tree");
        assert!(
            median.stats().references as u64 <= max_refs.max(2000),
            "median too"
        );
    }
}

/// A source need not be a mesh, and may lie.
struct Boxes(Vec<Aabb>);

impl PrimSource for Boxes {
    fn count(&self) -> u32 {
        u32::try_from(self.0.len()).expect("few")
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        self.0[primitive as usize]
    }

    fn clipped_bounds(&self, primitive: u32, cell: &Aabb) -> Option<Aabb> {
        let part = self.bounds(primitive).intersection(cell);
        (!part.is_empty()).then_some(part)
    }
}

#[test]
fn sources_are_checked() {
    let good = Aabb::around([[0.0; 3].into(), [1.0; 3].into()]);
    let row = (0_u8..8).map(|i| Aabb {
        min: good.min + 3.0 * f32::from(i),
        max: good.max + 3.0 * f32::from(i),
    });
    let tree = build(&Boxes(row.collect()), &BuildOptions::best()).expect("eight boxes");
    assert_eq!(
        tree.stats().references,
        8,
        "each in its own leaf or beside its neighbour"
    );
    assert!(tree.stats().leaves > 4, "told apart");
    let mut infinite = good;
    infinite.max.y = f32::INFINITY;
    let mut not_a_number = good;
    not_a_number.min.x = f32::NAN;
    for bad in [Aabb::EMPTY, infinite, not_a_number] {
        let error = build(&Boxes(vec![good, bad]), &BuildOptions::best()).err();
        assert_eq!(
            error,
            Some(BuildError::NotFinite { primitive: 1 }),
            "{bad:?}"
        );
    }
}
