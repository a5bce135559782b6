//! A ray for wide nodes and blocks with AVX2: eight boxes and eight triangles at a time.
//!
//! `unsafe` code is here for two reasons: an instruction of AVX2 or FMA, which the [`Avx2`] in each [`Avx2Ray`] proves to exist,
//! or a read of eight floats at the offset of a row of a node or a block.
#![allow(
    unsafe_code,
    reason = "intrinsics; the portable twin is in `portable`, and tests compare both with brute force"
)]
#![allow(
    clippy::multiple_unsafe_ops_per_block,
    reason = "nearly every line is an instruction, or an address and a load; each block says what makes it safe"
)]

mod triangles;

use std::arch::x86_64::*;
use std::ops::ControlFlow;

use glam::Vec3;
use kd_core::Ray;
use kd_simd::Avx2;
use kd_wide::{Block, Child, WIDTH, WideNode};

use super::stack::Pending;
use super::walk::WideRay;
use crate::collect::Collect;
use crate::planes::{Frame, LEAST_SLOPE, PER_ORIGIN, PER_REACH, PER_STEP, RELATIVE, unit_of};
use crate::probe::Probe;
use triangles::Avx2Test;

/// Bytes of a row of a node or a block.
const ROW: usize = 4 * WIDTH;

/// A ray on a processor with AVX2 and FMA.
pub(crate) struct Avx2Ray {
    /// The proof that the processor has AVX2.
    simd: Avx2,
    /// Steps per unit of each axis.
    inverse: [f32; 4],
    /// Added for a near face: minus the origin's steps, minus the bound.
    enter: [f32; 4],
    /// Added for a far face: minus the origin's steps, plus the bound.
    exit: [f32; 4],
    /// Byte offsets in a node: of the near faces, and of the order for this octant.
    near: [usize; 3],
    order: usize,
    /// Its ends, in steps.
    span: [f32; 2],
    /// Steps per unit of `t`.
    steps: f32,
    test: Avx2Test,
}

/// Reads a number by a load of its own.
///
/// Rays are often written number by number just before. A load of several numbers at once, which the compiler makes of
/// neighboring loads, then waits until all of them have left the store buffer.
#[inline(always)]
fn read_alone(number: &f32) -> f32 {
    // SAFETY: a reference is valid for reads.
    unsafe { std::ptr::from_ref(number).read_volatile() }
}

/// (x, y, z, 0).
///
/// # Safety
///
/// The processor has AVX2.
#[inline(always)]
unsafe fn in_register(v: &Vec3) -> __m128 {
    // SAFETY: the caller's.
    unsafe {
        let [x, y, z] = [&v.x, &v.y, &v.z].map(|number| _mm_set_ss(read_alone(number)));
        _mm_insert_ps::<0x20>(_mm_insert_ps::<0x10>(x, y), z)
    }
}

/// A power of two that f32 has.
#[allow(clippy::cast_possible_truncation, reason = "it is exact")]
fn power_of_two(x: f64) -> f32 {
    x as f32
}

impl Avx2Ray {
    /// `None` if the ray cannot hit anything.
    ///
    /// Inlined, so that its many fields are written at their final place. (A call that returns them copies them: 30 ns a ray.)
    #[inline(always)]
    pub(crate) fn new(simd: Avx2, ray: &Ray, frame: &Frame) -> Option<Self> {
        // SAFETY: there is an `Avx2`, so there are AVX2 and FMA; and loads of four floats from arrays of four.
        unsafe {
            let zero = _mm_setzero_ps();
            let sign = _mm_set1_ps(-0.0);
            let away = |x: __m128| _mm_andnot_ps(sign, x);
            let largest_of = |sizes: __m128| {
                let pairs = _mm_max_ps(sizes, _mm_permute_ps::<0b00_00_10_01>(sizes));
                _mm_max_ss(pairs, _mm_permute_ps::<0b00_00_00_10>(sizes))
            };
            let (origin, exact) = (in_register(&ray.origin), in_register(&ray.direction));
            let (t_min, t_max) = (read_alone(&ray.t_min), read_alone(&ray.t_max));

            // Zero, but for infinity and NaN.
            let finite = _mm_add_ps(_mm_mul_ps(origin, zero), _mm_mul_ps(exact, zero));
            let is_finite = _mm_movemask_ps(_mm_cmpeq_ps(finite, zero)) == 0b1111;
            if !(is_finite & (t_min <= t_max) & (ray.mask != 0)) {
                return None;
            }
            /// Directions beyond this are scaled to steps, so that nothing below overflows or loses bits.
            const USUAL: f32 = (1_u64 << 62) as f32;
            let mut direction = exact;
            let mut sizes = away(direction);
            let mut largest = _mm_cvtss_f32(largest_of(sizes));
            let mut steps = 1.0;
            if !(1.0 / USUAL..=USUAL).contains(&largest) {
                if largest == 0.0 {
                    return None;
                }
                let unit = unit_of(ray.direction);
                steps = power_of_two(unit);
                let scaled = (ray.direction.as_dvec3() / unit).as_vec3();
                direction = _mm_setr_ps(scaled.x, scaled.y, scaled.z, 0.0);
                sizes = away(direction);
                largest = _mm_cvtss_f32(largest_of(sizes));
            }
            let least = _mm_set1_ps(largest * LEAST_SLOPE);
            let slopes = _mm_or_ps(_mm_max_ps(sizes, least), _mm_and_ps(sign, direction));
            let inverse = _mm_div_ps(_mm_set1_ps(1.0), slopes);

            let [lower, upper] = frame
                .corners
                .each_ref()
                .map(|corner| _mm_loadu_ps(corner.as_ptr()));
            let reaches = _mm_max_ps(
                away(_mm_sub_ps(lower, origin)),
                away(_mm_sub_ps(upper, origin)),
            );
            let reach = _mm_cvtss_f32(largest_of(reaches));
            let pad = _mm_fmadd_ps(
                _mm_set1_ps(RELATIVE),
                reaches,
                _mm_set1_ps(frame.distance + PER_REACH * reach),
            );
            let pad = _mm_fmadd_ps(_mm_set1_ps(PER_ORIGIN), away(origin), pad);
            let pad = _mm_fmadd_ps(pad, away(inverse), _mm_set1_ps(PER_STEP * steps));
            let from = _mm_mul_ps(_mm_xor_ps(origin, sign), inverse);
            // Where that overflows, the axis does not count.
            let infinity = _mm_set1_ps(f32::INFINITY);
            let is_lost = _mm_cmpeq_ps(away(from), infinity);
            let enter = _mm_blendv_ps(_mm_sub_ps(from, pad), _mm_xor_ps(sign, infinity), is_lost);
            let exit = _mm_blendv_ps(_mm_add_ps(from, pad), infinity, is_lost);
            let octant = (_mm_movemask_ps(direction).cast_unsigned() & 0b111) as usize;
            // A hit is at a finite t.
            let span = [t_min * steps, t_max.min(f32::MAX) * steps];

            let in_memory = |x: __m128| {
                let mut array = [0.0; 4];
                _mm_storeu_ps(array.as_mut_ptr(), x);
                array
            };
            let near = [0, 1, 2].map(|axis| (2 * axis + (octant >> axis & 1)) * ROW);
            Some(Self {
                simd,
                inverse: in_memory(inverse),
                enter: in_memory(enter),
                exit: in_memory(exit),
                near,
                order: std::mem::offset_of!(WideNode, orders) + size_of::<u32>() * octant,
                span,
                steps,
                test: Avx2Test::new([t_min, t_max], [origin, exact, direction], reach, steps),
            })
        }
    }
}

impl WideRay for Avx2Ray {
    #[inline(always)]
    fn end(&self) -> f32 {
        self.span[1]
    }

    #[inline(always)]
    fn steps(&self, t: f32) -> f32 {
        t * self.steps
    }

    #[inline(always)]
    fn enter<const ANY: bool>(
        &self,
        node: &WideNode,
        limit: f32,
        pending: &mut Pending<'_>,
    ) -> Option<Child> {
        // SAFETY: there is such a ray, so there is AVX2.
        unsafe { enter::<ANY>(self, node, limit, pending) }
    }

    #[inline(always)]
    fn enter_or_pop(&self, node: &WideNode, limit: f32, pending: &mut Pending<'_>) -> Child {
        // SAFETY: there is such a ray, so there is AVX2.
        unsafe { enter_or_pop(self, node, limit, pending) }
    }

    /// Not inlined: the loop around it would keep the constants of triangles on its stack, and prepare them for rays that meet
    /// no leaf.
    #[inline(never)]
    fn visit<C: Collect, P: Probe>(
        &self,
        blocks: &[Block],
        limit: f32,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // SAFETY: there is such a ray, so there is AVX2.
        unsafe { triangles::visit(self.simd, &self.test, blocks, limit, collector, probe) }
    }
}

/// For each set of lanes, its lanes in order, a byte each.
static LANES_OF: [u64; 256] = lanes_of();

const fn lanes_of() -> [u64; 256] {
    let mut table = [0; 256];
    let mut set = 0;
    while set < 256 {
        let (mut lane, mut place) = (0, 0);
        while lane < 8 {
            if set >> lane & 1 != 0 {
                table[set] |= lane << (8 * place);
                place += 1;
            }
            lane += 1;
        }
        set += 1;
    }
    table
}

#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn enter<const ANY: bool>(
    ray: &Avx2Ray,
    node: &WideNode,
    limit: f32,
    pending: &mut Pending<'_>,
) -> Option<Child> {
    let boxes = meet(ray, node, limit);
    let met = _mm256_movemask_ps(boxes.is_met).cast_unsigned();
    if met == 0 {
        return None;
    }
    if met & (met - 1) == 0 {
        // The most frequent case: without order and stack, the next node is known sooner.
        return Some(node.children[met.trailing_zeros() as usize % WIDTH]);
    }
    if ANY {
        push_in_lanes(node, met, pending);
        // SAFETY: they have been written. The last one is not pushed.
        unsafe { pending.grow(met.count_ones() as usize - 1) };
        return Some(node.children[met.ilog2() as usize % WIDTH]);
    }
    let order = order(ray, node);
    let met = push(node, order, &boxes, pending);
    // SAFETY: they have been written. The nearest one is not pushed.
    unsafe { pending.grow(met.count_ones() as usize - 1) };
    let nearest = met.ilog2();
    Some(node.children[(order >> (3 * nearest)) as usize % WIDTH])
}

/// Without a branch that depends on the ray.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn enter_or_pop(ray: &Avx2Ray, node: &WideNode, limit: f32, pending: &mut Pending<'_>) -> Child {
    let boxes = meet(ray, node, limit);
    let met = push(node, order(ray, node), &boxes, pending);
    // SAFETY: they have been written.
    unsafe { pending.grow(met.count_ones() as usize) };
    pending.pop_last()
}

/// Where a ray enters eight boxes, and which boxes it meets.
#[derive(Clone, Copy)]
struct Met {
    enters: __m256,
    is_met: __m256,
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn meet(ray: &Avx2Ray, node: &WideNode, limit: f32) -> Met {
    let base: *const u8 = (&raw const *node).cast();
    // SAFETY: `at` is the offset of a row of the node.
    let row = |at: usize| unsafe { _mm256_load_ps(base.add(at).cast()) };
    let inverse = |axis: usize| _mm256_set1_ps(ray.inverse[axis]);
    let entered = |axis: usize| {
        let add = _mm256_set1_ps(ray.enter[axis]);
        _mm256_fmadd_ps(row(ray.near[axis]), inverse(axis), add)
    };
    // The far face is the other row of the pair.
    let left = |axis: usize| {
        let add = _mm256_set1_ps(ray.exit[axis]);
        _mm256_fmadd_ps(row(ray.near[axis] ^ ROW), inverse(axis), add)
    };
    // Of a NaN and a number both instructions return the second operand, here a number: a box that overflows is visited.
    let enters = _mm256_max_ps(
        _mm256_max_ps(entered(0), entered(1)),
        _mm256_max_ps(entered(2), _mm256_set1_ps(ray.span[0])),
    );
    let leaves = _mm256_min_ps(
        _mm256_min_ps(left(0), left(1)),
        _mm256_min_ps(left(2), _mm256_set1_ps(limit)),
    );
    Met {
        enters,
        is_met: _mm256_cmp_ps::<_CMP_LE_OQ>(enters, leaves),
    }
}

/// The lanes of a node from far to near, three bits each.
#[inline(always)]
fn order(ray: &Avx2Ray, node: &WideNode) -> u32 {
    let base: *const u8 = (&raw const *node).cast();
    // SAFETY: the offset of an order.
    unsafe { base.add(ray.order).cast::<u32>().read() }
}

/// Writes the children that the ray meets to the room of the stack, in order. Returns a bit for each place in the order whose
/// child is met.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn push(node: &WideNode, order: u32, boxes: &Met, pending: &mut Pending<'_>) -> u32 {
    let lanes = _mm256_srlv_epi32(
        _mm256_set1_epi32(order.cast_signed()),
        _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21),
    );
    let is_met = _mm256_permutevar8x32_ps(boxes.is_met, lanes);
    let met = _mm256_movemask_ps(is_met).cast_unsigned();
    let kept = _mm256_permutevar8x32_epi32(lanes, lanes_in_front(met));
    let (enters, children) = pending.room();
    // SAFETY: the room is for eight.
    unsafe { _mm256_storeu_ps(enters, _mm256_permutevar8x32_ps(boxes.enters, kept)) };
    // SAFETY: the room is for eight.
    unsafe { _mm256_storeu_si256(children.cast(), children_in(node, kept)) };
    met
}

/// Writes the children of some lanes to the room of the stack, without distances.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn push_in_lanes(node: &WideNode, lanes: u32, pending: &mut Pending<'_>) {
    let (_, children) = pending.room();
    // SAFETY: the room is for eight.
    unsafe { _mm256_storeu_si256(children.cast(), children_in(node, lanes_in_front(lanes))) };
}

/// The lanes of a set, in order, in front.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn lanes_in_front(set: u32) -> __m256i {
    let lanes = &raw const LANES_OF[set as usize % LANES_OF.len()];
    // SAFETY: there are eight bytes.
    _mm256_cvtepu8_epi32(unsafe { _mm_loadl_epi64(lanes.cast()) })
}

/// The children in some lanes.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn children_in(node: &WideNode, lanes: __m256i) -> __m256i {
    // SAFETY: there are eight children.
    let all = unsafe { _mm256_load_si256(node.children.as_ptr().cast()) };
    _mm256_permutevar8x32_epi32(all, lanes)
}
