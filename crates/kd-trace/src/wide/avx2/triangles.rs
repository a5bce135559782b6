//! Blocks of triangles: which of them a ray may hit, and between which distances.
//!
//! The computation in f32 uses fused multiply-adds and bounds of its own. The [decision](crate::decision) is that of all
//! traversals.

use std::arch::x86_64::*;
use std::ops::ControlFlow;

use kd_core::Hit;
use kd_simd::{Avx2, Simd as _, Three, Triple as _};
use kd_wide::{Block, WIDTH};

use super::nodes::{Numbers, sizes};
use super::{ROW, read_alone};
use crate::collect::Collect;
use crate::decision::{Sees, View};
use crate::planes::{Frame, PER_STEP};
use crate::probe::Probe;
use crate::triangle::{BLUR, SLOPE};

const U: f32 = f32::EPSILON / 2.0;

/// A usual ray, prepared for blocks. The three axes are those of [`TriangleTest`](crate::triangle::TriangleTest): across, across
/// and along.
///
/// A *depth* is a distance along, in scene units, towards the direction of the ray.
#[repr(C, align(16))]
pub(crate) struct TriangleRay {
    origin: [f32; 4],
    direction: [f32; 4],
    shear: [f32; 4],
    /// Byte offsets of rows of a corner.
    rows: [usize; 3],
    /// The slope of the bound of edge functions.
    slope: f32,
    least: f32,
    /// -0.0 for a ray with a positive direction along, whose coordinates are negated.
    turn: f32,
    /// The largest error of a depth by underflow.
    underflow: f32,
    /// The depth where the ray starts.
    start: f32,
    /// Depth per unit of `t`, and its inverse.
    pub(super) speed: f32,
    pub(super) per_depth: f32,
    t_min: f32,
    t_max: f32,
}

impl TriangleRay {
    /// The ray must be [usual](super::nodes::NodeRay::usual) for the frame.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn new(ray: &Numbers, frame: &Frame) -> Self {
        /// The axis of the largest size, the first among equals, by whether x < y, y < z and x < z.
        const ALONG: [usize; 8] = [0, 1, 0, 2, 1, 1, 2, 2];
        /// By axis along: both axes across, and along.
        const AXES: [[i32; 4]; 3] = [[1, 2, 0, 3], [2, 0, 1, 3], [0, 1, 2, 3]];
        const ROWS: [[usize; 3]; 3] = [[ROW, 2 * ROW, 0], [2 * ROW, 0, ROW], [0, ROW, 2 * ROW]];
        let size = sizes(ray.direction);
        let less = _mm_cmplt_ps(
            _mm_permute_ps::<0b00_00_01_00>(size),
            _mm_permute_ps::<0b00_10_10_01>(size),
        );
        let along = ALONG[(_mm_movemask_ps(less).cast_unsigned() & 0b111) as usize];
        let axes = &AXES[along];
        // SAFETY: a load of four numbers from an array of four.
        let turn = unsafe { _mm_loadu_si128(axes.as_ptr().cast()) };
        let in_memory = |x: __m128| bytemuck::must_cast::<__m128, [f32; 4]>(x);
        let direction = _mm_permutevar_ps(ray.direction, turn);
        let all_along = _mm_permute_ps::<0b10_10_10_10>(direction);
        let signed_speed = _mm_cvtss_f32(all_along);
        let speed = signed_speed.abs();
        let reach = ray.reach(frame);
        let slope = SLOPE * reach;
        Self {
            origin: in_memory(_mm_permutevar_ps(ray.origin, turn)),
            direction: in_memory(direction),
            shear: in_memory(_mm_div_ps(direction, all_along)),
            rows: ROWS[along],
            slope,
            least: slope * (BLUR * reach) + f32::MIN_POSITIVE,
            turn: if signed_speed > 0.0 { -0.0 } else { 0.0 },
            underflow: PER_STEP * speed + f32::MIN_POSITIVE,
            start: ray.t_min * speed,
            speed,
            per_depth: 1.0 / speed,
            t_min: ray.t_min,
            t_max: ray.t_max,
        }
    }
}

/// Triangles of a block that a ray may hit, a bit for each.
#[derive(Clone, Copy)]
pub(super) struct Candidates {
    /// Lanes that the ray may hit between its start and the limit.
    pub(super) lanes: u32,
    /// Those of them that it surely hits there.
    pub(super) sure: u32,
    /// The depth of a hit is between these.
    first: __m256,
    last: __m256,
}

/// The triangles of a block that [`TriangleTest::certainly_misses`](crate::triangle::TriangleTest::certainly_misses) does not
/// reject, and whose hit may be between the start of the ray and the depth `limit`. `None` if there is none.
///
/// The first part is the computation of that function, with fused multiply-adds, which only makes its errors smaller. Up to
/// [`MOST_USUAL`](kd_wide::MOST_USUAL) nothing overflows: sheared coordinates are below 2³⁹, edge functions below 2⁸⁰.
///
/// # The closer bound
///
/// The second part tests the few remaining lanes by a closer bound. Let u = 2⁻²⁴. All coordinates of a corner, from the origin,
/// are at most L = M + Z, the largest sheared coordinate and the largest one along, so that L replaces the reach R. The
/// errors of sheared coordinates are: uL moving a corner, uZ and uZ of the shear and its product's factor, uM rounding it, and
/// u/4 M of the rounding to 26 bits that decides: 4uL and a little for e. Then 4uM² + 4eM + 2e² ≤ 20uLM and a little bounds the
/// error of a weight, an edge function; the bound B here is twice that, 40uL (M + 8uL). Underflow is less than the smallest
/// normal number, which is added.
///
/// # Triangles that are surely hit
///
/// Where all three weights w are beyond B, on one side, those that [decide](View::hit) are on the same side and not zero. The
/// same holds for the finer weights, whose coordinates are not rounded to 26 bits, and their sum is above
/// 3B - 3B/2 ≥ 60uM², so they are sound, and the hit is [the one that they give](View::sure_hit).
///
/// # The interval of depths
///
/// Let z be the depth of a corner, d = z - `z_a` for corners b and c and 0 for a, S the larger |d|, W the weights of the
/// decision, D = Σ w, f = Σ w d / D, and f' = Σ W d / Σ W. The hit is at the depth `z_a` + f'. Since
///
/// ```text
/// f - f' = Σ (w - W) (d - f') / D
/// ```
/// and each |w - W| ≤ B/2, and f' is between the least and the largest d, whose difference is at most 2S, so that the three
/// |d - f'| add up to at most 4S, we have |f - f'| ≤ 2BS / |D|. The first term below is half as much again.
///
/// The second term is for rounding, with S ≤ 2Z ≤ 2L and Σ |w d / D| ≤ S: 4u of each w / D, together 8uL; u of each d and
/// 2uZ of its two coordinates, together 4uL; uL of the coordinate of a; uL for each of two fused multiply-adds; uL when `t` is
/// rounded to f32; uL when an end is; uL of the limit or the start, which are products of a `t` near this one. That is 18uL,
/// while we allow 24uL, and `PER_STEP` where `t` underflows.
///
/// Where a weight is within B, the hit is somewhere in the triangle, between `z_a` - S and `z_a` + S.
///
/// Each `Caller` gets a copy of its own, which the compiler inlines.
#[allow(
    clippy::extra_unused_type_parameters,
    reason = "it makes a copy for each caller"
)]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) fn candidates<Caller>(
    ray: &TriangleRay,
    block: &Block,
    limit: f32,
) -> Option<Candidates> {
    let sign = _mm256_set1_ps(-0.0);
    let away = |x: __m256| _mm256_andnot_ps(sign, x);
    let minus = |x: __m256| _mm256_xor_ps(sign, x);
    let largest = |a: __m256, b: __m256, c: __m256| _mm256_max_ps(_mm256_max_ps(a, b), c);
    let (a, depth_a) = sheared(ray, &block.corners[0]);
    let (b, depth_b) = sheared(ray, &block.corners[1]);
    let (c, depth_c) = sheared(ray, &block.corners[2]);
    let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
    let size = |[x, y]: [__m256; 2]| _mm256_max_ps(away(x), away(y));
    let size = largest(size(a), size(b), size(c));
    let bound = _mm256_fmadd_ps(in_all(&ray.slope), size, in_all(&ray.least));
    let least = _mm256_min_ps(_mm256_min_ps(u, v), w);
    let most = largest(u, v, w);
    // False for NaN: in lanes without a triangle.
    let above = _mm256_cmp_ps::<_CMP_GE_OQ>(least, minus(bound));
    let below = _mm256_cmp_ps::<_CMP_LE_OQ>(most, bound);
    let left = _mm256_or_ps(above, below);
    if _mm256_testz_ps(left, left) != 0 {
        return None;
    }

    let area = _mm256_add_ps(_mm256_add_ps(u, v), w);
    let inverse = _mm256_div_ps(_mm256_set1_ps(1.0), area);
    let (to_b, to_c) = (
        _mm256_sub_ps(depth_b, depth_a),
        _mm256_sub_ps(depth_c, depth_a),
    );
    let reach = _mm256_add_ps(size, largest(away(depth_a), away(depth_b), away(depth_c)));
    let bound = _mm256_fmadd_ps(
        _mm256_mul_ps(reach, _mm256_set1_ps(40.0 * U)),
        _mm256_fmadd_ps(reach, _mm256_set1_ps(8.0 * U), size),
        _mm256_set1_ps(f32::MIN_POSITIVE),
    );
    let is_inside = _mm256_or_ps(
        _mm256_cmp_ps::<_CMP_GT_OQ>(least, bound),
        _mm256_cmp_ps::<_CMP_LT_OQ>(most, minus(bound)),
    );
    let depth = _mm256_fmadd_ps(
        _mm256_mul_ps(v, inverse),
        to_b,
        _mm256_fmadd_ps(_mm256_mul_ps(w, inverse), to_c, depth_a),
    );
    let spread = _mm256_max_ps(away(to_b), away(to_c));
    let rounding = _mm256_fmadd_ps(reach, _mm256_set1_ps(24.0 * U), in_all(&ray.underflow));
    let error = _mm256_fmadd_ps(
        _mm256_mul_ps(away(inverse), spread),
        _mm256_mul_ps(bound, _mm256_set1_ps(3.0)),
        rounding,
    );
    let depth = _mm256_blendv_ps(depth_a, depth, is_inside);
    let depth = _mm256_xor_ps(depth, in_all(&ray.turn));
    let error = _mm256_blendv_ps(_mm256_add_ps(spread, rounding), error, is_inside);
    let (first, last) = (_mm256_sub_ps(depth, error), _mm256_add_ps(depth, error));
    let (start, limit) = (in_all(&ray.start), _mm256_set1_ps(limit));
    let is_out = _mm256_or_ps(
        _mm256_cmp_ps::<_CMP_GT_OQ>(first, limit),
        _mm256_cmp_ps::<_CMP_LT_OQ>(last, start),
    );
    let is_candidate = _mm256_andnot_ps(is_out, left);
    let lanes = _mm256_movemask_ps(is_candidate).cast_unsigned();
    if lanes == 0 {
        return None;
    }
    let is_between = _mm256_and_ps(
        _mm256_cmp_ps::<_CMP_GT_OQ>(first, start),
        _mm256_cmp_ps::<_CMP_LT_OQ>(last, limit),
    );
    let is_sure = _mm256_and_ps(_mm256_and_ps(is_inside, is_between), is_candidate);
    Some(Candidates {
        lanes,
        sure: _mm256_movemask_ps(is_sure).cast_unsigned(),
        first,
        last,
    })
}

impl Candidates {
    /// Without those that are behind a sure one.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn in_front(self) -> Self {
        if self.sure == 0 || self.lanes & (self.lanes - 1) == 0 {
            return self;
        }
        let mut ends = [f32::INFINITY; WIDTH];
        // SAFETY: room for eight.
        unsafe { _mm256_storeu_ps(ends.as_mut_ptr(), self.last) };
        let mut limit = f32::INFINITY;
        let mut sure = self.sure;
        while sure != 0 {
            limit = kd_simd::min(ends[sure.trailing_zeros() as usize % WIDTH], limit);
            sure &= sure - 1;
        }
        let is_behind = _mm256_cmp_ps::<_CMP_GT_OQ>(self.first, _mm256_set1_ps(limit));
        let behind = _mm256_movemask_ps(is_behind).cast_unsigned();
        Self {
            lanes: self.lanes & !behind,
            sure: self.sure & !behind,
            ..self
        }
    }

    /// The least and the largest depth of a hit in a lane.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn interval(&self, lane: u32) -> [f32; 2] {
        let lane = _mm256_castsi128_si256(_mm_cvtsi32_si128(lane.cast_signed()));
        [self.first, self.last].map(|x| _mm256_cvtss_f32(_mm256_permutevar8x32_ps(x, lane)))
    }
}

/// The lanes of a set, in order.
pub(super) struct Lanes(pub(super) u32);

impl Iterator for Lanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize % WIDTH;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

/// A corner of eight triangles, negated: from the corner to the origin, across and along.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn sheared(ray: &TriangleRay, corner: &[[f32; WIDTH]; 3]) -> ([__m256; 2], __m256) {
    let from_origin = |axis: usize| {
        // SAFETY: a row is aligned and eight numbers long.
        let row = unsafe { _mm256_load_ps(row_of(corner, ray.rows[axis]).as_ptr()) };
        _mm256_sub_ps(in_all(&ray.origin[axis]), row)
    };
    let along = from_origin(2);
    let x = _mm256_fnmadd_ps(in_all(&ray.shear[0]), along, from_origin(0));
    let y = _mm256_fnmadd_ps(in_all(&ray.shear[1]), along, from_origin(1));
    ([x, y], along)
}

/// A number of a ray, which may just have been written, in all lanes.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn in_all(number: &f32) -> __m256 {
    _mm256_set1_ps(read_alone(number))
}

#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn edge(p: [__m256; 2], q: [__m256; 2]) -> __m256 {
    _mm256_fmsub_ps(p[0], q[1], _mm256_mul_ps(p[1], q[0]))
}

/// The row of a corner at one of [`TriangleRay::rows`].
#[inline(always)]
fn row_of(corner: &[[f32; WIDTH]; 3], at: usize) -> &[f32; WIDTH] {
    let base: *const u8 = (&raw const *corner).cast();
    // SAFETY: the offset of a row of the corner.
    unsafe { &*base.add(at).cast::<[f32; WIDTH]>() }
}

#[inline(always)]
fn widened([a, b, c]: [f32; 3]) -> Three<f64> {
    Three([a.into(), b.into(), c.into()])
}

impl TriangleRay {
    /// A coordinate of the three corners of a triangle.
    #[inline(always)]
    fn coordinates(&self, block: &Block, lane: usize, axis: usize) -> [f32; 3] {
        let [a, b, c] = &block.corners;
        let row = self.rows[axis];
        [
            row_of(a, row)[lane],
            row_of(b, row)[lane],
            row_of(c, row)[lane],
        ]
    }

    /// The decision for one triangle, with its three corners in a register.
    ///
    /// Inlined, so that a hit stays in registers. (Returned through memory, it took 6 % of the time of random rays in a game level:
    /// `cargo xtask rays --scenes DIR --scene czest2ctf`, 2026-11-30.)
    #[inline(always)]
    pub(super) fn decide(
        &self,
        simd: Avx2,
        block: &Block,
        lane: usize,
        sees: impl Sees,
    ) -> Option<Hit> {
        let corners = [
            simd.triple(self.coordinates(block, lane, 0))
                .minus(self.origin[0].into()),
            simd.triple(self.coordinates(block, lane, 1))
                .minus(self.origin[1].into()),
            simd.triple(self.coordinates(block, lane, 2))
                .minus(self.origin[2].into()),
        ];
        let [dx, dy, along, _] = self.direction;
        let [shear_x, shear_y, scale] = simd.triple([dx, dy, 1.0]).over(along.into());
        let view = View {
            shear: [shear_x, shear_y],
            scale,
        };
        let range = [self.t_min, self.t_max];
        view.hit(corners, range, sees, block.triangles[lane])
    }

    /// Decides some lanes of a block, and passes their hits to a collector. Breaks if the collector does.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline(never)]
    pub(super) fn take_each<V: Sees, C: Collect, P: Probe>(
        &self,
        simd: Avx2,
        block: &Block,
        lanes: u32,
        sees: V,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        for lane in Lanes(lanes) {
            probe.decision();
            if let Some(hit) = self.decide(simd, block, lane, sees) {
                collector.take(hit)?;
            }
        }
        ControlFlow::Continue(())
    }

    /// The hit of a triangle that is [surely hit](candidates).
    #[inline(always)]
    pub(super) fn hit(&self, block: &Block, lane: usize) -> Hit {
        let corners = [
            widened(self.coordinates(block, lane, 0)).minus(self.origin[0].into()),
            widened(self.coordinates(block, lane, 1)).minus(self.origin[1].into()),
            widened(self.coordinates(block, lane, 2)).minus(self.origin[2].into()),
        ];
        let [dx, dy, along] = widened([self.direction[0], self.direction[1], self.direction[2]]).0;
        let view = View {
            shear: [dx / along, dy / along],
            scale: 1.0 / along,
        };
        view.sure_hit(corners, block.triangles[lane])
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::{Aabb, Ray};
    use kd_oracle::effort;
    use kd_oracle::rng::Rng;

    use super::super::nodes::{NodeRay, Prepared};
    use super::*;
    use crate::decision::BothSides;

    /// Between -1 and 1.
    fn number(rng: &mut Rng) -> f32 {
        2.0 * rng.unit() - 1.0
    }

    fn point(rng: &mut Rng) -> Vec3 {
        Vec3::new(number(rng), number(rng), number(rng))
    }

    /// A power of two.
    fn power(rng: &mut Rng, exponents: std::ops::Range<i32>) -> f32 {
        let count = usize::try_from(exponents.end - exponents.start).expect("a range");
        let exponent = exponents.start + i32::try_from(rng.below(count)).expect("few");
        2.0_f32.powi(exponent)
    }

    /// Eight triangles, fat, thin or flat, along or across the ray, near a point; and a ray through it or past an edge of one.
    fn scene(rng: &mut Rng) -> (Block, Aabb, Ray) {
        let scale = power(rng, -40..34);
        let center = scale * point(rng);
        let origin = center - scale * power(rng, -3..3) * point(rng);
        let along = (center - origin).normalize_or(Vec3::X);
        let mut block = Block::EMPTY;
        let mut bounds = Aabb::EMPTY;
        let mut target = center;
        for lane in 0..WIDTH {
            let size = scale * power(rng, -16..0);
            let (deep, flat) = (power(rng, -3..8), power(rng, -20..1));
            let corner = |rng: &mut Rng| {
                let mut p = point(rng);
                p.z *= flat;
                center + size * (p + deep * number(rng) * along)
            };
            let corners = [corner(rng), corner(rng), corner(rng)];
            if lane == 0 {
                let (u, v) = (rng.unit(), rng.unit());
                let (u, v) = if u + v > 1.0 {
                    (1.0 - u, 1.0 - v)
                } else {
                    (u, v)
                };
                let v = if rng.below(4) == 0 { 0.0 } else { v };
                target = corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[0]);
            }
            block.set(lane, 7 * u32::try_from(lane).expect("few"), corners);
            for corner in corners {
                bounds = bounds.union(&Aabb {
                    min: corner,
                    max: corner,
                });
            }
        }
        let ray = Ray::new(origin, (target - origin) / scale * power(rng, -6..6));
        (block, bounds, ray)
    }

    /// Decided hits are candidates, their depths are in the intervals, and triangles that are surely hit are decided alike. Part of
    /// each bound is needed.
    #[test]
    fn intervals_hold_decided_hits() {
        let Some(simd) = Avx2::detect() else { return };
        let mut rng = Rng(1);
        let (mut sure, mut unsure) = (0, 0);
        let (mut of_error, mut of_rounding) = (0.0_f64, 0.0_f64);
        for _ in 0..effort::cases(30_000, 1_000_000) {
            let (block, bounds, ray) = scene(&mut rng);
            let frame = Frame::new(&bounds);
            // SAFETY: there is an `Avx2`.
            let numbers = unsafe { Numbers::of(&ray) };
            // SAFETY: the same.
            let prepared = unsafe { NodeRay::usual(&numbers, &frame) };
            if !matches!(prepared, Prepared::Usual(_)) {
                continue;
            }
            // SAFETY: the same.
            let test = unsafe { TriangleRay::new(&numbers, &frame) };
            // SAFETY: the same.
            let found = unsafe { candidates::<()>(&test, &block, f32::MAX) };
            for lane in 0..WIDTH {
                let decided = test.decide(simd, &block, lane, BothSides);
                let is_in = |lanes: u32| lanes >> lane & 1 != 0;
                let Some(hit) = decided else {
                    let is_sure = found.is_some_and(|found| is_in(found.sure));
                    assert!(!is_sure, "{ray:?} surely hits lane {lane} of {block:?}");
                    continue;
                };
                let found = found.filter(|found| is_in(found.lanes));
                let found = found.unwrap_or_else(|| panic!("{ray:?}: lane {lane} of {block:?}"));
                let lane_number = u32::try_from(lane).expect("few");
                // SAFETY: the same.
                let [first, last] = unsafe { found.interval(lane_number) }.map(f64::from);
                let depth = f64::from(hit.t) * f64::from(test.speed);
                assert!(
                    (first..=last).contains(&depth),
                    "{ray:?}: lane {lane} of {block:?}"
                );
                if !is_in(found.sure) {
                    unsure += 1;
                    continue;
                }
                sure += 1;
                assert_eq!(
                    test.hit(&block, lane),
                    hit,
                    "{ray:?}: lane {lane} of {block:?}"
                );
                let error = (depth - 0.5 * (first + last)).abs();
                let bound = 0.5 * (last - first);
                // The reach is at least the depth.
                let rounding = 24.0 * f64::from(U) * depth.abs();
                if bound < 2.0 * rounding {
                    of_rounding = of_rounding.max(error / rounding);
                } else if bound > 8.0 * rounding {
                    of_error = of_error.max(error / bound);
                }
            }
        }
        assert!(
            sure > 1000 && unsure > 1000,
            "{sure} sure hits, {unsure} others"
        );
        // With terms a hundredth as large, hits are outside.
        assert!(of_error > 0.01, "{of_error} of the first term");
        assert!(of_rounding > 0.05, "{of_rounding} of the second term");
    }
}
