//! Which instructions rays are traced with.
//!
//! The walk over packed leaves is written once, without intrinsics: loops over eight lanes, which the compiler turns into
//! vector instructions of whatever the function around them may use. So the only thing to decide is in which function the
//! walk is instantiated, and what it computes is the same everywhere: no level has fused multiply-adds, and the operations
//! that are left round alike in all. The walk over wide nodes is written once too, over what a level has for nodes and
//! blocks, and for [`lanes`](crate::lanes).
#![allow(
    unsafe_code,
    reason = "calls a function compiled for AVX2, once it is known that the processor has it"
)]

use std::fmt;

use kd_core::{Hit, Ray, RayPacket8};

use crate::collect::{Any, Closest, Collect};
#[cfg(target_arch = "x86_64")]
use crate::lanes::Avx2;
use crate::lanes::Portable;
use crate::packed::PackedTree;
use crate::probe::Probe;
use crate::walk::{Begin, walk};
#[cfg(target_arch = "x86_64")]
use crate::wide::avx2::Avx2Ray;
use crate::wide::portable::PortableRay;
use crate::wide::{self, WideTree};

/// A set of instructions to trace with. All give the same answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level(Instructions);

/// Private, so that [`Avx2`](Self::Avx2) is only ever made by detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Instructions {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Level {
    /// The fastest that this processor has: AVX2 on x86-64, otherwise [`portable`](Self::portable).
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if has_avx2() {
            return Self(Instructions::Avx2);
        }
        Self::portable()
    }

    /// What the whole program was compiled for. To compare with, in tests and measurements.
    pub const fn portable() -> Self {
        Self(Instructions::Portable)
    }

    /// As the bench records it: `portable`, `avx2`.
    pub const fn name(self) -> &'static str {
        match self.0 {
            Instructions::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => "avx2",
        }
    }

    /// [`walk`] over packed leaves, compiled for this level as a whole, so that the tests of the leaves become a part of
    /// the loop.
    #[inline]
    pub(crate) fn walk<C: Collect, P: Probe>(
        self,
        tree: &PackedTree,
        ray: impl Begin,
        collector: &mut C,
        probe: &mut P,
    ) {
        match self.0 {
            Instructions::Portable => walk(tree, ray, collector, probe),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` alone makes this value, and only where the processor has AVX2.
            Instructions::Avx2 => unsafe { walk_avx2(tree, ray, collector, probe) },
        }
    }

    /// The walk over wide nodes.
    #[inline]
    pub(crate) fn walk_wide<C: Collect, P: Probe>(
        self,
        tree: &WideTree,
        ray: &Ray,
        collector: &mut C,
        probe: &mut P,
    ) {
        match self.0 {
            Instructions::Portable => {
                if let Some(ray) = PortableRay::new(ray, tree.frame()) {
                    wide::walk::walk(tree, &ray, collector, probe);
                }
            }
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` alone makes this value, and only where the processor has all of these.
            Instructions::Avx2 => unsafe { walk_wide_avx2(tree, ray, collector, probe) },
        }
    }

    /// The closest hit of each ray.
    pub(crate) fn closest_of_each(self, tree: &WideTree, rays: &[Ray], hits: &mut [Option<Hit>]) {
        match self.0 {
            Instructions::Portable => {
                let prepare = |ray: &Ray| PortableRay::new(ray, tree.frame());
                wide::batch::closest(Portable, tree, rays, hits, prepare);
            }
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` alone makes this value, and only where the processor has all of these.
            Instructions::Avx2 => unsafe { closest_of_each_avx2(tree, rays, hits) },
        }
    }

    /// The closest hit of the ray of each lane.
    pub(crate) fn closest_of_packet(self, tree: &WideTree, packet: &RayPacket8) -> [Closest; 8] {
        self.trace_packet(tree, packet)
    }

    /// Whether the ray of each lane hits anything.
    pub(crate) fn any_of_packet(self, tree: &WideTree, packet: &RayPacket8) -> [Any; 8] {
        self.trace_packet(tree, packet)
    }

    /// A collector for each lane.
    #[inline]
    fn trace_packet<C: Collect + Default>(self, tree: &WideTree, packet: &RayPacket8) -> [C; 8] {
        match self.0 {
            Instructions::Portable => {
                let prepare = |ray: &Ray| PortableRay::new(ray, tree.frame());
                wide::packet::trace(Portable, tree, packet, prepare)
            }
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` alone makes this value, and only where the processor has all of these.
            Instructions::Avx2 => unsafe { trace_packet_avx2(tree, packet) },
        }
    }

    /// Whether each ray hits anything.
    pub(crate) fn any_of_each(self, tree: &WideTree, rays: &[Ray], occluded: &mut [bool]) {
        match self.0 {
            Instructions::Portable => {
                let prepare = |ray: &Ray| PortableRay::new(ray, tree.frame());
                wide::batch::any(Portable, tree, rays, occluded, prepare);
            }
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `detect` alone makes this value, and only where the processor has all of these.
            Instructions::Avx2 => unsafe { any_of_each_avx2(tree, rays, occluded) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn closest_of_each_avx2(tree: &WideTree, rays: &[Ray], hits: &mut [Option<Hit>]) {
    // SAFETY: this function may be called only where there are all of these.
    let simd = unsafe { Avx2::new() };
    // SAFETY: the same.
    let prepare = |ray: &Ray| unsafe { Avx2Ray::new(ray, tree.frame()) };
    wide::batch::closest(simd, tree, rays, hits, prepare);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn any_of_each_avx2(tree: &WideTree, rays: &[Ray], occluded: &mut [bool]) {
    // SAFETY: this function may be called only where there are all of these.
    let simd = unsafe { Avx2::new() };
    // SAFETY: the same.
    let prepare = |ray: &Ray| unsafe { Avx2Ray::new(ray, tree.frame()) };
    wide::batch::any(simd, tree, rays, occluded, prepare);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn trace_packet_avx2<C: Collect + Default>(tree: &WideTree, packet: &RayPacket8) -> [C; 8] {
    // SAFETY: this function may be called only where there are all of these.
    let simd = unsafe { Avx2::new() };
    // SAFETY: the same.
    let prepare = |ray: &Ray| unsafe { Avx2Ray::new(ray, tree.frame()) };
    wide::packet::trace(simd, tree, packet, prepare)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn walk_wide_avx2<C: Collect, P: Probe>(
    tree: &WideTree,
    ray: &Ray,
    collector: &mut C,
    probe: &mut P,
) {
    // SAFETY: this function may be called only where there are AVX2 and FMA.
    if let Some(ray) = unsafe { Avx2Ray::new(ray, tree.frame()) } {
        wide::walk::walk(tree, &ray, collector, probe);
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// AVX2, and what has come with it in every processor that has it.
#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    use std::arch::is_x86_feature_detected;
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("bmi1")
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn walk_avx2<C: Collect, P: Probe>(
    tree: &PackedTree,
    ray: impl Begin,
    collector: &mut C,
    probe: &mut P,
) {
    walk(tree, ray, collector, probe);
}
