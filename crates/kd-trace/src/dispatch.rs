//! The one place where a traversal meets the instructions that it is compiled for.
//!
//! Traversals are written once. The walk over 8-byte nodes has no intrinsics of its own: its loops over eight lanes become the
//! vector instructions of the function around them. The traversals of wide nodes are generic over [`TraceSimd`]: the
//! [lanes](kd_simd) of a level, and how that level holds a ray for wide nodes. Each entry here is a [`Task`], which
//! [`Level::run`](kd_simd::Level::run) compiles as a whole for the level of the tree.

use std::marker::PhantomData;

use kd_core::{Hit, Ray, RayPacket8};
use kd_simd::{LANES, Simd, Task};
use kd_wide::{Frame, WideBoxes, WideTree};

use crate::binary::packed::PackedTree;
use crate::binary::walk::{self, Begin};
use crate::collect::{Any, Closest, Collect, keep_first};
use crate::items::VisitItem;
use crate::probe::Probe;
use crate::wide;
use crate::wide::batch_ray::BatchRay;
use crate::wide::placed::InPlaced;
use crate::wide::subtree::Subtree;

/// A set of instructions that wide nodes are traced with.
pub(crate) trait TraceSimd: Simd + 'static {
    /// A ray of many that looks for its closest hit.
    type ClosestInBatch: BatchRay<Self, Answer = Option<Hit>> + 'static;
    /// A ray of many that looks for any hit.
    type AnyInBatch: BatchRay<Self, Answer = bool> + 'static;

    /// Gives the collector every hit of one ray that it may want, roughly front to back.
    fn collect<C: Collect, P: Probe>(
        self,
        subtree: Subtree<'_>,
        ray: &Ray,
        collector: &mut C,
        probe: &mut P,
    );

    /// Gives the collector every hit of one ray in a placed tree that it may want, roughly front to back.
    fn collect_placed<C: Collect, P: Probe>(self, placed: InPlaced<'_, C>, probe: &mut P);

    /// The closest hit of one ray, or [`NO_HIT`].
    fn closest<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> Hit;

    /// Whether one ray hits anything.
    fn any<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> bool;

    /// Lets the visitor visit the items whose boxes one ray may meet.
    fn boxes<V: VisitItem>(self, boxes: &WideBoxes, frame: &Frame, ray: &Ray, visitor: &mut V);
}

/// A query of one ray, as the collector of its answer.
pub(crate) trait Search: Collect + Default {
    /// Answers a ray below a child, in addition to what it knows.
    fn search<S: TraceSimd, P: Probe>(
        &mut self,
        simd: S,
        subtree: Subtree<'_>,
        ray: &Ray,
        probe: &mut P,
    );
}

impl Search for Closest {
    #[inline(always)]
    fn search<S: TraceSimd, P: Probe>(
        &mut self,
        simd: S,
        subtree: Subtree<'_>,
        ray: &Ray,
        probe: &mut P,
    ) {
        if let Some(hit) = hit_or_none(simd.closest(subtree, ray, probe)) {
            keep_first(&mut self.0, hit);
        }
    }
}

impl Search for Any {
    #[inline(always)]
    fn search<S: TraceSimd, P: Probe>(
        &mut self,
        simd: S,
        subtree: Subtree<'_>,
        ray: &Ray,
        probe: &mut P,
    ) {
        self.0 |= simd.any(subtree, ray, probe);
    }
}

/// In place of the hit of a ray that hits nothing: a hit is returned in registers, an optional one is not.
pub(crate) const NO_HIT: Hit = Hit {
    t: f32::NAN,
    u: 0.0,
    v: 0.0,
    triangle: 0,
};

/// `None` for [`NO_HIT`].
#[inline(always)]
pub(crate) fn hit_or_none(hit: Hit) -> Option<Hit> {
    (!hit.t.is_nan()).then_some(hit)
}

/// One ray through 8-byte nodes over packed leaves.
pub(crate) struct WalkPacked<'a, B, C, P> {
    pub(crate) tree: &'a PackedTree,
    pub(crate) ray: B,
    pub(crate) collector: &'a mut C,
    pub(crate) probe: &'a mut P,
}

impl<S: Simd, B: Begin, C: Collect, P: Probe> Task<S> for WalkPacked<'_, B, C, P> {
    type Output = ();

    #[inline(always)]
    fn run(self, _: S) {
        walk::walk(self.tree, self.ray, self.collector, self.probe);
    }
}

/// One ray through wide nodes.
struct OneRay<'a, P> {
    tree: &'a WideTree,
    ray: &'a Ray,
    probe: &'a mut P,
}

/// Its closest hit.
struct ClosestOfOne<'a, P>(OneRay<'a, P>);

impl<S: TraceSimd, P: Probe> Task<S> for ClosestOfOne<'_, P> {
    type Output = Hit;

    #[inline(always)]
    fn run(self, simd: S) -> Hit {
        let OneRay { tree, ray, probe } = self.0;
        simd.closest(Subtree::whole(tree), ray, probe)
    }
}

/// Whether it hits anything.
struct AnyOfOne<'a, P>(OneRay<'a, P>);

impl<S: TraceSimd, P: Probe> Task<S> for AnyOfOne<'_, P> {
    type Output = bool;

    #[inline(always)]
    fn run(self, simd: S) -> bool {
        let OneRay { tree, ray, probe } = self.0;
        simd.any(Subtree::whole(tree), ray, probe)
    }
}

/// Its hits, for a collector.
struct HitsOfOne<'a, C, P>(OneRay<'a, P>, &'a mut C);

impl<S: TraceSimd, C: Collect, P: Probe> Task<S> for HitsOfOne<'_, C, P> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let OneRay { tree, ray, probe } = self.0;
        simd.collect(Subtree::whole(tree), ray, self.1, probe);
    }
}

/// The closest hit of a ray, or [`NO_HIT`].
pub(crate) fn closest_of_one<P: Probe>(tree: &WideTree, ray: &Ray, probe: &mut P) -> Hit {
    tree.level().run(ClosestOfOne(OneRay { tree, ray, probe }))
}

/// Whether a ray hits anything.
pub(crate) fn any_of_one<P: Probe>(tree: &WideTree, ray: &Ray, probe: &mut P) -> bool {
    tree.level().run(AnyOfOne(OneRay { tree, ray, probe }))
}

/// Gives the collector every hit of a ray that it may want.
pub(crate) fn hits_of_one<C: Collect>(tree: &WideTree, ray: &Ray, collector: &mut C) {
    let probe = &mut ();
    tree.level()
        .run(HitsOfOne(OneRay { tree, ray, probe }, collector));
}

/// One ray through wide nodes over boxes.
struct ItemsOfOne<'a, V> {
    boxes: &'a WideBoxes,
    frame: &'a Frame,
    ray: &'a Ray,
    visitor: &'a mut V,
}

impl<S: TraceSimd, V: VisitItem> Task<S> for ItemsOfOne<'_, V> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        simd.boxes(self.boxes, self.frame, self.ray, self.visitor);
    }
}

/// Lets the visitor visit the items whose boxes a ray may meet.
pub(crate) fn items_of_one<V: VisitItem>(
    boxes: &WideBoxes,
    frame: &Frame,
    ray: &Ray,
    visitor: &mut V,
) {
    boxes.level().run(ItemsOfOne {
        boxes,
        frame,
        ray,
        visitor,
    });
}

/// Many rays through wide nodes, with an answer for each.
struct Batch<'a, Q: wide::batch::Query> {
    tree: &'a WideTree,
    rays: &'a [Ray],
    answers: &'a mut [Q::Answer],
}

impl<S: TraceSimd, Q: wide::batch::Query> Task<S> for Batch<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        wide::batch::trace::<S, Q>(simd, self.tree, self.rays, self.answers);
    }
}

/// The closest hit of each ray.
pub(crate) fn closest_of_each(tree: &WideTree, rays: &[Ray], hits: &mut [Option<Hit>]) {
    tree.level().run(Batch::<Closest> {
        tree,
        rays,
        answers: hits,
    });
}

/// Whether each ray hits anything.
pub(crate) fn any_of_each(tree: &WideTree, rays: &[Ray], occluded: &mut [bool]) {
    tree.level().run(Batch::<Any> {
        tree,
        rays,
        answers: occluded,
    });
}

/// The ray of each lane through wide nodes, with a collector for each.
struct Packet<'a, C> {
    tree: &'a WideTree,
    packet: &'a RayPacket8,
    collect: PhantomData<C>,
}

impl<S: TraceSimd, C: Search> Task<S> for Packet<'_, C> {
    type Output = [C; LANES];

    #[inline(always)]
    fn run(self, simd: S) -> [C; LANES] {
        wide::packet::trace(simd, self.tree, self.packet)
    }
}

/// The ray of each lane, with a collector for each.
pub(crate) fn trace_packet<C: Search>(tree: &WideTree, packet: &RayPacket8) -> [C; LANES] {
    tree.level().run(Packet {
        tree,
        packet,
        collect: PhantomData,
    })
}

/// One ray through a placed tree.
struct Placed<'a, C>(InPlaced<'a, C>);

impl<S: TraceSimd, C: Collect> Task<S> for Placed<'_, C> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        simd.collect_placed(self.0, &mut ());
    }
}

/// Gives the collector every hit of a ray in a placed tree that it may want.
pub(crate) fn hits_in_placed<C: Collect>(placed: InPlaced<'_, C>) {
    placed.tree.level().run(Placed(placed));
}
