//! Counting with AVX2: two vectors of eight candidates against each primitive in turn.
#![allow(
    unsafe_code,
    reason = "code for an extension of the processor may only be called where the processor has it"
)]

use std::arch::x86_64::{
    __m256, __m256i, _CMP_GT_OQ, _CMP_LT_OQ, _mm256_castps_si256, _mm256_cmp_ps, _mm256_set1_ps,
    _mm256_setr_ps, _mm256_setzero_si256, _mm256_sub_epi32,
};

use super::{Count, LANES, Lanes, best_plane_by};
use crate::plane::{CellCost, Plane};
use crate::prim::Prim;

/// Proof that the processor has AVX2: only [`detect`](Self::detect) makes one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Avx2(());

impl Avx2 {
    #[inline]
    pub(super) fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(()))
    }

    pub(super) fn best_plane(self, prims: &[Prim], cost: &CellCost) -> Option<Plane> {
        #[target_feature(enable = "avx2")]
        fn with_avx2(proof: Avx2, prims: &[Prim], cost: &CellCost) -> Option<Plane> {
            best_plane_by(proof, prims, cost)
        }
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { with_avx2(self, prims, cost) }
    }
}

impl Count for Avx2 {
    #[inline(always)]
    fn below_and_above(
        self,
        candidates: &Lanes<f32>,
        starts: &[f32],
        ends: &[f32],
    ) -> (Lanes<u32>, Lanes<u32>) {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { below_and_above(candidates, starts, ends) }
    }
}

#[inline]
#[target_feature(enable = "avx2")]
fn below_and_above(
    candidates: &Lanes<f32>,
    starts: &[f32],
    ends: &[f32],
) -> (Lanes<u32>, Lanes<u32>) {
    let (first, second) = (vector(candidates, 0), vector(candidates, 8));
    let none = _mm256_setzero_si256();
    let (mut below, mut above) = ([none; 2], [none; 2]);
    for (&start, &end) in starts.iter().zip(ends) {
        let (start, end) = (_mm256_set1_ps(start), _mm256_set1_ps(end));
        // True is -1.
        below[0] = minus::<_CMP_LT_OQ>(below[0], start, first);
        below[1] = minus::<_CMP_LT_OQ>(below[1], start, second);
        above[0] = minus::<_CMP_GT_OQ>(above[0], end, first);
        above[1] = minus::<_CMP_GT_OQ>(above[1], end, second);
    }
    (bytemuck::cast(below), bytemuck::cast(above))
}

#[inline]
#[target_feature(enable = "avx2")]
fn vector(lanes: &[f32; LANES], at: usize) -> __m256 {
    let l = |i: usize| lanes[at + i];
    _mm256_setr_ps(l(0), l(1), l(2), l(3), l(4), l(5), l(6), l(7))
}

#[inline]
#[target_feature(enable = "avx2")]
fn minus<const COMPARISON: i32>(count: __m256i, a: __m256, b: __m256) -> __m256i {
    _mm256_sub_epi32(
        count,
        _mm256_castps_si256(_mm256_cmp_ps::<COMPARISON>(a, b)),
    )
}
