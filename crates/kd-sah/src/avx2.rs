//! All code for AVX2, and all `unsafe` code of the crate: counting for [`small`](crate::small) and [`bins`], looking at
//! positions for [`collect`](crate::collect), costs of bins for [`promising`](crate::promising) and dividing for
//! [`division`](crate::division). Each has a portable twin there, which the tests there hold it against.
//!
//! Twice each is one body, compiled for whatever the target has and here for AVX2. Where that alone does not make vector
//! instructions of it, a trait with two implementations stands for the innermost step.
#![allow(
    unsafe_code,
    reason = "code for an extension of the processor may only be called where the processor has it"
)]

use std::arch::x86_64::{
    __m256, __m256i, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ, _mm256_add_ps, _mm256_and_ps,
    _mm256_castps_si256, _mm256_cmp_ps, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps,
    _mm256_mul_ps, _mm256_set1_ps, _mm256_setr_ps, _mm256_setzero_ps, _mm256_setzero_si256,
    _mm256_sub_epi32, _mm256_sub_ps,
};

use kd_core::{Axis, PrimSource};

use crate::bins::{self, AxisGrid, Edges, EightGrids, FindBins};
use crate::collect::{Look, Places, Search};
use crate::division::{Block, Compare, Division, Filled};
use crate::plane::{CellCost, Plane};
use crate::prim::Prim;
use crate::promising::Group;
use crate::small::{Count, best_plane_by};

/// Proof that the processor has AVX2: only [`detect`](Self::detect) makes one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(());

impl Avx2 {
    #[inline]
    pub(crate) fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(()))
    }

    /// [`best_plane_by`] compiled for AVX2.
    pub(crate) fn best_plane(self, prims: &[Prim], cost: &CellCost) -> Option<Plane> {
        #[target_feature(enable = "avx2")]
        fn with_avx2(proof: Avx2, prims: &[Prim], cost: &CellCost) -> Option<Plane> {
            best_plane_by(proof, prims, cost)
        }
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { with_avx2(self, prims, cost) }
    }

    /// [`Search::collect_by`] compiled for AVX2.
    pub(crate) fn collect(
        self,
        search: &Search<'_>,
        prims: &[Prim],
        step: usize,
        into: &mut Places<'_>,
    ) {
        #[target_feature(enable = "avx2")]
        fn with_avx2(
            proof: Avx2,
            search: &Search<'_>,
            prims: &[Prim],
            step: usize,
            into: &mut Places<'_>,
        ) {
            search.collect_by(proof, prims, step, into);
        }
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { with_avx2(self, search, prims, step, into) }
    }
}

impl Avx2 {
    /// [`bins::Counting::count_by`] compiled for AVX2.
    pub(crate) fn count<const ROOM: usize>(
        self,
        counting: &bins::Counting<'_>,
        counts: &mut [u32],
    ) {
        #[target_feature(enable = "avx2")]
        fn with_avx2<const ROOM: usize>(
            proof: Avx2,
            counting: &bins::Counting<'_>,
            counts: &mut [u32],
        ) {
            counting.count_by::<ROOM>(proof, counts);
        }
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { with_avx2::<ROOM>(self, counting, counts) }
    }

    /// [`Group::costs_here`] compiled for AVX2.
    pub(crate) fn costs(
        self,
        group: &Group,
        cost: &CellCost,
        axis: Axis,
        edges: &Edges,
        step: u32,
    ) -> ([f32; 8], [f32; 8]) {
        #[target_feature(enable = "avx2")]
        fn with_avx2(
            group: &Group,
            cost: &CellCost,
            axis: Axis,
            edges: &Edges,
            step: u32,
        ) -> ([f32; 8], [f32; 8]) {
            group.costs_here(cost, axis, edges, step)
        }
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { with_avx2(group, cost, axis, edges, step) }
    }

    /// [`Division::divide_by`] compiled for AVX2.
    pub(crate) fn divide<S: PrimSource>(
        self,
        division: &Division<'_, S>,
        block: &Block,
        lists: [&mut [Prim]; 2],
        filled: &mut Filled,
    ) {
        #[target_feature(enable = "avx2")]
        fn with_avx2<S: PrimSource>(
            proof: Avx2,
            division: &Division<'_, S>,
            block: &Block,
            lists: [&mut [Prim]; 2],
            filled: &mut Filled,
        ) {
            division.divide_by(proof, block, lists, filled);
        }
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { with_avx2(self, division, block, lists, filled) }
    }
}

impl Count for Avx2 {
    #[inline(always)]
    fn below_and_above(
        self,
        candidates: &[f32; 16],
        starts: &[f32],
        ends: &[f32],
    ) -> ([u32; 16], [u32; 16]) {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { below_and_above(candidates, starts, ends) }
    }
}

impl FindBins for Avx2 {
    #[inline(always)]
    fn bins(self, grids: &EightGrids, positions: &[f32; 8]) -> [u8; 8] {
        // SAFETY: `self` proves that the processor has AVX2.
        let rounded = unsafe { rounded(grids, positions) };
        rounded.map(|[lowest, ..]| lowest)
    }
}

impl Compare for Avx2 {
    #[inline(always)]
    fn below_and_above(self, position: f32, starts: [f32; 8], ends: [f32; 8]) -> (u8, u8) {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { starts_below_and_ends_above(position, starts, ends) }
    }
}

impl Look for Avx2 {
    #[inline(always)]
    fn between(self, grid: &AxisGrid, bins: (f32, f32), positions: [f32; 8]) -> u64 {
        // SAFETY: `self` proves that the processor has AVX2.
        unsafe { between(grid, bins, positions) }
    }
}

/// Two vectors of eight candidates against each primitive in turn.
#[inline]
#[target_feature(enable = "avx2")]
fn below_and_above(candidates: &[f32; 16], starts: &[f32], ends: &[f32]) -> ([u32; 16], [u32; 16]) {
    let [first, second] = bytemuck::cast_ref::<[f32; 16], [[f32; 8]; 2]>(candidates);
    let (first, second) = (vector(first), vector(second));
    let none = _mm256_setzero_si256();
    let (mut below, mut above) = ([none; 2], [none; 2]);
    for (&start, &end) in starts.iter().zip(ends) {
        let (start, end) = (_mm256_set1_ps(start), _mm256_set1_ps(end));
        below[0] = plus::<_CMP_LT_OQ>(below[0], start, first);
        below[1] = plus::<_CMP_LT_OQ>(below[1], start, second);
        above[0] = plus::<_CMP_GT_OQ>(above[0], end, first);
        above[1] = plus::<_CMP_GT_OQ>(above[1], end, second);
    }
    (bytemuck::cast(below), bytemuck::cast(above))
}

/// Adds one where the comparison holds.
#[inline]
#[target_feature(enable = "avx2")]
fn plus<const COMPARISON: i32>(count: __m256i, a: __m256, b: __m256) -> __m256i {
    // True is -1.
    let holds = _mm256_castps_si256(_mm256_cmp_ps::<COMPARISON>(a, b));
    _mm256_sub_epi32(count, holds)
}

/// [`AxisGrid::rounded`] of each position, by the same operations in the same order, as bytes.
#[inline]
#[target_feature(enable = "avx2")]
fn rounded(grids: &EightGrids, positions: &[f32; 8]) -> [[u8; 4]; 8] {
    let at = _mm256_sub_ps(vector(positions), vector(&grids.origin));
    let at = _mm256_mul_ps(at, vector(&grids.scale));
    let at = _mm256_sub_ps(at, _mm256_set1_ps(0.5));
    let at = _mm256_max_ps(at, _mm256_setzero_ps());
    let at = _mm256_min_ps(at, _mm256_set1_ps(grids.last));
    bytemuck::cast(_mm256_add_ps(at, _mm256_set1_ps(AxisGrid::INTEGERS)))
}

/// A bit for each start below the position, and one for each end above it.
#[inline]
#[target_feature(enable = "avx2")]
fn starts_below_and_ends_above(position: f32, starts: [f32; 8], ends: [f32; 8]) -> (u8, u8) {
    let position = _mm256_set1_ps(position);
    let below = _mm256_cmp_ps::<_CMP_LT_OQ>(vector(&starts), position);
    let above = _mm256_cmp_ps::<_CMP_GT_OQ>(vector(&ends), position);
    let bits = |holds| _mm256_movemask_ps(holds).to_le_bytes()[0];
    (bits(below), bits(above))
}

/// A bit for each position whose [`AxisGrid::rounded`], by the same operations in the same order, is in the range.
#[inline]
#[target_feature(enable = "avx2")]
fn between(grid: &AxisGrid, (first, last): (f32, f32), positions: [f32; 8]) -> u64 {
    let at = _mm256_sub_ps(vector(&positions), _mm256_set1_ps(grid.origin));
    let at = _mm256_mul_ps(at, _mm256_set1_ps(grid.scale));
    let at = _mm256_sub_ps(at, _mm256_set1_ps(0.5));
    let at = _mm256_max_ps(at, _mm256_setzero_ps());
    let at = _mm256_min_ps(at, _mm256_set1_ps(grid.last));
    let at = _mm256_add_ps(at, _mm256_set1_ps(AxisGrid::INTEGERS));
    let from = _mm256_cmp_ps::<_CMP_LE_OQ>(_mm256_set1_ps(first), at);
    let to = _mm256_cmp_ps::<_CMP_LE_OQ>(at, _mm256_set1_ps(last));
    u64::from(_mm256_movemask_ps(_mm256_and_ps(from, to)).cast_unsigned())
}

#[inline]
#[target_feature(enable = "avx2")]
fn vector(l: &[f32; 8]) -> __m256 {
    _mm256_setr_ps(l[0], l[1], l[2], l[3], l[4], l[5], l[6], l[7])
}
