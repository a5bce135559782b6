//! A ray for wide nodes and blocks with AVX2: eight boxes and eight triangles at a time.
//!
//! ```text
//! numbers of a ray ─▶ nodes       a ray for nodes: which boxes it meets, what it pushes
//!                  └▶ triangles   a ray for blocks: which triangles it may hit, at which depths
//! single            both in one loop, for one ray alone
//! Avx2Ray           both prepared at once, for rays that traverse in turns
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

mod nodes;
mod single;
mod triangles;

use std::arch::x86_64::_mm256_set1_ps;
use std::ops::ControlFlow;

use kd_core::{Hit, Ray};
use kd_simd::Avx2;
use kd_wide::{Block, Child, WIDTH, WideNode};

use super::stack::Pending;
use super::subtree::Subtree;
use super::walk::WideRay;
use crate::collect::Collect;
use crate::dispatch::TraceSimd;
use crate::planes::Frame;
use crate::probe::Probe;
use nodes::{NodeRay, Numbers, Prepared};
use triangles::{TriangleRay, candidates};

/// Bytes of a row of a node or a block.
const ROW: usize = 4 * WIDTH;

impl TraceSimd for Avx2 {
    type Ray = Avx2Ray;

    #[inline(always)]
    fn prepare(self, ray: &Ray, frame: &Frame) -> Option<Avx2Ray> {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { Avx2Ray::new(self, ray, frame) }
    }

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
    fn closest<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> Hit {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { single::closest(self, subtree, ray, probe) }
    }

    #[inline(always)]
    fn any<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> bool {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { single::any(self, subtree, ray, probe) }
    }
}

/// A usual ray, prepared for nodes and triangles at once.
pub(crate) struct Avx2Ray {
    /// The proof that the processor has AVX2.
    simd: Avx2,
    nodes: NodeRay,
    triangles: TriangleRay,
}

impl Avx2Ray {
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn new(simd: Avx2, ray: &Ray, frame: &Frame) -> Option<Self> {
        let numbers = Numbers::of(ray);
        match NodeRay::usual(&numbers, frame) {
            Prepared::Usual(nodes) => Some(Self {
                simd,
                nodes,
                triangles: TriangleRay::new(&numbers, frame),
            }),
            Prepared::Unusual | Prepared::Miss => None,
        }
    }

    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn visit<C: Collect, P: Probe>(
        &self,
        blocks: &[Block],
        limit: f32,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let ray = &self.triangles;
        for block in blocks {
            probe.block();
            let Some(candidates) = candidates::<(C, P)>(ray, block, limit * ray.speed) else {
                continue;
            };
            if C::ANY && candidates.sure != 0 {
                collector.take_any();
                return ControlFlow::Break(());
            }
            ray.take_each(self.simd, block, candidates.lanes, collector, probe)?;
        }
        ControlFlow::Continue(())
    }
}

impl WideRay for Avx2Ray {
    #[inline(always)]
    fn end(&self) -> f32 {
        self.nodes.end
    }

    #[inline(always)]
    fn steps(&self, t: f32) -> f32 {
        t
    }

    #[inline(always)]
    fn enter<const ANY: bool>(
        &self,
        node: &WideNode,
        limit: f32,
        pending: &mut Pending<'_>,
    ) -> Option<Child> {
        // SAFETY: there is an `Avx2`.
        unsafe {
            let axes = self.nodes.broadcast();
            nodes::enter::<ANY>(node, self.nodes.rows, &axes, _mm256_set1_ps(limit), pending)
        }
    }

    #[inline(always)]
    fn enter_or_pop(&self, node: &WideNode, limit: f32, pending: &mut Pending<'_>) -> Child {
        // SAFETY: there is an `Avx2`.
        unsafe {
            let axes = self.nodes.broadcast();
            nodes::enter_or_pop(node, self.nodes.rows, &axes, _mm256_set1_ps(limit), pending)
        }
    }

    /// Not inlined: the loop around it would keep the constants of triangles on its stack.
    #[inline(never)]
    fn visit<C: Collect, P: Probe>(
        &self,
        blocks: &[Block],
        limit: f32,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // SAFETY: there is an `Avx2`.
        unsafe { self.visit(blocks, limit, collector, probe) }
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
