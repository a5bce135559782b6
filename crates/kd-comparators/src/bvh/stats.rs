//! Statistics of a hierarchy.

use std::fmt;

use kd_core::{Aabb, CostModel};

use super::{Bvh, BvhNode, BvhNodeView};

/// Counts and costs of a hierarchy. `Display` is the text form of reports and snapshots.
///
/// Costs follow the surface area heuristic for rays that meet the root's box, as in [`TreeStats`](kd_core::TreeStats): the sum,
/// over nodes, of the node's cost times its half area over the half area of the root.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BvhStats {
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Triangles of zero area among them.
    pub zero_area: usize,
    /// Interior nodes and leaves.
    pub nodes: usize,
    /// Leaves among them.
    pub leaves: usize,
    /// References in all leaves: one per triangle.
    pub references: usize,
    /// Interior nodes above the deepest leaf.
    pub depth: usize,
    /// SAH cost at K_T 15, K_I 20, one lane, for comparison with the literature.
    pub sah_cost_15_20: f64,
    /// SAH cost under the cost model of the build.
    pub sah_cost_own: f64,
    /// Bytes of nodes and references.
    pub bytes: usize,
}

impl Bvh {
    /// Counts and costs. Linear in the number of nodes and triangles.
    pub fn stats(&self) -> BvhStats {
        let mut stats = BvhStats {
            triangles: self.triangles.len(),
            zero_area: self.mesh.zero_area_count(),
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

/// The box of the root.
pub(super) fn bounds_of(nodes: &[BvhNode]) -> Aabb {
    nodes.first().map_or(Aabb::EMPTY, BvhNode::bounds)
}

/// The cost of nodes under a model. If the root has no area, every box counts as met.
fn sah_cost(nodes: &[BvhNode], model: &CostModel) -> f64 {
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
        writeln!(f, "  of zero area   {:>12}", self.zero_area)?;
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
