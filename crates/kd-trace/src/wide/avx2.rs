//! A ray for wide nodes and blocks with AVX2: eight boxes and eight triangles at a time.
//!
//! ```text
//! numbers of a ray ─▶ nodes       a ray for nodes: which boxes it meets, what it pushes
//!                  └▶ triangles   a ray for blocks: which triangles it may hit, at which depths
//! single            both in one loop, for one ray alone
//! placed            the same loop in the space of a tree that instances share
//! boxes             the same loop over boxes of items
//! batch             a ray among others: one node for many rays, or one step of many
//! ```
//!
//! `unsafe` code is here for two reasons: an instruction of AVX2 or FMA, which an [`Avx2`] proves to exist, or a read of eight
//! floats at the offset of a row of a node or a block.
#![allow(
    unsafe_code,
    reason = "intrinsics; the portable twin is in `portable`, and tests compare both with brute force"
)]
#![allow(
    clippy::multiple_unsafe_ops_per_block,
    reason = "nearly every line is an instruction, or an address and a load; each block says what makes it safe"
)]

mod batch;
mod boxes;
mod nodes;
mod placed;
mod single;
mod triangles;

use kd_core::{Hit, Ray};
use kd_simd::Avx2;
use kd_wide::{Frame, WIDTH, WideBoxes};

use super::placed::InPlaced;
use super::subtree::Subtree;
use crate::collect::Collect;
use crate::dispatch::TraceSimd;
use crate::items::VisitItem;
use crate::probe::Probe;
use batch::Avx2BatchRay;
use single::{Any, Closest};

/// Bytes of a row of a node or a block.
const ROW: usize = 4 * WIDTH;

impl TraceSimd for Avx2 {
    type ClosestInBatch = Avx2BatchRay<Closest>;
    type AnyInBatch = Avx2BatchRay<Any>;

    #[inline(always)]
    fn collect<C: Collect, P: Probe>(
        self,
        subtree: Subtree<'_>,
        ray: &Ray,
        collector: &mut C,
        probe: &mut P,
    ) {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { single::collect(self, subtree, ray, collector, probe) }
    }

    #[inline(always)]
    fn collect_placed<C: Collect, P: Probe>(self, placed: InPlaced<'_, C>, probe: &mut P) {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { placed::collect(self, placed, probe) }
    }

    #[inline(always)]
    fn closest<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> Hit {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { single::closest(self, subtree, ray, probe) }
    }

    #[inline(always)]
    fn any<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> bool {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { single::any(self, subtree, ray, probe) }
    }

    #[inline(always)]
    fn boxes<V: VisitItem>(self, boxes: &WideBoxes, frame: &Frame, ray: &Ray, visitor: &mut V) {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { boxes::visit(boxes, frame, ray, visitor) }
    }
}

/// Reads a number by a load of its own.
///
/// A load of several numbers at once, which the compiler makes of neighboring loads, waits until all of them have left the store
/// buffer, if they were just written one by one.
#[inline(always)]
fn read_alone(number: &f32) -> f32 {
    // SAFETY: a reference is valid for reads.
    unsafe { std::ptr::from_ref(number).read_volatile() }
}

/// The identity, opaque to the compiler: it loads what is behind the reference again.
#[inline(always)]
fn opaque<T>(reference: &T) -> &T {
    let pointer: *const T = reference;
    #[cfg(not(miri))]
    let pointer = {
        let mut pointer = pointer;
        // SAFETY: the block is empty.
        unsafe {
            std::arch::asm!("/* {0} */", inout(reg) pointer, options(pure, readonly, nostack, preserves_flags));
        }
        pointer
    };
    // SAFETY: it is the reference.
    unsafe { &*pointer }
}
