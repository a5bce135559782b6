//! Rays that are given in f64.

use glam::{DVec3, Vec3};

use crate::exact::{to_f32, two_sum};
use crate::{Culling, Ray};

/// A ray far from the origin of its world: an origin in f64, and a ray whose coordinates are offsets from it.
///
/// [`new`](Self::new) starts at `origin`. A structure over a [`WorldMesh`](crate::WorldMesh) traces the ray
/// [`relative_to`](Self::relative_to) the origin of that mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldRay {
    /// The point of the world at which `ray` has its zero.
    pub origin: DVec3,
    /// The ray, from `origin`: its direction, range, mask and culling, and the offset of its start, usually zero.
    pub ray: Ray,
}

impl WorldRay {
    /// The ray from `start` towards `direction`, for `t` in [0, ∞).
    pub fn new(start: impl Into<DVec3>, direction: impl Into<Vec3>) -> Self {
        Self {
            origin: start.into(),
            ray: Ray::new(Vec3::ZERO, direction),
        }
    }

    /// The open segment between two points, as [`Ray::between`]: `a` is at `t = 0` and `b` at `t = 1`, both excluded.
    ///
    /// The direction is computed in f64 and rounded once, so the segment ends within 2⁻²⁴ of its extent on each axis from `b`.
    pub fn between(a: impl Into<DVec3>, b: impl Into<DVec3>) -> Self {
        let (a, b) = (a.into(), b.into());
        Self {
            origin: a,
            ray: Ray::between(Vec3::ZERO, (b - a).as_vec3()),
        }
    }

    /// The same ray for `t_min <= t <= t_max`, as [`Ray::with_range`].
    #[must_use]
    pub const fn with_range(mut self, t_min: f32, t_max: f32) -> Self {
        self.ray = self.ray.with_range(t_min, t_max);
        self
    }

    /// The same ray with another mask, as [`Ray::with_mask`].
    #[must_use]
    pub const fn with_mask(mut self, mask: u32) -> Self {
        self.ray = self.ray.with_mask(mask);
        self
    }

    /// The same ray with another culling, as [`Ray::with_culling`].
    #[must_use]
    pub const fn with_culling(mut self, culling: Culling) -> Self {
        self.ray = self.ray.with_culling(culling);
        self
    }

    /// The point at `t`, computed in f64.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + (self.ray.origin.as_dvec3() + t * self.ray.direction.as_dvec3())
    }

    /// The ray as seen from `origin`: the same direction, range, mask and culling, so the same `t`.
    ///
    /// Its start is computed in f64 and rounded once to f32. On each axis this errs by at most 2⁻²⁴ of the start's coordinate from
    /// `origin`, and by 2⁻⁵² of the distance between the two origins; [`rounding_from`](Self::rounding_from) is the error itself. The
    /// ray moves parallel to itself by that. It is exact if both origins are equal. A start beyond the range of f32 becomes infinite,
    /// and the ray hits nothing.
    ///
    /// If both origins move by the same vector, exactly in f64, the result is the same to the bit.
    #[must_use]
    pub fn relative_to(&self, origin: DVec3) -> Ray {
        let start = (self.origin - origin) + self.ray.origin.as_dvec3();
        let mut ray = self.ray;
        ray.origin = start.as_vec3();
        ray
    }

    /// The distance on each axis by which [`relative_to`](Self::relative_to) moves the ray: zero exactly where its start is exact in
    /// f32. It is correct up to 2⁻⁵² of itself; infinite or NaN for a start that is not finite.
    pub fn rounding_from(&self, origin: DVec3) -> DVec3 {
        let axis = |k: usize| {
            let [between, first] = two_sum(self.origin[k], -origin[k]);
            let [start, second] = two_sum(between, f64::from(self.ray.origin[k]));
            (start - f64::from(to_f32(start)) + (first + second)).abs()
        };
        DVec3::new(axis(0), axis(1), axis(2))
    }

    /// The same ray, with its start moved along it to `t`, for rays that start far from what they meet: a satellite's ray, advanced
    /// to near the ground, rounds as if it started there.
    ///
    /// The `t` of its hits is less by `t`. The new start is computed in f64, and errs on each axis by at most 2⁻⁵² of
    /// `origin` and of the old offset, plus 2⁻⁵¹ of `t` times the direction. The ends of the range become `t_min - t` and `t_max - t`, each rounded to f32:
    /// hits within 2⁻²⁴ of that from an end may be in the range of one ray and not of the other.
    ///
    /// ```
    /// use kd_core::WorldRay;
    /// use glam::DVec3;
    ///
    /// // From 700 km above a city. In f32 the height would be rounded to multiples of 1/16.
    /// let origin = DVec3::new(5e5, 5.2e6, 0.0);
    /// let ray = WorldRay::new([5e5, 5.2e6, 700_000.03], [0.0, 0.0, -1.0]);
    /// assert!(ray.rounding_from(origin).z > 0.02);
    /// let near = ray.advanced(699_000.0);
    /// assert!(near.rounding_from(origin).z < 4e-5);
    /// assert_eq!(near.at(0.0), ray.at(699_000.0));
    /// ```
    #[must_use]
    pub fn advanced(&self, t: f64) -> Self {
        let end = |end: f32| to_f32(f64::from(end) - t);
        let mut ray = self.ray;
        ray.origin = Vec3::ZERO;
        Self {
            origin: self.at(t),
            ray: ray.with_range(end(ray.t_min), end(ray.t_max)),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rays_from_their_own_origin_are_exact() {
        let ray = WorldRay {
            origin: DVec3::new(5e5, 0.1, -1e300),
            ray: Ray::new([0.1, 1e-30, 7.0], [0.0, 0.0, 1.0])
                .with_range(-1.0, 9.0)
                .with_mask(6),
        };
        assert_eq!(ray.relative_to(ray.origin), ray.ray);
        assert_eq!(ray.rounding_from(ray.origin), DVec3::ZERO);
    }

    #[test]
    fn ranges_masks_and_cullings_are_kept() {
        let ray = WorldRay::new([5e5, 5.2e6, 1.0], [0.0, 0.0, -2.0]);
        let ray = ray.with_range(0.5, 3.0).with_mask(4);
        let ray = ray.with_culling(Culling::BACK);
        let expected = Ray::new([1.0, 2.0, 3.0], [0.0, 0.0, -2.0]);
        let expected = expected.with_range(0.5, 3.0).with_mask(4);
        let expected = expected.with_culling(Culling::BACK);
        let origin = DVec3::new(499_999.0, 5_199_998.0, -2.0);
        assert_eq!(ray.relative_to(origin), expected);
        assert_eq!(ray.at(0.5), DVec3::new(5e5, 5.2e6, 0.0));
        let advanced = ray.advanced(0.25);
        assert_eq!(
            advanced.relative_to(origin),
            Ray::new([1.0, 2.0, 2.5], [0.0, 0.0, -2.0])
                .with_range(0.25, 2.75)
                .with_mask(4)
                .with_culling(Culling::BACK)
        );
    }

    #[test]
    fn segments_are_open() {
        let (a, b) = ([5e5, 5.2e6, 1.0], [5e5, 5.2e6 + 0.25, 1.0]);
        let segment = WorldRay::between(a, b);
        assert_eq!(segment.at(1.0), DVec3::from(b));
        assert!(segment.ray.t_min > 0.0 && segment.ray.t_max < 1.0);
        let nowhere = WorldRay::between(a, a);
        assert!(!nowhere.ray.can_hit());
    }

    #[test]
    fn starts_that_f32_lacks_hit_nothing() {
        for start in [1e39, f64::INFINITY, f64::NAN] {
            let ray = WorldRay::new([start, 0.0, 0.0], [-1.0, 0.0, 0.0]);
            assert!(!ray.relative_to(DVec3::ZERO).can_hit(), "{start}");
            assert!(!ray.rounding_from(DVec3::ZERO).is_finite(), "{start}");
        }
    }

    proptest! {
        #[test]
        fn roundings_are_bounded(
            start in prop::array::uniform3(-1e7_f64..1e7),
            offset in prop::array::uniform3(-1e3_f32..1e3),
            origin in prop::array::uniform3(-1e7_f64..1e7),
        ) {
            let (start, origin) = (DVec3::from(start), DVec3::from(origin));
            let ray = WorldRay { origin: start, ray: Ray::new(offset, [1.0, 0.0, 0.0]) };
            let local = ray.relative_to(origin).origin.as_dvec3();
            let rounding = ray.rounding_from(origin);
            let bound = local.abs() * 2.0_f64.powi(-24) + (start - origin).abs() * 2.0_f64.powi(-52);
            prop_assert!(rounding.cmple(bound * (1.0 + 1e-9)).all(), "{} {}", rounding, bound);
            let seen = (ray.at(0.0) - (origin + local)).abs();
            prop_assert!((seen - rounding).abs().max_element() <= 4e7 * f64::EPSILON);
        }
    }
}
