//! What rays cost, counted: feature `counters`.

use kd_core::{Hit, Ray};
use kd_trace::{CountedQuery as _, TraversalCounts};

use crate::KdTree;
use crate::traced::Traced;

impl KdTree {
    /// [`intersect`](Self::intersect), and what it took: for heat maps and for finding what limits speed.
    pub fn intersect_counted(&self, ray: &Ray) -> (Option<Hit>, TraversalCounts) {
        match &self.traced {
            Traced::Binary(tree) => tree.intersect_counted(ray),
            Traced::Wide(tree) => tree.intersect_counted(ray),
        }
    }

    /// [`occluded`](Self::occluded), and what it took.
    pub fn occluded_counted(&self, ray: &Ray) -> (bool, TraversalCounts) {
        match &self.traced {
            Traced::Binary(tree) => tree.occluded_counted(ray),
            Traced::Wide(tree) => tree.occluded_counted(ray),
        }
    }
}
