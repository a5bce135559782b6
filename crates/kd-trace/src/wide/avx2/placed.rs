//! One ray in a placed tree: the loop of [`single`](super::single) in the space of the tree, over blocks that are transformed to the
//! scene.

use std::ops::ControlFlow;

use kd_core::{Ray, is_zero_area};
use kd_simd::{Avx2, min};
use kd_wide::Frame;

use super::boxes::Unprepared;
use super::nodes::{NodeRay, Numbers, Prepared, sees_less};
use super::single::{Limit, Place, Progress, Query, trace};
use super::triangles::{Lanes, TriangleRay, candidates};
use crate::collect::Collect;
use crate::decision::BothSides;
use crate::probe::Probe;
use crate::wide::placed::{InPlaced, Placement};
use crate::wide::subtree::Subtree;

/// Gives the collector every hit that it may want. Rays that are not usual, in the scene or in the tree, take the way of any
/// processor.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
pub(super) fn collect<C: Collect, P: Probe>(simd: Avx2, placed: InPlaced<'_, C>, probe: &mut P) {
    let Some((in_scene, in_tree, nodes)) = usual(&placed) else {
        return placed.walk(simd, probe);
    };
    let mut progress = Progress::new(&nodes);
    let mut query = PlacedTriangles {
        simd,
        placement: placed.placement,
        ray: in_scene,
        collector: placed.collector,
    };
    let subtree = Subtree::whole(placed.tree);
    trace(
        subtree,
        || in_tree,
        &nodes,
        &mut progress,
        &mut query,
        probe,
    );
}

/// The ray in the scene, prepared for triangles, and in the tree, its numbers and as prepared for nodes.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn usual<C: Collect>(placed: &InPlaced<'_, C>) -> Option<(TriangleRay, Numbers, NodeRay)> {
    let prepare = |ray: &Ray, frame: &Frame| {
        let numbers = Numbers::of(ray);
        match NodeRay::usual(&numbers, frame) {
            Prepared::Usual(nodes) => Some((numbers, nodes)),
            Prepared::Unusual => None,
        }
    };
    if sees_less(placed.ray) {
        return None;
    }
    let (in_scene, _) = prepare(placed.ray, placed.frame)?;
    let (in_tree, frame) = placed.to_tree()?;
    let (in_tree, nodes) = prepare(&in_tree, &frame)?;
    Some((TriangleRay::new(&in_scene, placed.frame), in_tree, nodes))
}

/// Gives a collector the hits of transformed triangles.
struct PlacedTriangles<'a, C> {
    simd: Avx2,
    placement: &'a Placement,
    /// In the scene.
    ray: TriangleRay,
    collector: &'a mut C,
}

impl<C: Collect> Query for PlacedTriangles<'_, C> {
    const ANY: bool = C::ANY;
    type Ray = Unprepared;

    #[inline(always)]
    fn visit<P: Probe, Caller>(
        &mut self,
        _: &Unprepared,
        place: Place<'_>,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // SAFETY: there is an `Avx2`.
        unsafe { self.visit::<P, Caller>(place, limit, probe) }
    }
}

impl<C: Collect> PlacedTriangles<'_, C> {
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn visit<P: Probe, Caller>(
        &mut self,
        place: Place<'_>,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let block = self.placement.placed_block(self.simd, place.block);
        let depth = limit.steps * self.ray.speed;
        let Some(candidates) = candidates::<(Self, P, Caller)>(&self.ray, &block, depth) else {
            return ControlFlow::Continue(());
        };
        for lane in Lanes(candidates.lanes) {
            probe.decision();
            let hit = self.ray.decide(self.simd, &block, lane, BothSides);
            if let Some(hit) = hit
                && !is_zero_area(block.corners_of(lane))
            {
                self.collector.take(hit)?;
            }
        }
        limit.steps = min(self.collector.limit(), limit.steps);
        ControlFlow::Continue(())
    }
}
