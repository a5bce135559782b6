//! Queries that count what a ray visits: feature `counters`.

use kd_core::{Hit, Ray};
use kd_trace::CountedQuery as _;

use crate::KdTree;
use crate::layout::{TraversalCounts, TreeLayout};

impl KdTree {
    /// [`intersect`](Self::intersect) with the nodes, blocks and triangles that the ray visits: for heat maps, and to find what
    /// limits speed.
    pub fn intersect_counted(&self, ray: &Ray) -> (Option<Hit>, TraversalCounts) {
        match &self.layout {
            TreeLayout::Binary(tree) => tree.intersect_counted(ray),
            TreeLayout::Wide(tree) => tree.intersect_counted(ray),
        }
    }

    /// [`occluded`](Self::occluded) with what the ray visits.
    pub fn occluded_counted(&self, ray: &Ray) -> (bool, TraversalCounts) {
        match &self.layout {
            TreeLayout::Binary(tree) => tree.occluded_counted(ray),
            TreeLayout::Wide(tree) => tree.occluded_counted(ray),
        }
    }
}
