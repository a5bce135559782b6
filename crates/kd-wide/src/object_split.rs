//! The object split: triangles divided between bins of their centers, by the surface area heuristic (I. Wald, *On fast
//! Construction of SAH-based Bounding Volume Hierarchies*, 2007).

use glam::Vec3A;
use kd_core::Axis;

use crate::box_tree::Item;

/// Bins of an axis: for many items, and for few, where visiting all bins takes longer than visiting all items.
const BINS: usize = 32;
const BINS_OF_FEW: usize = 16;
const FEW: usize = 48;

/// 2²³: adding it leaves the nearest integer in the lowest bits.
const TO_INTEGER: f32 = (1 << 23) as f32;

/// A division of items between two bins of their centers: the object split of the whole workspace.
///
/// ```
/// use glam::Vec3;
/// use kd_core::{Aabb, Axis};
/// use kd_wide::{Item, ObjectSplit};
///
/// // Unit cubes at x = 0, 1, 2 and at x = 10, 11.
/// let cube = |(number, x): (u32, f32)| {
///     Item::within(Aabb { min: Vec3::new(x, 0.0, 0.0), max: Vec3::new(x + 1.0, 1.0, 1.0) }, number)
/// };
/// let mut items: Vec<Item> = (0..).zip([10.0, 0.0, 1.0, 11.0, 2.0]).map(cube).collect();
/// let split = ObjectSplit::best(&items).expect("the centers differ");
/// let lower = split.apply(&mut items);
/// assert_eq!((split.axis, lower), (Axis::X, 3));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ObjectSplit {
    /// The axis that the bins are on.
    pub axis: Axis,
    bins: Bins,
    /// The first bin of the upper side.
    first_upper: u32,
    /// The SAH cost: the half area of the box on each side times its number of items, in squared scene units.
    pub cost: f32,
}

/// Bins of equal width on each axis, in twice the coordinates of centers. (The first and the last are half as wide.)
#[derive(Clone, Copy, Debug)]
struct Bins {
    start: Vec3A,
    per_unit: Vec3A,
}

impl Bins {
    /// The bin of an item on each axis. On an axis without extent, or where it overflows, any bin: `BINS` is a power of two.
    #[inline(always)]
    fn of(&self, item: &Item, most: u32) -> [u32; 3] {
        let place = (item.min + item.max - self.start) * self.per_unit + TO_INTEGER;
        place.to_array().map(|place| place.to_bits() & most)
    }

    /// The bin of an item on one axis.
    #[inline(always)]
    fn of_axis(&self, item: &Item, axis: usize, most: u32) -> u32 {
        let place = (item.min[axis] + item.max[axis] - self.start[axis]) * self.per_unit[axis];
        (place + TO_INTEGER).to_bits() & most
    }
}

/// A number of items and the box around them.
#[derive(Clone, Copy, Debug)]
struct Group {
    min: Vec3A,
    max: Vec3A,
    count: u32,
}

impl Group {
    const NOTHING: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
        count: 0,
    };

    fn add(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.count += other.count;
    }

    /// The half area of the box times the number of items.
    fn cost(&self) -> f32 {
        let d = self.max - self.min;
        if self.count == 0 {
            0.0
        } else {
            (d.x * d.y + d.y * d.z + d.z * d.x) * self.count as f32
        }
    }
}

impl ObjectSplit {
    /// The split of least SAH cost; `None` if all centers are equal, or further apart than f32 can represent.
    ///
    /// Linear in the number of items: 32 bins on each axis, 16 for at most 48 items.
    pub fn best(items: &[Item]) -> Option<Self> {
        if items.len() > FEW {
            Self::best_of::<BINS>(items)
        } else {
            Self::best_of::<BINS_OF_FEW>(items)
        }
    }

    fn best_of<const COUNT: usize>(items: &[Item]) -> Option<Self> {
        let nothing = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (start, end) = items.iter().fold(nothing, |(start, end), item| {
            let center = item.min + item.max;
            (start.min(center), end.max(center))
        });
        let last = most_bin(items);
        let per_unit = Vec3A::splat(last as f32) / (end - start);
        let bins = Bins { start, per_unit };
        let mut groups = [[Group::NOTHING; COUNT]; 3];
        for item in items {
            let group = Group {
                min: item.min,
                max: item.max,
                count: 1,
            };
            for (groups, bin) in groups.iter_mut().zip(bins.of(item, last)) {
                groups[bin as usize % COUNT].add(&group);
            }
        }
        let mut best: Option<Self> = None;
        for (axis, groups) in Axis::ALL.into_iter().zip(&groups) {
            let along = axis.index();
            // It is 0 where differences overflow, and then all items are in one bin.
            let is_divided = per_unit[along] > 0.0 && per_unit[along].is_finite();
            if !(start[along] < end[along] && is_divided) {
                continue;
            }
            let (first_upper, cost) = cheapest(groups);
            if best.is_none_or(|best| cost < best.cost) {
                best = Some(Self {
                    axis,
                    bins,
                    first_upper,
                    cost,
                });
            }
        }
        best
    }

    /// Moves the items of the lower side to the front and returns their number, which is neither 0 nor all.
    ///
    /// The items must be those that the split was made for.
    pub fn apply(&self, items: &mut [Item]) -> usize {
        let last = most_bin(items);
        let axis = self.axis.index();
        let mut lower = 0;
        for at in 0..items.len() {
            let is_lower = self.bins.of_axis(&items[at], axis, last) < self.first_upper;
            // Always swapped, and counted or not: a branch on the side would be unpredictable.
            items.swap(at, lower);
            lower += usize::from(is_lower);
        }
        lower
    }
}

/// The last bin for these items.
fn most_bin(items: &[Item]) -> u32 {
    if items.len() > FEW { 31 } else { 15 }
}
const _: () = assert!(BINS == 32 && BINS_OF_FEW == 16, "the last bins");

/// The first bin of the upper side at least SAH cost, and the cost. The first and the last bin are never empty, so neither side
/// is.
#[inline(always)]
fn cheapest<const COUNT: usize>(groups: &[Group; COUNT]) -> (u32, f32) {
    let mut upper_costs = [0.0; COUNT];
    let mut upper = Group::NOTHING;
    for (cost, group) in upper_costs.iter_mut().zip(groups).skip(1).rev() {
        upper.add(group);
        *cost = upper.cost();
    }
    let mut best = (1, f32::INFINITY);
    let mut lower = Group::NOTHING;
    for ((first_upper, upper_cost), group) in (1..).zip(&upper_costs[1..]).zip(groups) {
        lower.add(group);
        let cost = lower.cost() + upper_cost;
        if cost < best.1 {
            best = (first_upper, cost);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;

    use super::*;

    fn cube_at(center: Vec3, number: u32) -> Item {
        let bounds = Aabb {
            min: center - 0.5,
            max: center + 0.5,
        };
        Item::within(bounds, number)
    }

    #[test]
    fn two_clusters_are_separated() {
        for axis in Axis::ALL {
            let mut items: Vec<Item> = (0..40)
                .map(|i| {
                    let mut center = Vec3::new(0.1, 0.2, 0.3) * (i % 7) as f32;
                    center[axis.index()] += if i % 3 == 0 { 50.0 } else { 0.0 };
                    cube_at(center, i)
                })
                .collect();
            let split = ObjectSplit::best(&items).expect("they differ");
            assert_eq!(split.axis, axis, "the axis they are apart on");
            let middle = split.apply(&mut items);
            assert_eq!(middle, 26, "all of the nearer cluster");
            assert!(
                items[..middle].iter().all(|item| item.number % 3 != 0),
                "{items:?}"
            );
        }
    }

    #[test]
    fn equal_centers_are_not_divided_and_huge_distances_are() {
        let pile: Vec<Item> = (0..9).map(|i| cube_at(Vec3::ONE, i)).collect();
        assert!(ObjectSplit::best(&pile).is_none(), "equal centers");
        let mut far: Vec<Item> = (0..9)
            .map(|i| cube_at(Vec3::X * 1e30 * i as f32, i))
            .collect();
        let split = ObjectSplit::best(&far).expect("areas overflow, places do not");
        let middle = split.apply(&mut far);
        assert!((1..9).contains(&middle), "{middle} of 9");
    }

    /// Twice the coordinate of a center may overflow, and so may the distance of two centers.
    #[test]
    fn an_axis_that_overflows_is_not_used() {
        for far in [1e38, 3e38] {
            let at = |y: f32| {
                let items = (0..9).map(|i| {
                    let x = if i % 2 == 0 { far } else { -far };
                    cube_at(Vec3::new(x, y * i as f32, 0.0), i)
                });
                items.collect::<Vec<Item>>()
            };
            let is_divided = ObjectSplit::best(&at(0.0)).is_some();
            assert!(!is_divided, "{far:e}: no other axis has extent");
            let mut items = at(100.0);
            let split = ObjectSplit::best(&items).expect("along y");
            assert_eq!(split.axis, Axis::Y, "{far:e}");
            let middle = split.apply(&mut items);
            assert!((1..9).contains(&middle), "{far:e}: {middle} of 9");
        }
    }
}
