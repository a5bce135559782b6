//! From the triangles up: locally-ordered clustering (D. Meister, J. Bittner, *Parallel Locally-Ordered Clustering for Bounding
//! Volume Hierarchy Construction*, 2018).
//!
//! Triangles lie along a curve that keeps neighbours close. Each looks a little way along it, in both directions, for the one
//! with which it has the smallest box; where two choose each other they become a group, in place of the first; and so on with
//! groups, until there is one. The box of a group is no smaller than that of a part of it, so that pairs that have chosen
//! each other stay each other's best: where everything is looked at, the outcome is that of putting together the two with the
//! smallest common box over and over again (B. Walter, K. Bala, M. Kulkarni, K. Pingali, *Fast Agglomerative Clustering for
//! Rendering*, 2008).

mod clusters;
mod emit;
mod morton;

use crate::item::Item;
use crate::node::BvhNode;
use crate::options::BvhOptions;

use clusters::Clusters;
use emit::Emitter;

/// Nodes over items, of which there is at least one, and the list of their triangles.
pub(crate) fn build(
    items: &[Item],
    radius: usize,
    options: &BvhOptions,
    is_parallel: bool,
) -> (Vec<BvhNode>, Vec<u32>) {
    let items = morton::in_order(items, is_parallel);
    let clusters = Clusters::new(&items, radius, options, is_parallel);
    Emitter::new(&items, &clusters, options).emit()
}
