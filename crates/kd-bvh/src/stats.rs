//! What a hierarchy looks like, as numbers with one text form.

use std::fmt;

use kd_core::{Aabb, CostModel};

use crate::bvh::Bvh;
use crate::node::{BvhNode, BvhNodeView};

/// Counts and costs of a hierarchy. Its `Display` is the one text form.
///
/// Costs follow the surface area heuristic for rays that meet the root's box, as those of
/// [`TreeStats`](kd_core::TreeStats) do: the sum over nodes of their cost times their half area over that of the root.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BvhStats {
    /// Triangles it is over.
    pub triangles: usize,
    /// Of these, triangles of zero area, if known: the mesh knows, a hierarchy alone does not.
    pub zero_area: Option<usize>,
    /// Interior nodes and leaves.
    pub nodes: usize,
    /// Leaves among them.
    pub leaves: usize,
    /// References in all leaves: as many as triangles.
    pub references: usize,
    /// Interior nodes above the deepest leaf.
    pub depth: usize,
    /// SAH cost at K_T 15, K_I 20, one lane: to compare with the literature.
    pub sah_cost_15_20: f64,
    /// SAH cost under the model it was built for.
    pub sah_cost_own: f64,
    /// Bytes of nodes and references.
    pub bytes: usize,
}

impl Bvh {
    /// Counts and costs. Linear in the number of nodes.
    pub fn stats(&self) -> BvhStats {
        let mut stats = BvhStats {
            triangles: self.triangles.len(),
            zero_area: None,
            nodes: self.nodes.len(),
            leaves: 0,
            references: 0,
            depth: 0,
            sah_cost_15_20: sah_cost(&self.nodes, &CostModel::CLASSIC),
            sah_cost_own: sah_cost(&self.nodes, &self.cost),
            bytes: size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice()),
        };
        if !self.nodes.is_empty() {
            self.count_below(0, 0, &mut stats);
        }
        stats
    }

    fn count_below(&self, place: u32, depth: usize, stats: &mut BvhStats) {
        match self.nodes[place as usize].view() {
            BvhNodeView::Leaf { count, .. } => {
                stats.leaves += 1;
                stats.references += count as usize;
                stats.depth = stats.depth.max(depth);
            }
            BvhNodeView::Interior { second, .. } => {
                self.count_below(place + 1, depth + 1, stats);
                self.count_below(second, depth + 1, stats);
            }
        }
    }
}

impl BvhStats {
    /// The same statistics with the mesh's count of zero-area triangles filled in.
    #[must_use]
    pub fn with_zero_area(mut self, zero_area: usize) -> Self {
        self.zero_area = Some(zero_area);
        self
    }
}

/// The box of the root.
pub(crate) fn bounds_of(nodes: &[BvhNode]) -> Aabb {
    nodes.first().map_or(Aabb::EMPTY, BvhNode::bounds)
}

/// The cost of nodes under a model. A box that no ray meets in the sense of the heuristic, where the root has no area, counts
/// as always met.
pub(crate) fn sah_cost(nodes: &[BvhNode], model: &CostModel) -> f64 {
    let whole = bounds_of(nodes).half_area();
    let costs = nodes.iter().map(|node| {
        let own = match node.view() {
            BvhNodeView::Leaf { count, .. } => model.leaf(count as usize),
            BvhNodeView::Interior { .. } => f64::from(model.traverse),
        };
        let chance = if whole > 0.0 {
            node.bounds().half_area() / whole
        } else {
            1.0
        };
        chance * own
    });
    costs.sum()
}

impl fmt::Display for BvhStats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let per_triangle = self.bytes as f64 / self.triangles.max(1) as f64;
        writeln!(f, "triangles        {:>12}", self.triangles)?;
        if let Some(zero_area) = self.zero_area {
            writeln!(f, "  of zero area   {zero_area:>12}")?;
        }
        writeln!(f, "nodes            {:>12}", self.nodes)?;
        writeln!(f, "leaves           {:>12}", self.leaves)?;
        writeln!(f, "references       {:>12}", self.references)?;
        writeln!(f, "depth            {:>12}", self.depth)?;
        writeln!(f, "SAH cost (15:20) {:>12.3}", self.sah_cost_15_20)?;
        writeln!(f, "SAH cost (own)   {:>12.3}", self.sah_cost_own)?;
        writeln!(f, "bytes            {:>12}", self.bytes)?;
        writeln!(f, "  per triangle   {per_triangle:>12.1}")
    }
}
