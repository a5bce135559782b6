//! Axis-aligned boxes.

use glam::Vec3;

use crate::Axis;

/// An axis-aligned bounding box, closed on all sides. It may be flat, or a single point.
///
/// A box with `min > max` on some axis is empty; [`Aabb::EMPTY`], the default, starts a union.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Aabb {
    /// The lowest corner.
    pub min: Vec3,
    /// The highest corner.
    pub max: Vec3,
}

/// [`EMPTY`](Aabb::EMPTY).
impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Aabb {
    /// Contains no point; the neutral element of [`union`](Self::union).
    pub const EMPTY: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// The smallest box around `points`; [`EMPTY`](Self::EMPTY) if there are none.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, p| Self {
            min: bounds.min.min(p),
            max: bounds.max.max(p),
        })
    }

    /// Whether the box contains no point.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// The smallest box around both.
    #[inline]
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The intersection of both boxes; empty if they are disjoint.
    #[inline]
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            min: self.min.max(other.min),
            max: self.max.min(other.max),
        }
    }

    /// The center of the box. Adds halves, so that it is finite for any finite box.
    #[inline]
    pub fn center(&self) -> Vec3 {
        0.5 * self.min + 0.5 * self.max
    }

    /// Edge lengths; negative on some axis for an empty box.
    #[inline]
    pub fn extent(&self) -> Vec3 {
        self.max - self.min
    }

    /// Length of the diagonal, in scene units; 0 for an empty box, infinite only beyond the range of f32.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "computed in f64 so that squares neither overflow nor vanish, then rounded"
    )]
    pub fn diagonal(&self) -> f32 {
        if self.is_empty() {
            0.0
        } else {
            (self.max.as_dvec3() - self.min.as_dvec3()).length() as f32
        }
    }

    /// Half the surface area, in squared scene units; 0 for an empty box.
    ///
    /// In f64, so that it neither overflows nor underflows for any finite box: the probabilities of the surface area
    /// heuristic are ratios of half areas.
    #[inline]
    pub fn half_area(&self) -> f64 {
        if self.is_empty() {
            return 0.0;
        }
        let d = self.max.as_dvec3() - self.min.as_dvec3();
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    /// The two halves of the box when cut at `position` along `axis`: the lower, then the upper.
    ///
    /// Expects a position within the box; otherwise one half is empty or larger than the box.
    #[inline]
    #[must_use]
    pub fn split(&self, axis: Axis, position: f32) -> (Self, Self) {
        let (mut lower, mut upper) = (*self, *self);
        lower.max[axis.index()] = position;
        upper.min[axis.index()] = position;
        (lower, upper)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_box_is_neutral_and_has_no_size() {
        let unit = Aabb::around([Vec3::ZERO, Vec3::ONE]);
        assert_eq!(Aabb::EMPTY.union(&unit), unit, "union with nothing");
        assert_eq!(Aabb::default(), Aabb::EMPTY, "the default");
        assert!(
            Aabb::EMPTY.is_empty() && !unit.is_empty(),
            "only the empty box is empty"
        );
        assert_eq!(
            (Aabb::EMPTY.half_area(), Aabb::EMPTY.diagonal()),
            (0.0, 0.0),
            "no area, no length"
        );
    }

    #[test]
    fn areas_of_huge_boxes_stay_finite() {
        let huge = Aabb::around([Vec3::splat(-3e38), Vec3::splat(3e38)]);
        assert!(huge.half_area().is_finite(), "f64 holds (6e38)^2");
        assert_eq!(huge.center(), Vec3::ZERO, "halves first");
        let tiny = Aabb::around([Vec3::ZERO, Vec3::new(3e-30, 4e-30, 0.0)]);
        assert!(
            (tiny.diagonal() / 5e-30 - 1.0).abs() < 1e-6,
            "squares in f64"
        );
    }

    #[test]
    fn split_parts_share_the_plane() {
        let (lower, upper) = Aabb::around([Vec3::ZERO, Vec3::ONE]).split(Axis::Y, 0.25);
        assert_eq!(lower.max.y, 0.25, "lower ends at the plane");
        assert_eq!(upper.min.y, 0.25, "upper starts at the plane");
        assert_eq!(
            lower.half_area() + upper.half_area(),
            3.0 + 1.0,
            "the cut face counts twice, half area"
        );
    }
}
