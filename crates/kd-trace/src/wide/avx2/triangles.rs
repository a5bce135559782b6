//! Blocks of triangles.
//!
//! The early rejection uses fused multiply-adds and its own, closer bound. The [decision](crate::decision) is that of all
//! traversals.
#![allow(
    clippy::multiple_unsafe_ops_per_block,
    reason = "nearly every line is an instruction, or an address and a load; each block says what makes it safe"
)]

use std::arch::x86_64::*;
use std::ops::ControlFlow;

use kd_core::Hit;
use kd_simd::{Avx2, Simd as _, Triple as _};
use kd_wide::{Block, WIDTH};

use super::ROW;
use crate::collect::Collect;
use crate::decision::View;
use crate::planes::PER_STEP;
use crate::probe::Probe;
use crate::triangle::{BLUR, SLOPE};

/// A ray, prepared for blocks. The three axes are those of [`TriangleTest`](crate::triangle::TriangleTest): across, across
/// and along.
pub(super) struct Avx2Test {
    origin: [f32; 4],
    direction: [f32; 4],
    shear: [f32; 4],
    /// Byte offsets of rows of a corner.
    rows: [usize; 3],
    /// The slope of the bound of edge functions.
    slope: f32,
    least: f32,
    /// Absolute units along per step.
    per_step: f32,
    /// The largest error of `t` by underflow, along.
    slack: f32,
    /// -0.0 for a ray with a positive direction along, whose coordinates are negated.
    turn: f32,
    /// Where the ray starts, in steps.
    start: f32,
    /// The largest distance of a triangle along.
    farthest: f32,
    t_min: f32,
    t_max: f32,
    /// All bits where the filter is off.
    keep: u32,
}

/// The largest reach R with a filter: 2⁴⁰. Sheared coordinates are below 2.01 R, edge functions below 8.1 R², and their sum times a
/// limit, at most 4 R away, below 98 R³, which is finite.
const MOST_REACH: f32 = (1_u64 << 40) as f32;

/// Lanes of a block.
#[derive(Clone, Copy)]
struct Candidates {
    /// Lanes that may be hit.
    lanes: u32,
    /// Whether one of them is surely hit.
    is_one_sure: bool,
}

impl Avx2Test {
    /// From the ends of a ray; its origin, its direction, and its direction in steps; the reach of the triangles; and the steps
    /// per unit of `t`.
    ///
    /// # Safety
    ///
    /// The processor has AVX2 and FMA.
    #[inline(always)]
    pub(super) unsafe fn new(
        [t_min, t_max]: [f32; 2],
        [origin, exact, direction]: [__m128; 3],
        reach: f32,
        steps: f32,
    ) -> Self {
        /// The axis of the largest size, the first among equals, by whether x < y, y < z and x < z.
        const ALONG: [usize; 8] = [0, 1, 0, 2, 1, 1, 2, 2];
        /// By axis along: both axes across, and along.
        const AXES: [[i32; 4]; 3] = [[1, 2, 0, 3], [2, 0, 1, 3], [0, 1, 2, 3]];
        // SAFETY: the caller's, and loads and stores of four numbers at arrays of four.
        unsafe {
            let sizes = _mm_andnot_ps(_mm_set1_ps(-0.0), exact);
            let (x_y_x, y_z_z) = (
                _mm_permute_ps::<0b00_00_01_00>(sizes),
                _mm_permute_ps::<0b00_10_10_01>(sizes),
            );
            let less = _mm_cmplt_ps(x_y_x, y_z_z);
            let axes = &AXES[ALONG[(_mm_movemask_ps(less).cast_unsigned() & 0b111) as usize]];
            let turn = _mm_loadu_si128(axes.as_ptr().cast());
            let turned = |x: __m128| _mm_permutevar_ps(x, turn);
            let in_memory = |x: __m128| {
                let mut array = [0.0; 4];
                _mm_storeu_ps(array.as_mut_ptr(), x);
                array
            };
            let slopes = turned(direction);
            let shear = _mm_div_ps(slopes, _mm_permute_ps::<0b10_10_10_10>(slopes));
            let along = _mm_cvtss_f32(_mm_permute_ps::<0b10>(slopes));
            let reach = if reach <= MOST_REACH {
                reach
            } else {
                f32::INFINITY
            };
            let (slope, blur) = (SLOPE * reach, BLUR * reach);
            Self {
                origin: in_memory(turned(origin)),
                direction: in_memory(turned(exact)),
                shear: in_memory(shear),
                rows: [axes[0], axes[1], axes[2]].map(|axis| axis.cast_unsigned() as usize * ROW),
                slope,
                least: slope * blur + f32::MIN_POSITIVE,
                per_step: along.abs(),
                slack: PER_STEP * steps * along.abs(),
                turn: if along > 0.0 { -0.0 } else { 0.0 },
                start: t_min * steps,
                farthest: 4.0 * reach,
                t_min,
                t_max,
                keep: if reach.is_infinite() { u32::MAX } else { 0 },
            }
        }
    }
}

#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) fn visit<C: Collect, P: Probe>(
    simd: Avx2,
    test: &Avx2Test,
    blocks: &[Block],
    limit: f32,
    collector: &mut C,
    probe: &mut P,
) -> ControlFlow<()> {
    for block in blocks {
        probe.block();
        let candidates = candidates::<C>(test, block, limit);
        if candidates.is_one_sure {
            collector.take_any();
            return ControlFlow::Break(());
        }
        let mut lanes = candidates.lanes;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize % WIDTH;
            lanes &= lanes - 1;
            probe.decision();
            if let Some(hit) = decide(simd, test, block, lane) {
                collector.take(hit)?;
            }
        }
    }
    ControlFlow::Continue(())
}

/// The lanes that [`TriangleTest::certainly_misses`](crate::triangle::TriangleTest::certainly_misses) does not reject, and whose hit
/// may be between the ends of the ray.
///
/// The first part is the same computation, with fused multiply-adds, which only makes its errors smaller.
///
/// The second part tests the few remaining lanes by a closer bound: all coordinates of a corner, from the origin, are at
/// most L = M + Z, the largest sheared coordinate and the largest one along, so that L replaces the reach R. The errors are:
/// uL moving a corner, uZ and uZ of the shear and its product's factor, uM rounding it, and u/4 M of the
/// rounding to 26 bits that decides: 4uL and a little for e. Then 4uM² + 4eM + 2e² ≤ 20uLM and a little; the bound B here is
/// twice that, 40uL (M + 8uL).
///
/// A hit lies T / D along, where T = Σ w z, D = Σ w with the weights w, the edge functions, and the corners' z. Each w errs by
/// B/2, so D by 3B/2; T by 3B/2 Z, by 6uM²L for errors of z, and by 24uM²Z for rounding: together no more than 2BL. So T - sD is
/// within 2B (L + |s|) of what it stands for, for any s along, such as the ends of the ray; that leaves room for rounding it, and
/// s, and for the rounding of `t` to f32.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn candidates<C: Collect>(test: &Avx2Test, block: &Block, limit: f32) -> Candidates {
    const U: f32 = f32::EPSILON / 2.0;
    let sign = _mm256_set1_ps(-0.0);
    let away = |x: __m256| _mm256_andnot_ps(sign, x);
    let minus = |x: __m256| _mm256_xor_ps(sign, x);
    let [(a, along_a), (b, along_b), (c, along_c)] =
        block.corners.each_ref().map(|rows| sheared(test, rows));
    let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
    let size = |[x, y]: [__m256; 2]| _mm256_max_ps(away(x), away(y));
    let size = _mm256_max_ps(_mm256_max_ps(size(a), size(b)), size(c));
    let bound = _mm256_fmadd_ps(_mm256_set1_ps(test.slope), size, _mm256_set1_ps(test.least));
    let least = _mm256_min_ps(_mm256_min_ps(u, v), w);
    let most = _mm256_max_ps(_mm256_max_ps(u, v), w);
    // False for NaN: in lanes without a triangle, or where the filter is off.
    let above = _mm256_cmp_ps::<_CMP_GE_OQ>(least, minus(bound));
    let below = _mm256_cmp_ps::<_CMP_LE_OQ>(most, bound);
    let keep = _mm256_castsi256_ps(_mm256_set1_epi32(test.keep.cast_signed()));
    let left = _mm256_or_ps(_mm256_or_ps(above, below), keep);
    if _mm256_testz_ps(left, left) != 0 {
        return Candidates {
            lanes: 0,
            is_one_sure: false,
        };
    }

    let depth = _mm256_max_ps(_mm256_max_ps(away(along_a), away(along_b)), away(along_c));
    let reach = _mm256_add_ps(size, depth);
    let bound = _mm256_fmadd_ps(
        _mm256_mul_ps(reach, _mm256_set1_ps(40.0 * U)),
        _mm256_fmadd_ps(reach, _mm256_set1_ps(8.0 * U), size),
        _mm256_set1_ps(f32::MIN_POSITIVE),
    );
    let area = _mm256_add_ps(_mm256_add_ps(u, v), w);
    let winding = _mm256_and_ps(sign, area);
    let area = away(area);
    let t = _mm256_fmadd_ps(
        u,
        along_a,
        _mm256_fmadd_ps(v, along_b, _mm256_mul_ps(w, along_c)),
    );
    let t = _mm256_xor_ps(t, _mm256_xor_ps(winding, _mm256_set1_ps(test.turn)));
    let start = test.start * test.per_step;
    let limit = (limit * test.per_step).min(test.farthest);
    let before = _mm256_fmsub_ps(_mm256_set1_ps(start), area, t);
    let beyond = _mm256_fnmadd_ps(_mm256_set1_ps(limit), area, t);
    // Underflow here is less than the last term.
    let underflow = _mm256_fmadd_ps(
        area,
        _mm256_set1_ps(test.slack),
        _mm256_set1_ps(f32::MIN_POSITIVE),
    );
    let error = |end: f32| {
        let size = _mm256_add_ps(reach, _mm256_set1_ps(end.abs()));
        _mm256_fmadd_ps(_mm256_add_ps(bound, bound), size, underflow)
    };
    let (error_before, error_beyond) = (error(start), error(limit));
    let is_out = _mm256_or_ps(
        _mm256_cmp_ps::<_CMP_GT_OQ>(before, error_before),
        _mm256_cmp_ps::<_CMP_GT_OQ>(beyond, error_beyond),
    );
    let left = _mm256_andnot_ps(_mm256_andnot_ps(keep, is_out), left);
    let is_one_sure = C::ANY && {
        let is_inside = _mm256_or_ps(
            _mm256_cmp_ps::<_CMP_GT_OQ>(least, bound),
            _mm256_cmp_ps::<_CMP_LT_OQ>(most, minus(bound)),
        );
        let is_between = _mm256_and_ps(
            _mm256_cmp_ps::<_CMP_LT_OQ>(before, minus(error_before)),
            _mm256_cmp_ps::<_CMP_LT_OQ>(beyond, minus(error_beyond)),
        );
        let is_sure = _mm256_andnot_ps(keep, _mm256_and_ps(is_inside, is_between));
        _mm256_movemask_ps(is_sure) != 0
    };
    Candidates {
        lanes: _mm256_movemask_ps(left).cast_unsigned(),
        is_one_sure,
    }
}

/// A corner of eight triangles, negated: from the corner to the origin, across and along.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn sheared(test: &Avx2Test, corner: &[[f32; WIDTH]; 3]) -> ([__m256; 2], __m256) {
    let base: *const u8 = (&raw const *corner).cast();
    let from_origin = |axis: usize| {
        // SAFETY: the offset of a row of the corner.
        let row = unsafe { _mm256_load_ps(base.add(test.rows[axis]).cast()) };
        _mm256_sub_ps(_mm256_set1_ps(test.origin[axis]), row)
    };
    let [x, y, along] = [from_origin(0), from_origin(1), from_origin(2)];
    let x = _mm256_fnmadd_ps(_mm256_set1_ps(test.shear[0]), along, x);
    let y = _mm256_fnmadd_ps(_mm256_set1_ps(test.shear[1]), along, y);
    ([x, y], along)
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn edge(p: [__m256; 2], q: [__m256; 2]) -> __m256 {
    _mm256_fmsub_ps(p[0], q[1], _mm256_mul_ps(p[1], q[0]))
}

/// The decision for one triangle, with its three corners in a register.
///
/// Inlined, so that a hit stays in registers. (Returned through memory, it took 6 % of the time of random rays in a game level:
/// `cargo xtask rays --scenes DIR --scene czest2ctf`, 2026-11-30.)
#[inline(always)]
fn decide(simd: Avx2, test: &Avx2Test, block: &Block, lane: usize) -> Option<Hit> {
    let from_origin = |axis: usize| {
        let corners = block.corners.each_ref().map(|rows| {
            let base: *const u8 = (&raw const *rows).cast();
            // SAFETY: the offset of a row of the corner.
            let row = unsafe { &*base.add(test.rows[axis]).cast::<[f32; WIDTH]>() };
            row[lane]
        });
        simd.triple(corners).minus(test.origin[axis].into())
    };
    let corners = [from_origin(0), from_origin(1), from_origin(2)];
    let [dx, dy, along, _] = test.direction;
    let [shear_x, shear_y, scale] = simd.triple([dx, dy, 1.0]).over(along.into());
    let view = View {
        shear: [shear_x, shear_y],
        scale,
    };
    view.hit(corners, [test.t_min, test.t_max], block.triangles[lane])
}
