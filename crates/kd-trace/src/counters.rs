//! What rays cost, counted: feature `counters`.
//!
//! The same traversals, compiled once more with something that counts their steps. Those that do not count cost the same
//! with this feature and without.

use kd_core::{Hit, Mesh, Ray, Tree};
use kd_wide::WideTree;

use crate::collect::{Any, Closest};
use crate::dispatch::walk_wide;
use crate::packed::PackedTree;
use crate::probe::Probe;
use crate::query::Indexed;
use crate::ray_query::RayQuery;
use crate::walk::walk;

/// What one ray cost. For heat maps, and to compare trees without a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Interior nodes visited.
    pub nodes: u32,
    /// Leaves visited, empty ones included.
    pub leaves: u32,
    /// Triangles looked at, the same one in several leaves counting anew.
    pub triangles: u32,
    /// Blocks of up to eight triangles looked at together; 0 where triangles are looked at one by one.
    pub blocks: u32,
    /// Triangles among them that f32 did not reject.
    pub decisions: u32,
}

impl Probe for TraversalCounts {
    fn node(&mut self) {
        self.nodes += 1;
    }

    fn leaf(&mut self, triangles: u32) {
        self.leaves += 1;
        self.triangles += triangles;
    }

    fn block(&mut self) {
        self.blocks += 1;
    }

    fn decision(&mut self) {
        self.decisions += 1;
    }
}

/// [`intersect`](crate::intersect), and what it took. Slower; for heat maps and for comparing trees.
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

/// [`RayQuery`] with counts of what each query took. Slower; for heat maps, for comparing trees, and for fitting costs to
/// measured times.
pub trait CountedQuery: RayQuery {
    /// [`intersect`](RayQuery::intersect), and what it took.
    fn intersect_counted(&self, ray: &Ray) -> (Option<Self::Hit>, TraversalCounts);

    /// [`occluded`](RayQuery::occluded), and what it took.
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
        let mut closest = Closest::default();
        let mut counts = TraversalCounts::default();
        walk_wide(self, ray, &mut closest, &mut counts);
        (closest.0, counts)
    }

    fn occluded_counted(&self, ray: &Ray) -> (bool, TraversalCounts) {
        let mut any = Any::default();
        let mut counts = TraversalCounts::default();
        walk_wide(self, ray, &mut any, &mut counts);
        (any.0, counts)
    }
}
