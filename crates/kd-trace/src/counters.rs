//! Counts of the steps of a ray: feature `counters`.
//!
//! The same traversals, compiled again with a [`Probe`] that counts. Traversals that do not count are the same with this
//! feature and without.

use kd_core::{Hit, Mesh, Ray, Tree};
use kd_wide::WideTree;

use crate::binary::indexed::Indexed;
use crate::binary::packed::PackedTree;
use crate::binary::walk::walk;
use crate::collect::{Any, Closest};
use crate::dispatch::{any_of_one, closest_of_one, hit_or_none};
use crate::probe::Probe;
use crate::ray_query::RayQuery;

/// The steps of one ray. For heat maps, and to compare trees without a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Interior nodes visited.
    pub nodes: u32,
    /// Leaves visited, empty ones included.
    pub leaves: u32,
    /// Triangles in the visited leaves; a triangle counts in each of its leaves.
    pub triangles: u32,
    /// Blocks of up to eight triangles that were tested together; 0 where triangles are tested one by one.
    pub blocks: u32,
    /// Triangles that the early rejection in f32 did not reject.
    pub decisions: u32,
}

impl Probe for TraversalCounts {
    fn node(&mut self) {
        self.nodes += 1;
    }

    fn leaf(&mut self, triangles: impl FnOnce() -> u32) {
        self.leaves += 1;
        self.triangles += triangles();
    }

    fn block(&mut self) {
        self.blocks += 1;
    }

    fn decision(&mut self) {
        self.decisions += 1;
    }
}

/// [`intersect`](crate::intersect) with its counts. Slower; for heat maps and for comparing trees.
///
/// # Panics
///
/// As [`intersect`](crate::intersect).
pub fn intersect_counted(tree: &Tree, mesh: &Mesh, ray: &Ray) -> (Option<Hit>, TraversalCounts) {
    let mut closest = Closest::default();
    let mut counts = TraversalCounts::default();
    walk(&Indexed { tree, mesh }, ray, &mut closest, &mut counts);
    (closest.0, counts)
}

/// [`RayQuery`] with counts. Slower; for heat maps, for comparing trees, and for fitting costs to measured times.
pub trait CountedQuery: RayQuery {
    /// [`intersect`](RayQuery::intersect) with its counts.
    fn intersect_counted(&self, ray: &Ray) -> (Option<Self::Hit>, TraversalCounts);

    /// [`occluded`](RayQuery::occluded) with its counts.
    fn occluded_counted(&self, ray: &Ray) -> (bool, TraversalCounts);
}

impl CountedQuery for PackedTree {
    fn intersect_counted(&self, ray: &Ray) -> (Option<Hit>, TraversalCounts) {
        let mut closest = Closest::default();
        let mut counts = TraversalCounts::default();
        self.walk(ray, &mut closest, &mut counts);
        (closest.0, counts)
    }

    fn occluded_counted(&self, ray: &Ray) -> (bool, TraversalCounts) {
        let mut any = Any::default();
        let mut counts = TraversalCounts::default();
        self.walk(ray, &mut any, &mut counts);
        (any.0, counts)
    }
}

impl CountedQuery for WideTree {
    fn intersect_counted(&self, ray: &Ray) -> (Option<Hit>, TraversalCounts) {
        let mut counts = TraversalCounts::default();
        (hit_or_none(closest_of_one(self, ray, &mut counts)), counts)
    }

    fn occluded_counted(&self, ray: &Ray) -> (bool, TraversalCounts) {
        let mut counts = TraversalCounts::default();
        (any_of_one(self, ray, &mut counts), counts)
    }
}
