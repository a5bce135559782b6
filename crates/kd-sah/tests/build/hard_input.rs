//! Input on which other builders hang, crash or run out of memory: time and memory are bounded, and trees cover the mesh.

use crate::common::soup;
use kd_core::{Aabb, CostModel, Mesh, PrimSource, Tree};
use kd_oracle::effort;
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

/// All presets and methods. `best` is the row of [`Method::Exact`].
fn builders() -> Vec<BuildOptions> {
    let methods = METHODS.map(|method| BuildOptions::best().with_method(method));
    let presets = [BuildOptions::fast(), BuildOptions::balanced()];
    presets.into_iter().chain(methods).collect()
}

/// Whether a builder compares every candidate with every primitive; it gets a few hundred primitives only.
fn is_quadratic(options: &BuildOptions) -> bool {
    *options == options.clone().with_method(Method::Naive)
}

/// Whether a builder ignores costs, and divides until the limit of depth or references is reached.
fn is_median(options: &BuildOptions) -> bool {
    *options == options.clone().with_method(Method::Median)
}

/// Whether a builder sorts events: six per primitive, which takes seconds for millions of primitives.
fn is_sorting(options: &BuildOptions) -> bool {
    [Method::Resort, Method::Sweep]
        .into_iter()
        .any(|method| *options == options.clone().with_method(method))
}

/// Builds a tree, and checks its depth, its number of references and its coverage.
#[track_caller]
fn built(mesh: &Mesh, options: &BuildOptions) -> Tree {
    let tree = build(mesh, options).expect("a mesh has a tree");
    assert!(tree.depth() <= 48, "{options:?}: depth {}", tree.depth());
    let references = tree.stats().references;
    assert!(
        references <= 64 * mesh.len(),
        "{options:?}: {references} references for {} triangles",
        mesh.len()
    );
    tree.check_coverage(mesh).expect("the tree covers the mesh");
    tree
}

#[test]
fn an_empty_mesh_gives_one_empty_leaf() {
    for options in builders() {
        let stats = built(&soup(&[]), &options).stats();
        assert_eq!((stats.nodes, stats.empty_leaves), (1, 1), "{options:?}");
    }
}

#[test]
fn one_triangle_of_any_shape_is_kept() {
    let point = [[1.0, 2.0, 3.0]; 3];
    let line = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]];
    let flat = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]];
    let huge = [[-3e38, -3e38, 0.0], [3e38, -3e38, 1.0], [0.0, 3e38, -1.0]];
    let tiny = [[0.0, 0.0, 0.0], [1e-45, 0.0, 0.0], [0.0, 1e-45, 1e-45]];
    for triangle in [point, line, flat, huge, tiny] {
        for options in builders() {
            let stats = built(&soup(&[triangle]), &options).stats();
            assert!(stats.references >= 1, "{options:?} lost {triangle:?}");
            assert!(
                stats.sah_cost_own.is_finite(),
                "{options:?} {triangle:?}: {stats}"
            );
        }
    }
}

/// A mesh of `count` copies of a triangle, which share their corners.
fn copies(triangle: [[f32; 3]; 3], count: usize) -> Mesh {
    Mesh::new(triangle.into(), vec![[0, 1, 2]; count]).expect("valid")
}

/// Ten million, or one in the short form.
const MILLIONS: usize = effort::count(1_000_000, 10_000_000);

/// Checks that copies of a triangle give one leaf: no plane separates two of them.
#[track_caller]
fn check_one_leaf(triangle: [[f32; 3]; 3], count: usize, is_meant: impl Fn(&BuildOptions) -> bool) {
    let mesh = copies(triangle, count);
    for options in builders().into_iter().filter(is_meant) {
        let stats = build(&mesh, &options).expect("a tree").stats();
        assert_eq!(
            (stats.nodes, stats.references),
            (1, count),
            "{options:?}: {stats}"
        );
    }
}

/// Builders that sort events get a tenth of the triangles: ten million take them longer than seconds.
#[test]
fn a_million_identical_triangles_are_one_leaf() {
    check_one_leaf(TILTED, 1_000_000, is_sorting);
}

#[test]
fn millions_of_identical_triangles_are_one_leaf() {
    check_one_leaf(TILTED, MILLIONS, |options| {
        !(is_sorting(options) || is_quadratic(options) || is_median(options))
    });
}

#[test]
fn ten_thousand_identical_triangles_are_one_leaf_for_quadratic_builders() {
    check_one_leaf(TILTED, 10_000, is_quadratic);
}

/// The median builder divides identical triangles until it reaches the limit of references.
#[test]
fn millions_of_identical_triangles_stay_within_the_limit_of_references() {
    let mesh = copies(TILTED, MILLIONS);
    let median = BuildOptions::best()
        .with_method(Method::Median)
        .with_max_refs(5 * MILLIONS as u64 / 2);
    let stats = build(&mesh, &median).expect("a tree").stats();
    let allowed = MILLIONS + 1..=5 * MILLIONS / 2;
    assert!(allowed.contains(&stats.references), "{stats}");
    assert!(stats.limited_cells > 0, "limited cells: {stats}");
}

/// The median builder ignores costs; only the limit of references stops it.
#[test]
fn references_to_identical_triangles_are_limited() {
    let mesh = soup(&vec![TILTED; 20_000]);
    let median = BuildOptions::best().with_method(Method::Median);
    for (max_refs, options) in [
        (64 * 20_000, median.clone()),
        (60_000, median.with_max_refs(60_000)),
    ] {
        let references = build(&mesh, &options).expect("a tree").stats().references;
        assert!(
            references <= max_refs,
            "{references} references, at most {max_refs} allowed"
        );
    }
}

const TILTED: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.2], [0.3, 1.0, 0.5]];

#[test]
fn a_million_points_in_one_place_are_one_leaf() {
    check_one_leaf([[1.0, 1.0, 1.0]; 3], 1_000_000, |options| {
        !is_quadratic(options)
    });
}

/// Builders that divide by centroids do not terminate on this input.
#[test]
fn concentric_triangles_are_bounded() {
    let around_zero = |i: u16| {
        let s = 1.0 + f32::from(i);
        [
            [-s, -s, 0.25 * s],
            [s, -s, 0.5 * s],
            [0.0, 2.0 * s, -0.75 * s],
        ]
    };
    let mesh = |count: u16| soup(&(0..count).map(around_zero).collect::<Vec<_>>());
    let (few, many) = (mesh(100), mesh(3_000));
    let mut divided = 0;
    for options in builders() {
        let mesh = if is_quadratic(&options) { &few } else { &many };
        divided += usize::from(built(mesh, &options).stats().leaves > 1);
    }
    assert!(divided > 0, "no builder divides the mesh");
}

#[test]
fn coplanar_triangles_are_divided_within_their_plane() {
    let cell = |x: f32, y: f32| [[x, y, 7.0], [x + 1.0, y, 7.0], [x, y + 1.0, 7.0]];
    let triangles: Vec<_> = (0_u8..20)
        .flat_map(|x| (0_u8..20).map(move |y| cell(f32::from(x), f32::from(y))))
        .collect();
    let mesh = soup(&triangles);
    for options in builders() {
        // A model with blocks of eight triangles would stop earlier.
        let options = options.with_cost(CostModel::CLASSIC);
        let stats = built(&mesh, &options).stats();
        assert!(stats.leaves > 50, "{options:?}: too few leaves: {stats}");
    }
}

/// Slivers across the whole box, each of which straddles nearly every plane.
#[test]
fn slivers_stay_within_the_limit_of_references() {
    let slivers = |count: u16| {
        let sliver = |i: u16| {
            let s = f32::from(i) / f32::from(count);
            [
                [-1.0, s, 1.0 - s],
                [1.0, 1.0 - s, s],
                [1.0, 1.0 - s + 1e-4, s],
            ]
        };
        soup(&(0..count).map(sliver).collect::<Vec<_>>())
    };
    let (few, many) = (slivers(100), slivers(2_000));
    for options in builders() {
        let mesh = if is_quadratic(&options) { &few } else { &many };
        let count = mesh.len() as u64;
        built(mesh, &options);
        for max_refs in [0, 3 * count / 2, 10 * count] {
            let tree = built(mesh, &options.clone().with_max_refs(max_refs));
            let references = tree.stats().references as u64;
            assert!(
                references <= max_refs.max(count),
                "{options:?}: {references} references, at most {max_refs} allowed"
            );
        }
    }
}

fn clipped_box(shape: &Aabb, cell: &Aabb) -> Option<Aabb> {
    let clipped = shape.intersection(cell);
    (!clipped.is_empty()).then_some(clipped)
}

/// Small boxes on a lattice of 256 points per side, computed on demand.
struct Lattice {
    count: u32,
}

impl PrimSource for Lattice {
    type Shape = Aabb;

    fn count(&self) -> u32 {
        self.count
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        let [x, y, z, _] = primitive.to_le_bytes();
        let corner = [x, y, z].map(f32::from);
        Aabb::around([corner.into(), corner.map(|x| x + 0.75).into()])
    }

    fn shape(&self, primitive: u32) -> Aabb {
        self.bounds(primitive)
    }

    fn clipped_bounds(&self, shape: &Aabb, cell: &Aabb) -> Option<Aabb> {
        clipped_box(shape, cell)
    }
}

/// Sixteen million primitives, divided once: every pass over all primitives runs, binned and exact, and no counter
/// overflows. Lower levels are covered by smaller meshes. (Only the presets run, since each build takes seconds.)
#[test]
fn millions_of_primitives_can_be_divided() {
    const COUNT: u32 = effort::cases(1 << 20, 1 << 24);
    let source = Lattice { count: COUNT };
    for options in [
        BuildOptions::fast(),
        BuildOptions::balanced(),
        BuildOptions::best(),
    ] {
        let options = options.with_max_depth(1);
        let stats = build(&source, &options).expect("a tree").stats();
        assert_eq!((stats.leaves, stats.depth), (2, 1), "{options:?}: {stats}");
        // Boxes are smaller than their distance, so at most one layer of boxes straddles the plane.
        let references = COUNT as usize..=COUNT as usize + (1 << 16);
        assert!(
            references.contains(&stats.references),
            "{options:?}: {stats}"
        );
    }
}

#[test]
fn too_many_primitives_are_refused_before_allocation() {
    let source = Lattice { count: u32::MAX };
    for options in builders() {
        let error = build(&source, &options).err();
        let expected = BuildError::TooManyPrimitives {
            primitives: u32::MAX,
        };
        assert_eq!(error, Some(expected), "{options:?}");
    }
}

#[cfg(feature = "parallel")]
#[test]
fn too_many_threads_are_refused() {
    let options = BuildOptions::best().with_threads(usize::MAX);
    let error = build(&soup(&[TILTED]), &options).expect_err("far too many");
    assert!(
        matches!(&error, BuildError::Threads(why) if why.threads == usize::MAX),
        "{error:?}"
    );
}

/// A source of boxes, which may be invalid.
struct BoxSource(Vec<Aabb>);

impl PrimSource for BoxSource {
    type Shape = Aabb;

    fn count(&self) -> u32 {
        u32::try_from(self.0.len()).expect("few")
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        self.0[primitive as usize]
    }

    fn shape(&self, primitive: u32) -> Aabb {
        self.bounds(primitive)
    }

    fn clipped_bounds(&self, shape: &Aabb, cell: &Aabb) -> Option<Aabb> {
        clipped_box(shape, cell)
    }
}

#[test]
fn sources_with_invalid_boxes_are_refused() {
    let good = Aabb::around([[0.0; 3].into(), [1.0; 3].into()]);
    let row = (0_u8..8).map(|i| Aabb {
        min: good.min + 3.0 * f32::from(i),
        max: good.max + 3.0 * f32::from(i),
    });
    let classic = BuildOptions::best().with_cost(CostModel::CLASSIC);
    let tree = build(&BoxSource(row.collect()), &classic).expect("eight boxes");
    assert_eq!(tree.stats().references, 8, "one reference per box");
    assert!(tree.stats().leaves > 4, "planes separate the boxes");
    let mut infinite = good;
    infinite.max.y = f32::INFINITY;
    let mut with_nan = good;
    with_nan.min.x = f32::NAN;
    for bad in [Aabb::EMPTY, infinite, with_nan] {
        let error = build(&BoxSource(vec![good, bad]), &BuildOptions::best()).err();
        assert_eq!(
            error,
            Some(BuildError::NotFinite { primitive: 1 }),
            "{bad:?}"
        );
    }
}
