//! Nodes: where a ray enters eight boxes, and which of their children it visits in which order.

use std::arch::x86_64::*;

use glam::Vec3;
use kd_core::Ray;
use kd_wide::{Child, WIDTH, WideNode};

use super::{ROW, read_alone};
use crate::planes::{Frame, LEAST_SLOPE, PER_ORIGIN, PER_STEP, RELATIVE};
use crate::wide::stack::Pending;

/// Whether a ray has an empty mask or a culling. Asked before anything is in registers: later, it took up to 1.5 % of the instructions of a
/// ray (`cargo xtask instructions`, 2026-12-01).
#[inline(always)]
pub(super) fn sees_less(ray: &Ray) -> bool {
    ray.mask == 0 || !ray.culling.is_none()
}

/// The numbers of a ray, in registers. The fourth of each vector is 0.
#[derive(Clone, Copy)]
pub(crate) struct Numbers {
    pub(super) origin: __m128,
    pub(super) direction: __m128,
    pub(super) t_min: f32,
    pub(super) t_max: f32,
}

impl Numbers {
    /// The numbers of a ray.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn of(ray: &Ray) -> Self {
        let in_register = |v: Vec3| _mm_setr_ps(v.x, v.y, v.z, 0.0);
        Self {
            origin: in_register(ray.origin),
            direction: in_register(ray.direction),
            t_min: ray.t_min,
            t_max: ray.t_max,
        }
    }

    /// The numbers of a ray that the caller may just have written.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn one_by_one(ray: &Ray) -> Self {
        let in_register = |v: &Vec3| {
            let (x, y, z) = (read_alone(&v.x), read_alone(&v.y), read_alone(&v.z));
            let x_y = _mm_insert_ps::<0x10>(_mm_set_ss(x), _mm_set_ss(y));
            _mm_insert_ps::<0x20>(x_y, _mm_set_ss(z))
        };
        Self {
            origin: in_register(&ray.origin),
            direction: in_register(&ray.direction),
            t_min: read_alone(&ray.t_min),
            t_max: read_alone(&ray.t_max),
        }
    }

    /// The largest component of (corner - origin) over the box, up to rounding.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn reach(&self, frame: &Frame) -> f32 {
        largest_of(self.reaches(frame))
    }

    /// By axis, the largest distance of the origin to a face of the box.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn reaches(&self, frame: &Frame) -> __m128 {
        let [lower, upper] = frame.corners.each_ref().map(|corner| {
            // SAFETY: a load of four numbers from an array of four.
            unsafe { _mm_loadu_ps(corner.as_ptr()) }
        });
        _mm_max_ps(
            sizes(_mm_sub_ps(lower, self.origin)),
            sizes(_mm_sub_ps(upper, self.origin)),
        )
    }
}

/// Absolute values.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) fn sizes(x: __m128) -> __m128 {
    _mm_andnot_ps(_mm_set1_ps(-0.0), x)
}

/// The largest of the first three.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn largest_of(sizes: __m128) -> f32 {
    let pairs = _mm_max_ps(sizes, _mm_permute_ps::<0b00_00_10_01>(sizes));
    _mm_cvtss_f32(_mm_max_ss(pairs, _mm_permute_ps::<0b00_00_00_10>(sizes)))
}

/// A ray, prepared for nodes.
pub(crate) struct NodeRay {
    /// Steps per unit of each axis.
    inverse: __m128,
    /// Added for a near face: minus the origin's steps, minus the bound.
    enter: __m128,
    /// Added for a far face: minus the origin's steps, plus the bound.
    exit: __m128,
    /// Its ends. A step is a unit of `t`.
    pub(super) start: f32,
    pub(super) end: f32,
    /// Where the planes of a node are that the ray meets first, and the order of its children.
    pub(super) rows: &'static Rows,
}

/// Byte offsets in a node, for the rays of an octant.
#[derive(Clone, Copy)]
pub(super) struct Rows {
    faces: Faces,
    order: u32,
}

/// Byte offsets of the faces of eight boxes, for the rays of an octant. Each is that of a row.
#[derive(Clone, Copy)]
pub(super) struct Faces {
    near: [u32; 3],
    far: [u32; 3],
}

/// By octant: bit 0, 1, 2 set where x, y, z is negative.
static ROWS: [Rows; 8] = rows();

#[allow(clippy::cast_possible_truncation, reason = "offsets in 256 bytes")]
const fn rows() -> [Rows; 8] {
    let faces = faces_by_octant(2 * ROW, ROW);
    let mut all = [Rows {
        faces: faces[0],
        order: 0,
    }; 8];
    let mut octant = 0;
    while octant < 8 {
        all[octant].faces = faces[octant];
        all[octant].order =
            (std::mem::offset_of!(WideNode, orders) + size_of::<u32>() * octant) as u32;
        octant += 1;
    }
    all
}

/// The faces of boxes whose lower faces begin at 0, `per_axis` bytes apart by axis, and whose upper ones are `per_side` bytes behind them.
#[allow(clippy::cast_possible_truncation, reason = "offsets in 320 bytes")]
pub(super) const fn faces_by_octant(per_axis: usize, per_side: usize) -> [Faces; 8] {
    let mut all = [Faces {
        near: [0; 3],
        far: [0; 3],
    }; 8];
    let mut octant = 0;
    while octant < 8 {
        let mut axis = 0;
        while axis < 3 {
            let is_downwards = octant >> axis & 1;
            all[octant].near[axis] = (axis * per_axis + is_downwards * per_side) as u32;
            all[octant].far[axis] = (axis * per_axis + (1 - is_downwards) * per_side) as u32;
            axis += 1;
        }
        octant += 1;
    }
    all
}

/// A ray that is about to traverse.
pub(super) enum Prepared {
    /// With its numbers in the usual range.
    Usual(NodeRay),
    /// With other numbers: for [`PortableRay`](crate::wide::portable::PortableRay). Or it cannot hit anything.
    Unusual,
}

impl NodeRay {
    /// A ray whose numbers are in the range where nothing overflows or loses bits: coordinates of the origin up to
    /// [`Frame::usual_origin`], the largest component of the direction between 2⁻³⁰ and 2⁶².
    ///
    /// Mask and culling are not among the numbers: see [`sees_less`].
    ///
    /// Directions below 2⁻⁹⁰ are taken for 2⁻⁹⁰, which is less than 2⁻⁶⁰ of the largest.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn usual(ray: &Numbers, frame: &Frame) -> Prepared {
        const LEAST: f32 = 1.0 / (1_u64 << 30) as f32;
        const MOST: f32 = (1_u64 << 62) as f32;
        const LEAST_COMPONENT: f32 = LEAST * LEAST_SLOPE;
        let directions = sizes(ray.direction);
        let fits = _mm_and_ps(
            _mm_cmple_ps(sizes(ray.origin), _mm_set1_ps(frame.usual_origin)),
            _mm_cmple_ps(directions, _mm_set1_ps(MOST)),
        );
        let is_large = _mm_cmpge_ps(directions, _mm_set1_ps(LEAST));
        if (_mm_movemask_ps(fits) != 0b1111) | (_mm_movemask_ps(is_large) == 0) {
            return Prepared::Unusual;
        }
        // Also false for NaN.
        let is_range = ray.t_min <= ray.t_max;
        if !is_range {
            return Prepared::Unusual;
        }
        let sign = _mm_set1_ps(-0.0);
        let slopes = _mm_or_ps(
            _mm_max_ps(directions, _mm_set1_ps(LEAST_COMPONENT)),
            _mm_and_ps(sign, ray.direction),
        );
        let inverse = _mm_div_ps(_mm_set1_ps(1.0), slopes);
        // The bound: see `planes`.
        let pad = _mm_fmadd_ps(
            _mm_set1_ps(RELATIVE),
            ray.reaches(frame),
            _mm_set1_ps(frame.usual_distance),
        );
        let pad = _mm_fmadd_ps(_mm_set1_ps(PER_ORIGIN), sizes(ray.origin), pad);
        let pad = _mm_fmadd_ps(pad, sizes(inverse), _mm_set1_ps(PER_STEP));
        let from = _mm_mul_ps(_mm_xor_ps(ray.origin, sign), inverse);
        let octant = (_mm_movemask_ps(ray.direction).cast_unsigned() & 0b111) as usize;
        Prepared::Usual(Self {
            inverse,
            enter: _mm_sub_ps(from, pad),
            exit: _mm_add_ps(from, pad),
            start: ray.t_min,
            // A hit is at a finite t.
            end: ray.t_max.min(f32::MAX),
            rows: &ROWS[octant],
        })
    }

    /// A bit for each axis along which the ray moves down.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn octant(&self) -> usize {
        (_mm_movemask_ps(self.inverse).cast_unsigned() & 0b111) as usize
    }

    /// All three axes, in registers of eight.
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    pub(super) fn broadcast(&self) -> Axes {
        let each = |numbers: &__m128| {
            let first: *const f32 = std::ptr::from_ref(numbers).cast();
            // SAFETY: a register in memory is four numbers.
            [0, 1, 2].map(|axis| _mm256_set1_ps(unsafe { first.add(axis).read() }))
        };
        Axes {
            inverse: each(&self.inverse),
            enter: each(&self.enter),
            exit: each(&self.exit),
            start: _mm256_set1_ps(self.start),
        }
    }
}

/// What [`NodeRay`] holds, each number in all lanes.
#[derive(Clone, Copy)]
pub(super) struct Axes {
    inverse: [__m256; 3],
    enter: [__m256; 3],
    exit: [__m256; 3],
    start: __m256,
}

/// Where a ray enters eight boxes, and which boxes it meets.
#[derive(Clone, Copy)]
pub(super) struct Met {
    pub(super) enters: __m256,
    pub(super) is_met: __m256,
}

#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) fn meet(node: &WideNode, rows: &Rows, axes: &Axes, limit: __m256) -> Met {
    // SAFETY: the faces of a node are rows of it.
    unsafe { slabs((&raw const *node).cast(), &rows.faces, axes, limit) }
}

/// Where a ray enters the eight boxes with faces in a node or a block, and which of them it meets.
///
/// # Safety
///
/// At each of the offsets `faces` from `base` on there are eight floats, aligned to their size.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) unsafe fn slabs(base: *const u8, faces: &Faces, axes: &Axes, limit: __m256) -> Met {
    // SAFETY: `at` is one of the offsets.
    let row = |at: u32| unsafe { _mm256_load_ps(base.add(at as usize).cast()) };
    let entered =
        |axis: usize| _mm256_fmadd_ps(row(faces.near[axis]), axes.inverse[axis], axes.enter[axis]);
    let left =
        |axis: usize| _mm256_fmadd_ps(row(faces.far[axis]), axes.inverse[axis], axes.exit[axis]);
    // Of a NaN and a number both instructions return the second operand, here a number: a box that overflows is visited.
    let enters = _mm256_max_ps(
        _mm256_max_ps(entered(0), entered(1)),
        _mm256_max_ps(entered(2), axes.start),
    );
    let leaves = _mm256_min_ps(
        _mm256_min_ps(left(0), left(1)),
        _mm256_min_ps(left(2), limit),
    );
    Met {
        enters,
        is_met: _mm256_cmp_ps::<_CMP_LE_OQ>(enters, leaves),
    }
}

/// The child to visit next, of those that the ray meets up to `limit`. Pushes the other ones, and passes each to `pushed`.
///
/// The nearest child, and the others from far to near; with `ANY`, the child in the last lane, and the others in the order of
/// their lanes, without distances.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) fn enter<const ANY: bool>(
    node: &WideNode,
    rows: &Rows,
    axes: &Axes,
    limit: __m256,
    pending: &mut Pending<'_>,
) -> Option<Child> {
    let boxes = meet(node, rows, axes, limit);
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
    let order = order(node, rows);
    let met = push(node, order, &boxes, pending);
    // SAFETY: they have been written. The nearest one is not pushed.
    unsafe { pending.grow(met.count_ones() as usize - 1) };
    let nearest = met.ilog2();
    Some(node.children[(order >> (3 * nearest)) as usize % WIDTH])
}

/// [`enter`], or the child that was pushed last, without a branch that depends on the ray.
///
/// # Panics
///
/// If the ray meets no box and nothing is pending.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) fn enter_or_pop(
    node: &WideNode,
    rows: &Rows,
    axes: &Axes,
    limit: __m256,
    pending: &mut Pending<'_>,
) -> Child {
    let boxes = meet(node, rows, axes, limit);
    let met = push(node, order(node, rows), &boxes, pending);
    // SAFETY: they have been written.
    unsafe { pending.grow(met.count_ones() as usize) };
    pending.pop_last()
}

/// The lanes of a node from far to near, three bits each.
#[inline(always)]
fn order(node: &WideNode, rows: &Rows) -> u32 {
    let base: *const u8 = (&raw const *node).cast();
    // SAFETY: the offset of an order.
    unsafe { base.add(rows.order as usize).cast::<u32>().read() }
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
