//! Triangles as a builder sees them: boxes.

use glam::Vec3A;
use kd_core::{Aabb, Axis, Mesh};

/// A box that grows. Starts from [`NOTHING`](Self::NOTHING).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) min: Vec3A,
    pub(crate) max: Vec3A,
}

/// A triangle in its box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) bounds: Bounds,
    pub(crate) triangle: u32,
}

/// Some items, seen from outside.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    /// The box around them.
    pub(crate) bounds: Bounds,
    /// The box around their centres.
    pub(crate) centers: Bounds,
}

impl Bounds {
    pub(crate) const NOTHING: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
    };

    /// The box of some items.
    pub(crate) fn of(items: &[Item]) -> Self {
        let boxes = items.iter().map(|item| &item.bounds);
        boxes.fold(Self::NOTHING, |around, bounds| around.union(bounds))
    }

    #[inline(always)]
    pub(crate) fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    #[inline(always)]
    pub(crate) fn grow(&mut self, other: &Self) {
        *self = self.union(other);
    }

    #[inline(always)]
    pub(crate) fn grow_to(&mut self, point: Vec3A) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// The middle. Halves are added, so that it is finite for any finite box.
    #[inline(always)]
    pub(crate) fn center(&self) -> Vec3A {
        0.5 * self.min + 0.5 * self.max
    }

    /// Half the surface area of a box that is not empty, in f64, where it neither overflows nor vanishes: the same as
    /// [`Aabb::half_area`].
    #[inline(always)]
    pub(crate) fn half_area(&self) -> f64 {
        let d = self.max.as_dvec3() - self.min.as_dvec3();
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    pub(crate) fn aabb(&self) -> Aabb {
        Aabb {
            min: self.min.into(),
            max: self.max.into(),
        }
    }
}

impl Item {
    pub(crate) fn of(mesh: &Mesh, triangle: u32) -> Self {
        let [a, b, c] = mesh.corners(triangle).map(Vec3A::from);
        Self {
            bounds: Bounds {
                min: a.min(b).min(c),
                max: a.max(b).max(c),
            },
            triangle,
        }
    }

    /// A number that is larger where the centre lies higher on an axis, and no two items of a mesh have.
    #[inline(always)]
    pub(crate) fn key(&self, axis: Axis) -> u64 {
        // Adding zero turns -0.0 into 0.0: they are one place.
        let center = self.bounds.center()[axis.index()] + 0.0;
        let bits = center.to_bits();
        // Negative numbers ascend where their bits descend.
        let ascending = if bits >> 31 == 0 {
            bits | 1 << 31
        } else {
            !bits
        };
        u64::from(ascending) << 32 | u64::from(self.triangle)
    }
}

impl Around {
    /// Of some items, at least one.
    pub(crate) fn of(items: &[Item]) -> Self {
        let mut around = Self {
            bounds: Bounds::NOTHING,
            centers: Bounds::NOTHING,
        };
        for item in items {
            around.bounds.grow(&item.bounds);
            around.centers.grow_to(item.bounds.center());
        }
        around
    }

    /// The axis on which centres lie furthest apart; the first among equals.
    pub(crate) fn widest_axis(&self) -> Axis {
        widest_axis(self.centers.max - self.centers.min)
    }
}

/// The axis on which the centres of two boxes lie furthest apart, and whether the second is the lower one there: rays meet
/// the lower one first that go upwards on it.
pub(crate) fn apart(first: &Bounds, second: &Bounds) -> (Axis, bool) {
    let apart = second.center() - first.center();
    let axis = widest_axis(apart.abs());
    (axis, apart[axis.index()] < 0.0)
}

/// The axis of the largest component; the first among equals.
fn widest_axis(extent: Vec3A) -> Axis {
    let [x, y, z] = extent.to_array();
    if x >= y && x >= z {
        Axis::X
    } else if y >= z {
        Axis::Y
    } else {
        Axis::Z
    }
}

/// Moves those items to the front that are lower, and tells how many they are.
pub(crate) fn partition(items: &mut [Item], is_lower: impl Fn(&Item) -> bool) -> usize {
    let mut lower = 0;
    for at in 0..items.len() {
        let counts = is_lower(&items[at]);
        // Always swapped, and counted or not: whether it is lower is anybody's guess, a processor's too.
        items.swap(at, lower);
        lower += usize::from(counts);
    }
    lower
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, triangle: u32) -> Item {
        let corner = Vec3A::splat(x);
        let bounds = Bounds {
            min: corner,
            max: corner,
        };
        Item { bounds, triangle }
    }

    #[test]
    fn keys_ascend_with_centres_and_then_with_triangles() {
        let places = [-3e38, -1.0, -1e-40, -0.0, 0.0, 1e-40, 0.5, 2.0, 3e38];
        let items: Vec<Item> = (0..).zip(places).map(|(i, x)| at(x, i)).collect();
        for axis in Axis::ALL {
            assert!(items.is_sorted_by(|a, b| a.key(axis) < b.key(axis)));
        }
        assert_eq!(
            at(-0.0, 9).key(Axis::X),
            at(0.0, 9).key(Axis::X),
            "one place"
        );
    }

    #[test]
    fn parts_are_what_they_are_asked_for() {
        let mut items: Vec<Item> = (0..9).map(|i| at(i as f32, i)).collect();
        let middle = partition(&mut items, |item| item.triangle % 3 == 1);
        let (lower, upper) = items.split_at(middle);
        assert_eq!(middle, 3, "1, 4 and 7");
        assert!(lower.iter().all(|item| item.triangle % 3 == 1), "{lower:?}");
        assert!(upper.iter().all(|item| item.triangle % 3 != 1), "{upper:?}");
    }
}
