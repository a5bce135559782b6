//! The crossing of a ray with any plane, with a bound of every error between the plane and a reported hit.
//!
//! The bound is that of [`RayPlanes`](kd_trace::kit::RayPlanes) for planes that are not across an axis. It is computed in f64 and
//! is therefore smaller. A reported hit represents a point P of its triangle. Let L be the triangle's longest side along an axis,
//! R the largest component of (corner - origin) and C the largest coordinate of the scene. The height over a plane is the product
//! with its normal, and the components of a unit vector add up to less than 2.
//!
//! - P is within 2⁻²⁵ L of the ray on each axis (see there), so its height is that of the ray up to 2⁻²⁴ L.
//! - P's fragment is on its side of the plane up to the tolerance of the build.
//! - The corners of a fragment are rounded at most 64 times, by 2⁻⁵² C each. Both halves of a cut share the rounded corner, so
//!   that nothing between them is lost: a height of 2⁻⁴⁵ C.
//! - Heights and P's distance are computed in f64: less than 2⁻⁴⁷ (R + C).
//!
//! The tolerance and twice the first bound, 2⁻²³ L, are a node's slack; twice the others, 2⁻⁴⁴ (R + C), are the ray's. So P's
//! `t`, before it is rounded to f32, is between the crossings of the plane moved by both slacks to either side. Rounding is
//! monotonic: the reported `t` is between the crossings rounded to f32.

use glam::DVec3;
use kd_core::{Aabb, Ray};
use kd_trace::kit::Crossing;

use super::plane::Plane;

/// 2⁻²³, of the longest side of a triangle.
pub(super) const PER_SIDE: f64 = 1.0 / (1 << 23) as f64;
/// 2⁻⁴⁴, of distances and coordinates.
const PER_REACH: f64 = 1.0 / (1_u64 << 44) as f64;

/// A ray, prepared for crossings with planes.
#[derive(Clone, Copy, Debug)]
pub(super) struct RayLine {
    origin: DVec3,
    direction: DVec3,
    slack: f64,
}

impl RayLine {
    /// For planes of triangles within a box, which is not empty.
    pub(super) fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let origin = ray.origin.as_dvec3();
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let reach = (low - origin).abs().max((high - origin).abs());
        let coordinate = low.abs().max(high.abs());
        Self {
            origin,
            direction: ray.direction.as_dvec3(),
            slack: PER_REACH * (reach.max_element() + coordinate.max_element()),
        }
    }

    /// The crossing of the ray with a plane, in units of `t`; side 0 is behind the plane. `slack` is the node's.
    ///
    /// A ray along the plane crosses it everywhere if it is within the slack, and at one of the infinities otherwise.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "rounded as the t of a hit is"
    )]
    pub(super) fn crossing(&self, plane: &Plane, slack: f64) -> Crossing {
        let slack = slack + self.slack;
        let (height, slope) = (plane.height(self.origin), plane.normal.dot(self.direction));
        // Seen from the near side, the ray ascends. A slope of -0.0 would exchange the infinities.
        let is_downwards = slope < 0.0;
        let height = if is_downwards { -height } else { height };
        let slope = slope.abs();
        Crossing {
            first: ((-slack - height) / slope) as f32,
            last: ((slack - height) / slope) as f32,
            near: u32::from(is_downwards),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// The plane z = 2, whose front is above.
    fn plane() -> Plane {
        let corners = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
        Plane::of(corners.map(Vec3::from)).expect("not a line")
    }

    fn crossing(origin: [f32; 3], direction: [f32; 3]) -> Crossing {
        let bounds = Aabb::around([Vec3::ZERO, Vec3::splat(4.0)]);
        let ray = Ray::new(origin, direction);
        RayLine::new(&ray, &bounds).crossing(&plane(), 0.5)
    }

    #[test]
    fn crossings_are_as_wide_as_the_slack() {
        let up = crossing([0.0; 3], [0.0, 0.0, 1.0]);
        assert_eq!((up.first, up.last, up.near), (1.5, 2.5, 0), "from behind");
        let down = crossing([0.0, 0.0, 4.0], [0.0, 0.0, -2.0]);
        let expected = (0.75, 1.25, 1);
        assert_eq!(
            (down.first, down.last, down.near),
            expected,
            "from the front"
        );
    }

    #[test]
    fn far_origins_widen_crossings() {
        let bounds = Aabb::around([Vec3::ZERO, Vec3::splat(4.0)]);
        let ray = Ray::new([1e7, 0.0, 2.0], [0.0, 0.0, 1.0]);
        let far = RayLine::new(&ray, &bounds).crossing(&plane(), 0.0);
        assert!(far.first < -1e-7 && far.last > 1e-7, "{far:?}");
    }

    #[test]
    fn rays_along_a_plane_are_on_one_side_or_on_both() {
        let infinity = f32::INFINITY;
        for (height, first, last) in [
            (1.0, infinity, infinity),
            (1.75, -infinity, infinity),
            (2.25, -infinity, infinity),
            (3.0, -infinity, -infinity),
        ] {
            for direction in [[1.0, 0.0, 0.0], [1.0, 1.0, -0.0], [-1.0, -1.0, -0.0]] {
                let along = crossing([0.0, 0.0, height], direction);
                assert_eq!((along.first, along.last), (first, last), "at {height}");
            }
        }
    }
}
