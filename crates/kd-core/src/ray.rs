//! Rays and hits.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::Culling;

/// A ray `origin + t * direction` for `t_min <= t <= t_max`.
///
/// The direction need not have unit length: `t` is measured in multiples of it. A ray with a NaN or an infinite
/// origin or direction, a zero direction, `t_min > t_max`, a mask of 0 or a culling of both sides is valid to trace, and hits
/// nothing.
///
/// In memory it is ten words, in the order of its fields.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Ray {
    /// The point at `t = 0`.
    pub origin: Vec3,
    /// The direction, and the unit of `t`.
    pub direction: Vec3,
    /// The lower end of the range of `t`, inclusive. May be negative.
    pub t_min: f32,
    /// The upper end of the range of `t`, inclusive. May be infinite; a hit is always at a finite `t`.
    pub t_max: f32,
    /// Bits of the parts that the ray sees: those whose own mask has one of them. A mesh alone, and a part of a scene whose mask
    /// was not set, has all bits: a ray with mask 0 hits nothing, and every other mask sees it.
    pub mask: u32,
    /// The sides of triangles that the ray passes through.
    pub culling: Culling,
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
            culling: Culling::NONE,
        }
    }

    /// The open segment between two points, for shadow rays: `a` is at `t = 0` and `b` at `t = 1`, both
    /// excluded. Equal points, and points whose difference exceeds the range of f32, give a ray that
    /// hits nothing.
    ///
    /// A surface that passes through `a` or `b` only up to rounding may still be hit.
    /// [`Mesh::offset_origin`](crate::Mesh::offset_origin) moves the start off its surface.
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

    /// The same ray with another [`mask`](Self::mask).
    #[must_use]
    pub const fn with_mask(mut self, mask: u32) -> Self {
        self.mask = mask;
        self
    }

    /// The same ray with another [`culling`](Self::culling).
    ///
    /// ```
    /// use kd_core::{Culling, Ray};
    ///
    /// let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]).with_culling(Culling::BACK);
    /// assert!(ray.can_hit());
    /// ```
    #[must_use]
    pub const fn with_culling(mut self, culling: Culling) -> Self {
        self.culling = culling;
        self
    }

    /// The point at `t`, computed in f64 and rounded once.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        (self.origin.as_dvec3() + f64::from(t) * self.direction.as_dvec3()).as_vec3()
    }

    /// Whether the ray can hit anything: it is finite, has a direction, a range and a mask, and sees some side of triangles. See
    /// [`Ray`].
    #[inline]
    pub fn can_hit(&self) -> bool {
        self.origin.is_finite()
            && self.direction.is_finite()
            && self.direction != Vec3::ZERO
            && self.t_min <= self.t_max
            && self.mask != 0
            && self.culling != Culling::BOTH
    }
}

/// Where a ray meets a triangle.
///
/// In memory it is four words, in the order of its fields.
///
/// The point is `(1 - u - v) v0 + u v1 + v v2` for the triangle's corners `v0`, `v1`, `v2`, and up to rounding also
/// [`Ray::at`]`(t)`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
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
    /// The point of the hit on `ray`, which must be the ray that was traced.
    ///
    /// It is off the surface by up to 2⁻²⁴ of the distance along the ray, the rounding of `t`.
    /// [`Mesh::surface_point`](crate::Mesh::surface_point) is on the surface from any distance.
    #[inline]
    pub fn point(&self, ray: &Ray) -> Vec3 {
        ray.at(self.t)
    }

    /// The order of hits along a ray: nearer first, and at equal distance the lower triangle.
    ///
    /// All queries break ties by it, so that their results can be compared with `==`.
    #[inline]
    pub fn is_before(&self, other: &Self) -> bool {
        self.t < other.t || (self.t == other.t && self.triangle < other.triangle)
    }
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
            good.with_culling(Culling::BOTH),
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
    fn hits_are_four_words() {
        let hit = Hit {
            t: 1.5,
            u: 0.25,
            v: 0.5,
            triangle: 7,
        };
        let words: [u32; 4] = bytemuck::cast(hit);
        let expected = [1.5_f32.to_bits(), 0.25_f32.to_bits(), 0.5_f32.to_bits(), 7];
        assert_eq!(words, expected, "in the order of the fields");
    }

    #[test]
    fn a_segment_is_open() {
        let ray = Ray::between([0.0; 3], [0.0, 4.0, 0.0]);
        assert!(ray.t_min > 0.0 && ray.t_max < 1.0, "{ray:?}");
        assert_eq!(ray.at(0.5), Vec3::new(0.0, 2.0, 0.0), "in the middle");
    }
}
