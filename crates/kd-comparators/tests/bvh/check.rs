//! The structures under test, the comparison of their answers with brute force, and the check of a hierarchy's guarantees.

use std::sync::Arc;

use kd_comparators::{Bvh, BvhMethod, BvhNodeView, BvhOptions};
use kd_core::{Aabb, CostModel, Hit, MAX_DEPTH, Mesh, Ray};
use kd_oracle::rays::Rays;
use kd_trace::{Level, RayQuery, WideTree};

/// Every method.
pub(crate) const METHODS: [BvhMethod; 5] = [
    BvhMethod::Sweep,
    BvhMethod::Binned,
    BvhMethod::Midpoint,
    BvhMethod::EqualCounts,
    BvhMethod::BottomUp { radius: 16 },
];

/// Every method, and options that lead to other leaves.
pub(crate) fn option_rows() -> Vec<BvhOptions> {
    let mut rows = METHODS
        .map(|method| BvhOptions::new().with_method(method))
        .to_vec();
    rows.extend([
        BvhOptions::new().with_max_leaf(1),
        BvhOptions::new()
            .with_method(BvhMethod::BottomUp { radius: 1 })
            .with_max_leaf(100)
            .with_cost(CostModel::PACKED),
    ]);
    rows
}

/// A hierarchy over a mesh and its wide form.
pub(crate) struct Pair {
    pub(crate) options: BvhOptions,
    pub(crate) bvh: Bvh,
    pub(crate) wide: WideTree,
}

impl Pair {
    /// Also checks the guarantees of the hierarchy.
    pub(crate) fn new(mesh: &Arc<Mesh>, options: &BvhOptions) -> Self {
        let bvh = Bvh::build(Arc::clone(mesh), options).expect("valid options");
        check_sound(&bvh, options);
        let level = if options.method() == BvhMethod::Sweep {
            Level::portable()
        } else {
            Level::detect()
        };
        Self {
            wide: bvh.wide().with_level(level),
            options: options.clone(),
            bvh,
        }
    }

    /// One for each row of options.
    pub(crate) fn all(mesh: &Arc<Mesh>) -> Vec<Self> {
        let rows = option_rows();
        rows.iter().map(|row| Self::new(mesh, row)).collect()
    }
}

/// Axis and position of the faces of boxes.
pub(crate) fn planes(bvh: &Bvh) -> Vec<(usize, f32)> {
    let faces = bvh.nodes().iter().flat_map(|node| {
        let bounds = node.bounds();
        (0..3).flat_map(move |axis| [(axis, bounds.min[axis]), (axis, bounds.max[axis])])
    });
    faces.collect()
}

/// Rays around a mesh and the boxes of hierarchies over it.
pub(crate) fn rays<'a>(mesh: &'a Mesh, pairs: &[Pair], seed: u64) -> Rays<'a> {
    let faces = pairs.iter().flat_map(|pair| planes(&pair.bvh));
    Rays::new(mesh, faces.collect(), seed)
}

/// Compares every query of hierarchies and of their wide forms with brute force. Returns the number of hits.
#[track_caller]
pub(crate) fn check(name: &str, mesh: &Mesh, pairs: &[Pair], ray: &Ray) -> usize {
    let structures: Vec<&dyn RayQuery<Hit = Hit>> = pairs
        .iter()
        .flat_map(|pair| [&pair.bvh as &dyn RayQuery<Hit = Hit>, &pair.wide])
        .collect();
    kd_oracle::check(name, mesh, &structures, ray)
}

/// Checks the guarantees of a hierarchy: every triangle once, tight boxes, nodes in depth-first order, the limits of depth and of
/// leaves.
#[track_caller]
pub(crate) fn check_sound(bvh: &Bvh, options: &BvhOptions) {
    let mesh = bvh.mesh();
    let mut listed = bvh.triangles().to_vec();
    listed.sort_unstable();
    let all = 0..u32::try_from(mesh.len()).expect("few");
    assert!(all.eq(listed), "each triangle once");
    let mut walk = Walk {
        mesh,
        bvh,
        options,
        triangles: 0,
    };
    let end = if mesh.is_empty() {
        0
    } else {
        walk.node(0, 0).1
    };
    assert_eq!(end as usize, bvh.nodes().len(), "no other nodes");
    assert_eq!(walk.triangles as usize, mesh.len(), "no other triangles");
    assert_eq!(bvh.bounds(), mesh.bounds(), "the box of the mesh");
}

struct Walk<'a> {
    mesh: &'a Mesh,
    bvh: &'a Bvh,
    options: &'a BvhOptions,
    /// Number of triangles in the leaves so far.
    triangles: u32,
}

impl Walk<'_> {
    /// The expected box of a node, and the index after its subtree.
    fn node(&mut self, place: u32, depth: usize) -> (Aabb, u32) {
        assert!(depth <= MAX_DEPTH, "{depth} nodes above");
        let node = self.bvh.nodes()[place as usize];
        let (bounds, end) = match node.view() {
            BvhNodeView::Leaf { first, count } => {
                assert_eq!(first, self.triangles, "leaf after leaf");
                self.triangles += count;
                let triangles = &self.bvh.triangles()[first as usize..][..count as usize];
                assert!(triangles.is_sorted(), "in order: {triangles:?}");
                let most = self.options.max_leaf();
                assert!((1..=most).contains(&count), "{count} triangles of {most}");
                let corners = triangles.iter().flat_map(|t| self.mesh.corners(*t));
                (Aabb::around(corners), place + 1)
            }
            BvhNodeView::Interior { second, .. } => {
                let (lower, end_of_first) = self.node(place + 1, depth + 1);
                assert_eq!(second, end_of_first, "the second child follows");
                let (upper, end) = self.node(second, depth + 1);
                (lower.union(&upper), end)
            }
        };
        assert_eq!(node.bounds(), bounds, "a tight box, node {place}");
        (bounds, end)
    }
}
