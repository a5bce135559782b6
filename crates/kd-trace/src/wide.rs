//! Rays through wide nodes.
//!
//! ```text
//! one ray       avx2::single, or walk ─▶ enter a node, visit a leaf (portable, avx2)
//! over boxes    boxes: the same loops, and eight boxes in place of a block of triangles
//! eight rays    packet: coherent lanes traverse together
//! many rays     batch ─▶ tile: up to 64 coherent neighbors traverse together
//!                    ├─▶ scattered ─▶ sorter ─▶ tile: coherent rays that are not neighbors
//!                    └─▶ incoherent ─▶ stream: up to 1024 rays, divided into the children of each node
//!                                   ├─▶ queue: sixteen rays at a time, in turns
//!                                   └─▶ one by one
//!               race: which way is fastest, or one ray after another; kept: for the next batch of a thread
//! ```
//!
//! The nodes and how they are made are in `kd-wide`.

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
pub(crate) mod batch;
pub(crate) mod batch_ray;
pub(crate) mod boxes;
mod eight;
mod incoherent;
mod kept;
mod limits;
pub(crate) mod packet;
pub(crate) mod placed;
pub(crate) mod portable;
mod queue;
mod race;
mod scattered;
mod sorter;
mod stack;
mod stream;
pub(crate) mod subtree;
mod tile;
pub(crate) mod walk;

use kd_core::{Hit, Ray, RayPacket8};
use kd_wide::WideTree;

use crate::collect::{Any, Closest, Ordered};
use crate::dispatch::{
    any_of_each, any_of_one, closest_of_each, closest_of_one, hit_or_none, hits_of_one,
    trace_packet,
};
use crate::ray_query::{RayQuery, rest_of};

/// Batches detect coherent rays: runs of 64, from the first ray on, are traced together while they stay together. Other rays
/// are sorted into coherent groups while that pays, and the rest is traced as streams, which are sorted
/// into the children of each node. Each of these ways is
/// timed against single rays on the way, and used where it is faster. In a packet, rays that
/// move most on the same axis, with the same signs on all axes, traverse together.
impl RayQuery for WideTree {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        hit_or_none(closest(self, ray))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        any_of_one(self, ray, &mut ())
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        Ordered::fill(out, max, |ordered| hits_of_one(self, ray, ordered));
    }

    fn hits_behind(&self, ray: &Ray, last: &Hit, max: usize, out: &mut Vec<Hit>) {
        let rest = rest_of(ray, last);
        Ordered::fill_behind(out, Some(*last), max, |ordered| {
            hits_of_one(self, &rest, ordered);
        });
    }

    fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        closest_of_each(self, rays, hits);
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        any_of_each(self, rays, occluded);
    }

    fn intersect8(&self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        trace_packet(self, packet).map(|closest: Closest| closest.0)
    }

    fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        trace_packet(self, packet).map(|any: Any| any.0)
    }
}

/// The closest hit of a ray, or [`NO_HIT`](crate::dispatch::NO_HIT).
///
/// Compiled here, not in the crate of the caller, which may be compiled at another level of optimization.
fn closest(tree: &WideTree, ray: &Ray) -> Hit {
    closest_of_one(tree, ray, &mut ())
}
