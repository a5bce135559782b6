//! A point before a tree, and the bound of every error between a box and a decided distance.
//!
//! Lanes of f32 see coordinates from the point, in units in which the farthest corner of the tree's box is between 1/2 and 1 away along
//! some axis: R is that distance in scene units, s the scale, a power of two, and u = 2⁻²⁴. So products neither overflow nor, where it
//! matters, underflow, at any size of the scene. The product with s is exact, so that a difference from the point errs by a factor of
//! 1 ± u, and by 2⁻¹⁴⁹ where it is tiny.
//!
//! # Why nothing is lost
//!
//! Let d be the distance of a decided triangle, in f64. By [`decision`](crate::decision), some point q of the triangle is at most
//! d + 2⁻⁴⁸ R away. q is in a box of the tree that refers to the triangle, up to the errors of clipping: boxes of wide nodes are rounded
//! outwards and may miss 2⁻⁵⁰ of a coordinate; builders of kd-trees may drop a piece of a triangle that is thinner than 10⁻⁹ of the
//! diagonal of the tree. The diagonal is at most 2 √3 R, so that all of this moves q by less than 2⁻²⁵ R. (A coordinate is at most 2²⁵ R,
//! since corners are f32 and differ.) The pad is 2⁻²² R. So the box is at most d + pad away, and a box whose distance is certainly larger
//! has no triangle that could be as close.
//!
//! In f32 a squared distance of a box is a sum of squares of differences, too large by a factor of at most 1 + 6u, and by far less than the
//! square of the pad. A limit is larger by a factor of 1 + 16u, which is more than boxes and [`triangles`](crate::triangles) need, and more
//! than it loses when it is rounded.

use glam::Vec3;
use kd_core::Aabb;
use kd_simd::{F32x8, LANES, Simd};

/// 2⁻²², of R.
const PAD: f64 = 1.0 / (1 << 22) as f64;
/// 1 + 16 u.
const SLACK: f64 = 1.0 + 16.0 / (1 << 24) as f64;
/// More than the square of any distance in scaled units, which is at most 3 (1 + 4u).
const MOST: f64 = 64.0;
/// Exponents of scales: neither the scale nor its products with coordinates of the tree overflow.
const EXPONENTS: [i32; 2] = [-140, 120];

/// A point before a tree.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    scale: f32,
    /// The point in scaled units.
    scaled: [f32; 3],
    /// In scene units.
    pub(crate) pad: f64,
}

/// The same number for every lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ReachLanes<N> {
    scale: N,
    negative_scale: N,
    scaled: [N; 3],
    negative_scaled: [N; 3],
}

impl Reach {
    /// A finite point before triangles within a box that is not empty.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "the exponent of a finite number; powers of two in the range of f32"
    )]
    pub(crate) fn new(point: Vec3, bounds: &Aabb) -> Self {
        let [from, min, max] = [point, bounds.min, bounds.max].map(|p| p.as_dvec3());
        let reach = (min - from).abs().max((max - from).abs()).max_element();
        // The exponent of the next power of two. (Not `log2`, which may differ between platforms.)
        let exponent = ((reach.to_bits() >> 52) as i32 - 1022).clamp(-EXPONENTS[1], -EXPONENTS[0]);
        let scale = power_of_two(-exponent) as f32;
        Self {
            scale,
            scaled: (point * scale).to_array(),
            pad: PAD * reach,
        }
    }

    /// What the square of a scaled distance does not exceed, if the distance may be that of a triangle with this squared distance, in
    /// squared scene units, or a smaller one.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "the slack covers the rounding"
    )]
    pub(crate) fn limit(&self, squared: f64) -> f32 {
        let distance = (squared.sqrt() + self.pad) * f64::from(self.scale);
        (distance * distance * SLACK).min(MOST) as f32
    }

    /// [`limit`](Self::limit) in squared scene units, for distances in f64.
    #[inline]
    pub(crate) fn limit_unscaled(&self, squared: f64) -> f64 {
        let distance = squared.sqrt() + self.pad;
        distance * distance * SLACK
    }

    #[inline(always)]
    pub(crate) fn lanes<S: Simd>(&self, simd: S) -> ReachLanes<S::F32> {
        let [x, y, z] = self.scaled;
        ReachLanes {
            scale: simd.splat(self.scale),
            negative_scale: simd.splat(-self.scale),
            scaled: [simd.splat(x), simd.splat(y), simd.splat(z)],
            negative_scaled: [simd.splat(-x), simd.splat(-y), simd.splat(-z)],
        }
    }
}

/// 2 to a power in the range of f64.
fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(u64::from((exponent + 1023).unsigned_abs()) << 52)
}

impl<N: F32x8> ReachLanes<N> {
    /// The squared scaled distances of eight boxes; infinite for empty ones.
    #[inline(always)]
    pub(crate) fn squared_distances<S: Simd<F32 = N>>(
        &self,
        simd: S,
        faces: &[[[f32; LANES]; 2]; 3],
    ) -> N {
        let zero = simd.splat(0.0);
        let mut sum = zero;
        for (axis, [starts, ends]) in faces.iter().enumerate() {
            let before = simd
                .load(starts)
                .mul_add(self.scale, self.negative_scaled[axis]);
            let behind = simd
                .load(ends)
                .mul_add(self.negative_scale, self.scaled[axis]);
            let outside = before.max(behind).max(zero);
            sum = outside.mul_add(outside, sum);
        }
        sum
    }

    /// Coordinates of eight corners as the point sees them, in scaled units.
    #[inline(always)]
    pub(crate) fn seen<S: Simd<F32 = N>>(&self, simd: S, rows: &[[f32; LANES]; 3]) -> [N; 3] {
        let [x, y, z] = rows;
        let [from_x, from_y, from_z] = self.negative_scaled;
        [
            simd.load(x).mul_add(self.scale, from_x),
            simd.load(y).mul_add(self.scale, from_y),
            simd.load(z).mul_add(self.scale, from_z),
        ]
    }
}
