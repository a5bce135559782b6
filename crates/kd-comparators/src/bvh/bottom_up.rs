//! Bottom-up construction by locally-ordered clustering (D. Meister, J. Bittner, *Parallel Locally-Ordered Clustering for
//! Bounding Volume Hierarchy Construction*, 2018).
//!
//! Triangles are sorted along a space-filling curve. Each cluster searches a window of the curve, in both directions, for the
//! partner with the smallest common box. Two clusters that choose each other are merged into one, which takes the place of the
//! first. Rounds repeat until one cluster is left. The box of a merged cluster contains the boxes of both members, so that
//! clusters that choose each other remain each other's best partner. With a window over all clusters the result is therefore
//! that of merging the two clusters with the smallest common box again and again (B. Walter, K. Bala, M. Kulkarni, K. Pingali,
//! *Fast Agglomerative Clustering for Rendering*, 2008).

mod clusters;
mod emit;

use kd_trace::kit::{Item, in_morton_order};

use super::node::BvhNode;
use super::options::BvhOptions;

use clusters::Clusters;
use emit::Emitter;

/// The nodes over at least one item, and the triangle list.
pub(super) fn build(
    items: &[Item],
    radius: usize,
    options: &BvhOptions,
    is_parallel: bool,
) -> (Vec<BvhNode>, Vec<u32>) {
    let items = in_morton_order(items, is_parallel);
    let clusters = Clusters::new(&items, radius, options, is_parallel);
    Emitter::new(&items, &clusters, options).emit()
}
