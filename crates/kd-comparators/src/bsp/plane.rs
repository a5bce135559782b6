//! Planes of triangles, and the sides of them.

use glam::{DVec3, Vec3};

/// A plane, with a normal of unit length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane {
    pub(super) normal: DVec3,
    /// The product of the normal with points of the plane.
    pub(super) offset: f64,
}

/// The position of a polygon relative to a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Behind,
    InFront,
    On,
    Across,
}

/// 2⁻¹⁶: a triangle whose height over its longest side is smaller has no plane.
const LEAST_HEIGHT: f64 = 1.0 / (1 << 16) as f64;

impl Plane {
    /// The plane of a triangle; `None` if the triangle is nearly a line, where the normal is mostly rounding error.
    pub(super) fn of(corners: [Vec3; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let normal = (b - a).cross(c - a);
        let double_area = normal.length();
        let longest = [b - a, c - b, a - c]
            .map(DVec3::length_squared)
            .into_iter()
            .fold(0.0, f64::max);
        if double_area <= LEAST_HEIGHT * longest {
            return None;
        }
        let normal = normal / double_area;
        Some(Self {
            normal,
            offset: normal.dot(a),
        })
    }

    /// The distance of a point in front of the plane; negative behind it.
    #[inline]
    pub(super) fn height(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// The side of a polygon. Points within `tolerance` of the plane count for neither side.
    #[inline]
    pub(super) fn side_of(&self, points: &[DVec3], tolerance: f64) -> Side {
        let (mut lowest, mut highest) = (f64::INFINITY, f64::NEG_INFINITY);
        for &point in points {
            let height = self.height(point);
            lowest = lowest.min(height);
            highest = highest.max(height);
        }
        match (lowest < -tolerance, highest > tolerance) {
            (true, true) => Side::Across,
            (true, false) => Side::Behind,
            (false, true) => Side::InFront,
            (false, false) => Side::On,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_points_have_no_plane() {
        let (a, b) = (Vec3::ZERO, Vec3::X);
        for corners in [
            [a, a, a],
            [a, b, b],
            [a, b, a.midpoint(b)],
            [a, b, Vec3::new(0.5, 1e-6, 0.0)],
        ] {
            assert!(Plane::of(corners).is_none(), "{corners:?}");
        }
    }

    #[test]
    fn triangles_of_any_size_are_in_their_plane() {
        for scale in [1e-38, 1e-20, 1.0, 1e20, 1e38] {
            let corners = [[0.3, 0.1, 0.2], [-0.7, 2.0, 0.4], [1.1, 0.5, -1.6]];
            let corners = corners.map(|corner| scale * Vec3::from(corner));
            let plane = Plane::of(corners).expect("not a line");
            let points = corners.map(|corner| corner.as_dvec3());
            let tolerance = 1e-12 * f64::from(scale);
            assert_eq!(plane.side_of(&points, tolerance), Side::On, "{scale:e}");
            let behind = points.map(|point| point - 1e-3 * f64::from(scale) * plane.normal);
            let side = plane.side_of(&behind, tolerance);
            assert_eq!(side, Side::Behind, "{scale:e}");
            let both = [
                points[0],
                behind[1],
                points[0] + f64::from(scale) * plane.normal,
            ];
            let side = plane.side_of(&both, tolerance);
            assert_eq!(side, Side::Across, "{scale:e}");
        }
    }
}
