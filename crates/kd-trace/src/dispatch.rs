//! The one place where a traversal meets the instructions that it is compiled for.
//!
//! Traversals are written once. The walk over 8-byte nodes has no intrinsics of its own: its loops over eight lanes become the
//! vector instructions of the function around them. The traversals of wide nodes are generic over [`TraceSimd`]: the
//! [lanes](kd_simd) of a level, and how that level holds a ray for wide nodes. Each entry here is a [`Task`], which
//! [`Level::run`](kd_simd::Level::run) compiles as a whole for the level of the tree.

use std::marker::PhantomData;

use kd_core::{Hit, Ray, RayPacket8};
#[cfg(target_arch = "x86_64")]
use kd_simd::Avx2;
use kd_simd::{LANES, Portable, Simd, Task};
use kd_wide::WideTree;

use crate::binary::packed::PackedTree;
use crate::binary::walk::{Begin, walk};
use crate::collect::{Any, Closest, Collect};
use crate::planes::Frame;
use crate::probe::Probe;
use crate::wide;
#[cfg(target_arch = "x86_64")]
use crate::wide::avx2::Avx2Ray;
use crate::wide::portable::PortableRay;
use crate::wide::walk::WideRay;

/// A set of instructions that wide nodes are traced with.
pub(crate) trait TraceSimd: Simd {
    /// A ray, prepared for wide nodes and blocks.
    type Ray: WideRay;

    /// Prepares a ray for a tree with this frame; `None` if the ray cannot hit anything.
    fn prepare(self, ray: &Ray, frame: &Frame) -> Option<Self::Ray>;
}

impl TraceSimd for Portable {
    type Ray = PortableRay;

    #[inline(always)]
    fn prepare(self, ray: &Ray, frame: &Frame) -> Option<PortableRay> {
        PortableRay::new(ray, frame)
    }
}

#[cfg(target_arch = "x86_64")]
impl TraceSimd for Avx2 {
    type Ray = Avx2Ray;

    #[inline(always)]
    fn prepare(self, ray: &Ray, frame: &Frame) -> Option<Avx2Ray> {
        Avx2Ray::new(self, ray, frame)
    }
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
        walk(self.tree, self.ray, self.collector, self.probe);
    }
}

/// One ray through wide nodes.
struct WalkWide<'a, C, P> {
    tree: &'a WideTree,
    ray: &'a Ray,
    collector: &'a mut C,
    probe: &'a mut P,
}

impl<S: TraceSimd, C: Collect, P: Probe> Task<S> for WalkWide<'_, C, P> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        if let Some(ray) = simd.prepare(self.ray, self.tree.frame()) {
            wide::walk::walk(self.tree, &ray, self.collector, self.probe);
        }
    }
}

/// Gives the collector every hit of a ray that it may want.
#[inline]
pub(crate) fn walk_wide<C: Collect, P: Probe>(
    tree: &WideTree,
    ray: &Ray,
    collector: &mut C,
    probe: &mut P,
) {
    tree.level().run(WalkWide {
        tree,
        ray,
        collector,
        probe,
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

impl<S: TraceSimd, C: Collect + Default> Task<S> for Packet<'_, C> {
    type Output = [C; LANES];

    #[inline(always)]
    fn run(self, simd: S) -> [C; LANES] {
        wide::packet::trace(simd, self.tree, self.packet)
    }
}

/// The ray of each lane, with a collector for each.
pub(crate) fn trace_packet<C: Collect + Default>(
    tree: &WideTree,
    packet: &RayPacket8,
) -> [C; LANES] {
    tree.level().run(Packet {
        tree,
        packet,
        collect: PhantomData,
    })
}
