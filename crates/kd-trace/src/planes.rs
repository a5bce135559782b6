//! Where a ray crosses planes, with a bound of every error between a plane and a reported hit.
//!
//! Distances along the ray are measured here in *steps*: `t` times the power of two that brings the largest
//! component of the direction into [1, 2). That is exact, and neither very long nor very short directions come near
//! the ends of f32.
//!
//! # The bound
//!
//! Let W be the longest side of the tree's box, R the largest component of (corner - origin), C the largest
//! coordinate. A reported hit stands for a point P of its triangle (see [`triangle`](crate::triangle)) such that, on
//! each axis,
//!
//! - P lies within 2⁻²⁶ W of the ray: sheared coordinates of a triangle that surrounds the ray are at most 2W apart (the
//!   shear is at most 1), so their mean magnitude with P's weights is at most W, and rounding them to 26 bits moves P by 2⁻²⁶ of
//!   that. If finer weights were used, it lies within 3 · 2⁻²⁸ of the largest one, at most 3/4 · 2⁻²⁵ W;
//! - computing in f64 adds at most 2⁻⁴⁹ R, in P and in its distance;
//! - the reported `t` is that of P rounded to f32: a relative error of 2⁻²⁴, or where it underflows an absolute one
//!   of 2⁻¹⁵⁰;
//! - directions below 2⁻⁶⁰ of the largest are taken for 2⁻⁶⁰, which moves the ray by at most 2⁻⁵⁹ R at P.
//!
//! The tree leads to P's triangle wherever P is, up to the rounding of clipping in f64, 2⁻⁴⁹ C, and to what
//! [`Tree::check_coverage`](kd_core::Tree::check_coverage) tolerates, 2⁻²⁹ W.
//!
//! A plane at `s` is crossed at `(s - o) / d`, which f32 gives up to a relative error of 3 · 2⁻²⁴ (three roundings of
//! exact operands). Let Q be the largest distance from the origin to a face of the box on the plane's axis. For a plane
//! within 2Q that is an error of at most 6 · 2⁻²⁴ Q |1/d|; a plane further away is crossed at more than twice the `t` of
//! any P, on the right side whatever the rounding. If P lies below the plane, and the direction points up, then P's `t`
//! cannot be larger than the crossing by more than all of this together. So for each axis the crossing is an interval,
//! wider than the proof asks for by a factor of two or more, and as wide for all planes across an axis:
//!
//! ```text
//! crossing ± (|1/d| (2⁻²⁰ Q + 2⁻²⁴ W + 2⁻⁴⁶ (R + C) + smallest normal) + 2⁻¹⁰⁰ steps per t)
//! ```
//!
//! Where the second term is most of the bound, a search finds hits a fourteenth of it beside their triangle's box. Less of the
//! third term is needed than its size suggests: where P is within a box, the errors of f64 on an axis are below 2⁻⁵⁰ (Q + 2W)
//! however large R is, and where a box is not flat, C is at most 2²⁴ W, so that the other terms cover all but the 2⁻⁵⁹ R of small
//! directions. (Trials pass with 2⁻⁵⁸, and fail with 2⁻⁶⁴.)
//!
//! (2⁻²⁰ of the crossing itself in place of Q would be tighter near the origin, and costs 2 to 7 % of the time of a ray:
//! three more operations a node before the branch that waits for them. 2026-11-24, bunny, sibenik, `sponza_dabrovic`.)
//!
//! Faces of boxes are planes with the same bound. Where many are crossed at once it is `s / d - o / d` that is computed, with
//! the second term rounded once for all of them, and the difference not at all: its error is `2⁻²⁴ |o / d|`, and 2⁻²² of the
//! origin's coordinates is added to the bound.
//!
//! A *usual* ray starts at most 2²² sides and twice C away on each axis. Then `2⁻⁴⁶ (R + C)` is at most `2⁻²⁴ W + 2⁻⁴⁴ C`, and the
//! bound is computed with this instead: it needs no R ([`Frame::usual_distance`]).
//!
//! The end of a ray may be the depth of a hit over the speed, rounded twice: 2 · 2⁻²⁴ of its `t`, which is at most Q |1/d| on each
//! axis, and an eighth of the bound.
//!
//! A ray leaves the near side of a plane at the interval's end, and enters the far side at its start. So the spans
//! of all cells on the path to P contain the `t` that is reported for P, and nothing else needs a bound: a cell may
//! be passed over as soon as a hit is known whose `t` lies before the cell's span.
//! (T. Ize, *Robust BVH Ray Traversal*, JCGT 2(2), 2013, bounds the slabs of boxes in this manner; a kd-tree needs
//! the errors of the hit as well, because it cuts triangles.)
//!
//! Where anything overflows, an interval end becomes infinite or NaN, and every comparison is written so that NaN
//! visits. Such rays are slow, not wrong.

#[cfg(test)]
mod bounds;
mod packet;

use glam::Vec3;
use kd_core::{Aabb, Ray};
use kd_simd::{each, max, min};
pub use kd_wide::Frame;
pub(crate) use kd_wide::PER_REACH;

pub use packet::PacketPlanes;

/// Directions below this fraction of the largest are taken for it: 2⁻⁶⁰, inverted.
const STEEPEST: f64 = (1_u64 << 60) as f64;
/// The same limit, of slopes.
pub(crate) const LEAST_SLOPE: f32 = 1.0 / (1_u64 << 60) as f32;
const _: () = assert!(LEAST_SLOPE as f64 * STEEPEST == 1.0, "the same limit");
/// 2⁻²⁰, of the distance to the box's faces.
pub(crate) const RELATIVE: f32 = 1.0 / (1 << 20) as f32;
/// 2⁻²², of the origin's coordinates, where `s / d - o / d` is computed in place of `(s - o) / d`.
pub(crate) const PER_ORIGIN: f32 = 1.0 / (1 << 22) as f32;
/// 2⁻¹⁰⁰, in units of `t`. (2⁻¹⁴⁷ would do, but arithmetic with numbers below the normal ones is slow: a third of what it
/// took to prepare a ray.)
pub(crate) const PER_STEP: f32 = f32::from_bits((127 - 100) << 23);

/// A ray, prepared for planes.
#[derive(Clone, Copy, Debug)]
pub struct RayPlanes {
    /// One for each axis. The last is for the tag of a leaf: never used, it saves a bounds check.
    axes: [AxisPlanes; 4],
    /// How many steps `t = 1` is.
    steps: f32,
    /// The largest component of (corner - origin), up to rounding.
    reach: f32,
}

/// A ray and the planes perpendicular to one axis.
#[derive(Clone, Copy, Debug, Default)]
struct AxisPlanes {
    origin: f32,
    /// Steps per unit of this axis. Never zero, infinite or NaN.
    inverse: f32,
    /// The bound.
    pad: f32,
    /// The near child: 0 for the lower one, 1 for the upper.
    near: u32,
}

/// The interval in which a ray crosses a plane, in steps. Either end may be infinite or NaN.
#[derive(Clone, Copy, Debug)]
pub struct Crossing {
    /// The far side starts here or later.
    pub first: f32,
    /// The near side ends here or earlier.
    pub last: f32,
    /// The near side: 0 for the lower one, 1 for the upper.
    pub near: u32,
}

/// A part of a ray, in steps. Neither is NaN.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// Its begin.
    pub enter: f32,
    /// Its end, not before its begin.
    pub exit: f32,
}

/// The power of two that is at most the largest component of a direction, and half of it or more: how many steps `t = 1`
/// is.
pub(crate) fn unit_of(direction: Vec3) -> f64 {
    // Every f32 is a normal number in f64, so the exponent bits are valid.
    const EXPONENT: u64 = 0x7ff << 52;
    let largest = f64::from(direction.abs().max_element());
    f64::from_bits(largest.to_bits() & EXPONENT)
}

impl RayPlanes {
    /// The ray must be one that [can hit](Ray::can_hit).
    #[inline(always)]
    pub fn new(ray: &Ray, frame: &Frame) -> Self {
        let unit = unit_of(ray.direction);
        // One over a power of two, by its exponent.
        let per_unit = f64::from_bits((2046 << 52) - unit.to_bits());
        let [lower, upper] = &frame.corners;
        let mut reaches = [0.0; 3];
        for (axis, reach) in reaches.iter_mut().enumerate() {
            let origin = ray.origin[axis];
            *reach = max((lower[axis] - origin).abs(), (upper[axis] - origin).abs());
        }
        let reach = max(max(reaches[0], reaches[1]), reaches[2]);
        let distance = frame.distance + PER_REACH * reach;

        #[allow(
            clippy::cast_possible_truncation,
            reason = "a power of two that f32 has, and a quotient that may round"
        )]
        let (steps, inverse) = (
            unit as f32,
            (ray.direction.as_dvec3() * per_unit)
                .recip()
                .clamp(glam::DVec3::splat(-STEEPEST), glam::DVec3::splat(STEEPEST))
                .as_vec3(),
        );
        let mut axes = [AxisPlanes::default(); 4];
        for (k, axis) in axes.iter_mut().take(3).enumerate() {
            *axis = AxisPlanes {
                origin: ray.origin[k],
                inverse: inverse[k],
                pad: (RELATIVE * reaches[k] + distance) * inverse[k].abs() + PER_STEP * steps,
                near: u32::from(inverse[k] < 0.0),
            };
        }
        Self { axes, steps, reach }
    }

    /// The largest component of (corner - origin) over the box, up to rounding; infinite if it overflows.
    pub fn reach(&self) -> f32 {
        self.reach
    }

    /// Whether the ray goes towards lower coordinates on an axis.
    #[inline(always)]
    pub fn is_downwards(&self, axis: usize) -> bool {
        self.axes[axis].near != 0
    }

    /// A value of `t` in steps.
    #[inline]
    pub fn steps(&self, t: f32) -> f32 {
        t * self.steps
    }

    /// Where the ray crosses a plane perpendicular to an axis: 0, 1 or 2, which is a node's tag.
    #[inline]
    pub fn crossing(&self, axis: usize, split: f32) -> Crossing {
        let axis = &self.axes[axis];
        let at = (split - axis.origin) * axis.inverse;
        Crossing {
            first: at - axis.pad,
            last: at + axis.pad,
            near: axis.near,
        }
    }

    /// The range of a ray, in steps.
    #[inline]
    pub fn range(&self, ray: &Ray) -> Span {
        Span {
            enter: self.steps(ray.t_min),
            exit: self.steps(ray.t_max),
        }
    }

    /// The part of the ray's range in which it may hit a triangle in the box; `None` if it misses the box.
    #[inline]
    pub fn clip(&self, ray: &Ray, bounds: &Aabb) -> Option<Span> {
        self.clip_span(self.range(ray), bounds)
    }

    /// The part of a span in which the ray may hit a triangle in the box; `None` if it misses the box.
    ///
    /// The box is not empty, and within that of the [`Frame`]. Two subtractions, multiplications and comparisons an axis, for use
    /// at every node.
    #[inline]
    pub fn clip_span(&self, mut span: Span, bounds: &Aabb) -> Option<Span> {
        for (axis, planes) in self.axes.iter().take(3).enumerate() {
            // Neither is NaN: a finite factor that is not zero, and a difference of finite numbers.
            let faces = [bounds.min[axis], bounds.max[axis]];
            let [a, b] = each(faces, |face| (face - planes.origin) * planes.inverse);
            span.enter = max(min(a, b) - planes.pad, span.enter);
            span.exit = min(max(a, b) + planes.pad, span.exit);
        }
        (span.enter <= span.exit).then_some(span)
    }
}
