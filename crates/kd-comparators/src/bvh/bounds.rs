//! Boxes of triangles and of groups of triangles, as builders use them.

use glam::Vec3A;
use kd_core::{Aabb, Axis};
use kd_trace::kit::Item;

/// A box that grows. Starts from [`NOTHING`](Self::NOTHING).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) min: Vec3A,
    pub(crate) max: Vec3A,
}

/// The box of a group of items and the box of their centers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    pub(crate) bounds: Bounds,
    pub(crate) centers: Bounds,
}

impl Bounds {
    pub(crate) const NOTHING: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
    };

    /// The box of one item.
    #[inline(always)]
    pub(crate) fn of(item: &Item) -> Self {
        Self {
            min: item.min(),
            max: item.max(),
        }
    }

    /// The box of all items.
    pub(crate) fn of_all(items: &[Item]) -> Self {
        let boxes = items.iter().map(Self::of);
        boxes.fold(Self::NOTHING, |around, bounds| around.union(&bounds))
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

    /// The center. The sum of two halves is finite for any finite box.
    #[inline(always)]
    pub(crate) fn center(&self) -> Vec3A {
        0.5 * self.min + 0.5 * self.max
    }

    /// Half the surface area of a box that is not empty. f64 neither overflows nor underflows here; the result equals
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

/// A sort key: ascends with the item's center on an axis, then with its triangle. No two items of a mesh have the same key.
#[inline(always)]
pub(crate) fn key(item: &Item, axis: Axis) -> u64 {
    // Adding zero turns -0.0 into 0.0, which is the same place.
    let center = Bounds::of(item).center()[axis.index()] + 0.0;
    let bits = center.to_bits();
    // The bits of negative numbers descend while the numbers ascend.
    let ascending = if bits >> 31 == 0 {
        bits | 1 << 31
    } else {
        !bits
    };
    u64::from(ascending) << 32 | u64::from(item.number())
}

impl Around {
    /// Both boxes of a group of at least one item.
    pub(crate) fn of(items: &[Item]) -> Self {
        let mut around = Self {
            bounds: Bounds::NOTHING,
            centers: Bounds::NOTHING,
        };
        for item in items {
            let bounds = Bounds::of(item);
            around.bounds.grow(&bounds);
            around.centers.grow_to(bounds.center());
        }
        around
    }

    /// The axis with the largest extent of centers; the first among equals.
    pub(crate) fn widest_axis(&self) -> Axis {
        widest_axis(self.centers.max - self.centers.min)
    }
}

/// The axis with the largest distance between the centers of two boxes, and whether the second box is lower on that axis.
/// Rays that ascend on the axis meet the lower box first.
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

/// Moves the lower items to the front, and returns their count.
pub(crate) fn partition(items: &mut [Item], is_lower: impl Fn(&Item) -> bool) -> usize {
    let mut lower = 0;
    for at in 0..items.len() {
        let counts = is_lower(&items[at]);
        // Swaps in any case: a branch on `counts` would be unpredictable.
        items.swap(at, lower);
        lower += usize::from(counts);
    }
    lower
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f32, number: u32) -> Item {
        Item::within(Aabb::around([glam::Vec3::splat(x)]), number)
    }

    #[test]
    fn keys_ascend_with_centers_and_then_with_triangles() {
        let places = [-3e38, -1.0, -1e-40, -0.0, 0.0, 1e-40, 0.5, 2.0, 3e38];
        let items: Vec<Item> = (0..).zip(places).map(|(i, x)| at(x, i)).collect();
        for axis in Axis::ALL {
            assert!(items.is_sorted_by(|a, b| key(a, axis) < key(b, axis)));
        }
        assert_eq!(
            key(&at(-0.0, 9), Axis::X),
            key(&at(0.0, 9), Axis::X),
            "the same place"
        );
    }

    #[test]
    fn partition_moves_the_lower_items_to_the_front() {
        let mut items: Vec<Item> = (0..9).map(|i| at(i as f32, i)).collect();
        let middle = partition(&mut items, |item| item.number() % 3 == 1);
        let (lower, upper) = items.split_at(middle);
        assert_eq!(middle, 3, "1, 4 and 7");
        assert!(lower.iter().all(|item| item.number() % 3 == 1), "{lower:?}");
        assert!(upper.iter().all(|item| item.number() % 3 != 1), "{upper:?}");
    }
}
