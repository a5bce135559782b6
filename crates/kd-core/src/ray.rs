//! Rays and hits.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// A ray `origin + t * direction` for `t_min <= t <= t_max`.
///
/// The direction need not have unit length: `t` is measured in multiples of it. A ray with a NaN or an infinite
/// origin or direction, a zero direction, `t_min > t_max` or a mask of 0 is valid to trace and hits nothing.
///
/// In memory it is nine words, in the order of its fields.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// Where `t` is 0.
    pub origin: Vec3,
    /// Where it goes, and the unit of `t`.
    pub direction: Vec3,
    /// The lowest `t` that counts, inclusive. May be negative.
    pub t_min: f32,
    /// The highest `t` that counts, inclusive. May be infinite; a hit is always at a finite `t`.
    pub t_max: f32,
    /// Which geometry the ray sees: bits are compared with those of a part; a single mesh has all of them.
    pub mask: u32,
}

impl Ray {
    /// The ray from `origin` towards `direction`, for `t` in [0, ∞).
    pub fn new(origin: impl Into<Vec3>, direction: impl Into<Vec3>) -> Self {
        Self {
            origin: origin.into(),
            direction: direction.into(),
            t_min: 0.0,
            t_max: f32::INFINITY,
            mask: u32::MAX,
        }
    }

    /// The open segment between two points, as shadow rays want it: `a` is at `t = 0` and `b` at `t = 1`, and
    /// neither counts. Equal points, and points so far apart that f32 does not hold their difference, give a ray that
    /// hits nothing.
    ///
    /// A surface that passes through `a` or `b` only up to rounding may still be hit: see
    /// [`offset_origin`].
    pub fn between(a: impl Into<Vec3>, b: impl Into<Vec3>) -> Self {
        let (a, b) = (a.into(), b.into());
        Self::new(a, b - a).with_range(f32::MIN_POSITIVE, 1.0_f32.next_down())
    }

    /// The same ray for `t_min <= t <= t_max`. With `t_min > t_max`, or a NaN, it hits nothing.
    #[must_use]
    pub const fn with_range(mut self, t_min: f32, t_max: f32) -> Self {
        self.t_min = t_min;
        self.t_max = t_max;
        self
    }

    /// The same ray seeing only geometry that shares a bit with `mask`.
    #[must_use]
    pub const fn with_mask(mut self, mask: u32) -> Self {
        self.mask = mask;
        self
    }

    /// The point at `t`, computed in f64 and rounded once.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        (self.origin.as_dvec3() + f64::from(t) * self.direction.as_dvec3()).as_vec3()
    }

    /// Whether the ray can hit anything at all: finite, with a direction and a range. See [`Ray`].
    #[inline]
    pub fn can_hit(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != Vec3::ZERO
            && self.t_min <= self.t_max
            && self.mask != 0
    }
}

/// Where a ray meets a triangle.
///
/// The point is `(1 - u - v) v0 + u v1 + v v2` for the triangle's corners `v0`, `v1`, `v2`, and up to rounding also
/// [`Ray::at`]`(t)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in multiples of its direction.
    pub t: f32,
    /// Weight of the second corner, 0 to 1.
    pub u: f32,
    /// Weight of the third corner, 0 to 1.
    pub v: f32,
    /// The triangle's number in its mesh.
    pub triangle: u32,
}

impl Hit {
    /// The point that was hit, on `ray`; the ray must be the one that was traced.
    #[inline]
    pub fn point(&self, ray: &Ray) -> Vec3 {
        ray.at(self.t)
    }

    /// The order of hits along a ray: nearer first, and at equal distance the lower triangle.
    ///
    /// Every query settles ties by it, so that any two of them can be compared with `==`.
    #[inline]
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.triangle < other.triangle)
    }
}

/// Moves a point on a surface off it along `normal`, so that a ray from there does not meet the same surface again.
///
/// `normal` has unit length and points to the side where the new ray starts. The step is about 256 units in the last
/// place of each coordinate, and 2⁻¹⁶ near the origin of the coordinate system, which suits scenes whose size is
/// between 10⁻² and 10⁵ units; scale others, or use your own offset.
/// (C. Wächter and N. Binder, *A Fast and Robust Method for Avoiding Self-Intersection*, Ray Tracing Gems, 2019.)
pub fn offset_origin(point: Vec3, normal: Vec3) -> Vec3 {
    const NEAR_ZERO: f32 = 1.0 / 32.0;
    const FIXED_STEP: f32 = 1.0 / 65_536.0;
    const RELATIVE_STEP: f32 = 256.0 * f32::EPSILON;
    let offset = |p: f32, n: f32| {
        if p.abs() < NEAR_ZERO {
            p + n * FIXED_STEP
        } else {
            p + n * (p.abs() * RELATIVE_STEP)
        }
    };
    Vec3::new(
        offset(point.x, normal.x),
        offset(point.y, normal.y),
        offset(point.z, normal.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_cannot_hit_say_so() {
        let good = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
        assert!(good.can_hit(), "a plain ray");
        for bad in [
            Ray::new([f32::NAN, 0.0, 0.0], [0.0, 0.0, 1.0]),
            Ray::new([f32::INFINITY, 0.0, 0.0], [0.0, 0.0, 1.0]),
            Ray::new([0.0; 3], [0.0, f32::NAN, 1.0]),
            Ray::new([0.0; 3], [0.0, f32::NEG_INFINITY, 1.0]),
            Ray::new([0.0; 3], [0.0, -0.0, 0.0]),
            good.with_range(1.0, 0.5),
            good.with_range(f32::NAN, 1.0),
            good.with_range(0.0, f32::NAN),
            good.with_mask(0),
            Ray::between([1.0; 3], [1.0; 3]),
            Ray::between([-3e38; 3], [3e38; 3]),
        ] {
            assert!(!bad.can_hit(), "{bad:?}");
        }
        assert!(
            good.with_range(2.0, 2.0).can_hit(),
            "a range of one point is a range"
        );
    }

    #[test]
    fn a_segment_is_open() {
        let ray = Ray::between([0.0; 3], [0.0, 4.0, 0.0]);
        assert!(ray.t_min > 0.0 && ray.t_max < 1.0, "{ray:?}");
        assert_eq!(ray.at(0.5), Vec3::new(0.0, 2.0, 0.0), "in the middle");
    }

    #[test]
    fn offsets_leave_the_surface_at_every_scale() {
        for p in [0.0, 1e-3, 0.5, 1.0, 1e3, 1e6] {
            let up = offset_origin(Vec3::splat(p), Vec3::Y);
            assert!(up.y > p && up.x == p && up.z == p, "{p}: {up}");
        }
    }
}
