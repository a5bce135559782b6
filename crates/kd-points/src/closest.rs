//! The closest point: nodes from near to far, as long as they may have a closer triangle.

use arrayvec::ArrayVec;
use glam::Vec3;
use kd_core::{MAX_DEPTH, NodeIndex};
use kd_simd::{F32x8 as _, LANES, Mask as _, Number as _, Simd, Task};
use kd_trace::PackedTree;
use kd_wide::{Block, Child, MAX_LEVELS, WIDTH, WideTree};

use crate::decision::Foot;
use crate::nearest::Nearest;
use crate::reach::{Reach, ReachLanes};
use crate::tree::PointTree;
use crate::triangles::Estimates;

/// All but one of the children on each level of a path, and those of one more node.
const MOST_PENDING: usize = MAX_LEVELS * (WIDTH - 1) + WIDTH;

/// A triangle, by its slot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    slot: u32,
    corners: [Vec3; 3],
}

/// The closest triangle so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Best {
    point: Vec3,
    /// Its squared distance, or that of the limit.
    squared: f64,
    triangle: Option<(Candidate, Foot)>,
}

impl Best {
    /// None yet. `None` if there can be none: the point is not finite, or the limit is negative or NaN.
    pub(crate) fn new(point: Vec3, max_distance: f32) -> Option<Self> {
        let most = f64::from(max_distance);
        (point.is_finite() && most >= 0.0).then_some(Self {
            point,
            squared: most * most,
            triangle: None,
        })
    }

    /// Takes a triangle that is closer, or as close and lower.
    #[inline(always)]
    pub(crate) fn take(&mut self, candidate: Candidate) -> bool {
        let foot = Foot::new(self.point, candidate.corners);
        let is_lower = || self.slot().is_none_or(|slot| candidate.slot < slot);
        let is_better = foot.squared < self.squared || (foot.squared == self.squared && is_lower());
        if is_better {
            self.squared = foot.squared;
            self.triangle = Some((candidate, foot));
        }
        is_better
    }

    #[inline(always)]
    fn slot(&self) -> Option<u32> {
        self.triangle.map(|(candidate, _)| candidate.slot)
    }

    pub(crate) fn triangle(&self) -> Option<Candidate> {
        self.triangle.map(|(candidate, _)| candidate)
    }

    pub(crate) fn nearest(&self) -> Option<Nearest> {
        let (Candidate { slot, corners }, foot) = self.triangle?;
        Some(foot.answer(corners, slot))
    }

    /// Looks for a closer triangle in a tree.
    pub(crate) fn improve(&mut self, tree: PointTree<'_>) {
        let bounds = tree.bounds();
        if bounds.is_empty() {
            return;
        }
        let reach = Reach::new(self.point, &bounds);
        tree.level().run(Improve {
            tree,
            reach,
            best: self,
        });
    }
}

struct Improve<'a> {
    tree: PointTree<'a>,
    reach: Reach,
    best: &'a mut Best,
}

impl<S: Simd> Task<S> for Improve<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let search = Search {
            simd,
            reach: self.reach,
            lanes: self.reach.lanes(simd),
            limit: self.reach.limit(self.best.squared),
            best: self.best,
        };
        match self.tree {
            PointTree::Wide(tree) => search.in_wide(tree),
            PointTree::Packed(tree) => search.in_packed(tree),
        }
    }
}

/// A search in one tree.
struct Search<'a, S: Simd> {
    simd: S,
    reach: Reach,
    lanes: ReachLanes<S::F32>,
    /// Squared, in scaled units: what is certainly further away is of no interest.
    limit: f32,
    best: &'a mut Best,
}

/// A child to visit later, and the squared distance of its box.
#[derive(Clone, Copy, Debug)]
struct Pending {
    squared: f32,
    child: Child,
}

/// A cell of a kd-tree to visit later.
#[derive(Clone, Copy, Debug)]
struct PendingCell {
    node: NodeIndex,
    /// How far the point is outside of the cell along each axis.
    outside: [f64; 3],
}

impl<S: Simd> Search<'_, S> {
    #[inline(always)]
    fn in_wide(mut self, tree: &WideTree) {
        let (nodes, blocks) = (tree.nodes(), tree.blocks());
        let mut pending = ArrayVec::<Pending, MOST_PENDING>::new();
        let mut child = tree.root();
        loop {
            if child.is_leaf() {
                for block in &blocks[child.blocks()] {
                    self.visit(block);
                }
            } else {
                let node = &nodes[child.index()];
                let lanes = self.lanes.squared_distances(self.simd, &node.faces);
                let mut met = lanes.le(self.simd.splat(self.limit)).bits();
                let mut squares = [0.0; LANES];
                lanes.store(&mut squares);
                let first = pending.len();
                while met != 0 {
                    let lane = met.trailing_zeros() as usize;
                    met &= met - 1;
                    let squared = squares[lane];
                    // The nearest last. Few, and most lanes are far.
                    let mut at = pending.len();
                    pending.push(Pending {
                        squared,
                        child: node.children[lane],
                    });
                    while at > first && pending[at - 1].squared < squared {
                        pending.swap(at - 1, at);
                        at -= 1;
                    }
                }
            }
            loop {
                let Some(next) = pending.pop() else {
                    return;
                };
                if next.squared <= self.limit {
                    child = next.child;
                    break;
                }
            }
        }
    }

    /// Cells by the distances of the point along the axes, updated at each plane (S. Arya and D. Mount, *Algorithms for Fast Vector
    /// Quantization*, 1993).
    #[inline(always)]
    fn in_packed(mut self, tree: &PackedTree) {
        let nodes = tree.nodes();
        let bounds = tree.bounds();
        let point = self.best.point.as_dvec3().to_array();
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3().to_array());
        let outside = [0, 1, 2].map(|axis: usize| {
            let before = min[axis] - point[axis];
            before.max(point[axis] - max[axis]).max(0.0)
        });
        let mut pending = ArrayVec::<PendingCell, { MAX_DEPTH + 1 }>::new();
        pending.push(PendingCell {
            node: tree.root(),
            outside,
        });
        while let Some(PendingCell { node, outside }) = pending.pop() {
            let limit = self.reach.limit_unscaled(self.best.squared);
            if squared_length(outside) > limit {
                continue;
            }
            let mut node = nodes[node.index()];
            while !node.is_leaf() {
                let axis = node.tag();
                let beyond = point[axis] - f64::from(node.split());
                let near = usize::from(beyond > 0.0);
                let first = node.first_child();
                let children = [first, first.sibling()];
                let mut far = outside;
                far[axis] = beyond.abs();
                if squared_length(far) <= limit {
                    pending.push(PendingCell {
                        node: children[near ^ 1],
                        outside: far,
                    });
                }
                node = nodes[children[near].index()];
            }
            for block in tree.blocks_of(node) {
                self.visit(block);
            }
        }
    }

    /// Decides the triangles of a block that may be closer, those that seem the closest first.
    #[inline(always)]
    fn visit(&mut self, block: &Block) {
        let estimates = Estimates::new(self.simd, &self.lanes, block);
        let mut left = estimates.within(self.simd, self.limit);
        if left == 0 {
            return;
        }
        let squares = estimates.squares();
        while left != 0 {
            let mut lane = left.trailing_zeros() as usize;
            let mut others = left & (left - 1);
            while others != 0 {
                let other = others.trailing_zeros() as usize;
                others &= others - 1;
                if squares[other] < squares[lane] {
                    lane = other;
                }
            }
            left &= !(1 << lane);
            let slot = block.triangles[lane];
            // The triangle that a search begins with, or one that is in several leaves.
            if self.best.slot() == Some(slot) {
                continue;
            }
            let candidate = Candidate {
                slot,
                corners: block.corners_of(lane),
            };
            if self.best.take(candidate) {
                self.limit = self.reach.limit(self.best.squared);
                left &= estimates.within(self.simd, self.limit);
            }
        }
    }
}

#[inline(always)]
fn squared_length([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

/// The point of the triangles of all trees that is closest to a point, and at most `max_distance` away, in scene units.
///
/// Equal to a test of every triangle, to the bit: distances are decided in f64 by one function of point and triangle, and equal ones go to
/// the lower triangle. A point that is closest to an edge or a corner has the same distance, to the bit, from all triangles around it.
/// Triangles of zero area do not count, as for rays.
///
/// A distance counts if its square in f64 is at most the square of `max_distance`. 0 finds only triangles that the point is on, exactly;
/// infinity is no limit. `None` if nothing is that close, if the point is not finite, and for a limit that is negative or NaN.
///
/// Expected time is logarithmic in the number of triangles. It grows with the distance, since many triangles are then nearly as close.
/// Allocates nothing.
pub fn closest_point(
    trees: &[PointTree<'_>],
    point: impl Into<Vec3>,
    max_distance: f32,
) -> Option<Nearest> {
    let mut best = Best::new(point.into(), max_distance)?;
    for &tree in trees {
        best.improve(tree);
    }
    best.nearest()
}
