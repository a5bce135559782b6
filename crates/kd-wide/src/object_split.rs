//! The object split: triangles divided between bins of their centers, by the surface area heuristic (I. Wald, *On fast
//! Construction of SAH-based Bounding Volume Hierarchies*, 2007).

use glam::Vec3A;
use kd_core::Axis;

use crate::bins::{Bins, Group, half_area, last_of};
use crate::box_tree::Item;
use crate::chunks;

/// Bins of an axis, by the number of items: visiting all bins of few items takes longer than visiting the items.
///
/// (With 32 bins above 48 items and 16 below, builds take 6 % longer, for 0.1 % of SAH cost. A throw-away program over 13 meshes,
/// 2026-11-30.)
const BINS: usize = 32;
const BINS_OF_FEW: usize = 16;
const BINS_OF_VERY_FEW: usize = 8;
const FEW: usize = 96;
const VERY_FEW: usize = 24;

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

/// An object split, and what is on its sides.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured {
    pub(crate) split: ObjectSplit,
    /// The items of the lower and of the upper side.
    sides: [Group; 2],
}

impl ObjectSplit {
    /// The split of least SAH cost; `None` if all centers are equal, or further apart than f32 can represent.
    ///
    /// Linear in the number of items: 32 bins on each axis, 16 for at most 96 items and 8 for at most 24.
    pub fn best(items: &[Item]) -> Option<Self> {
        if items.len() > FEW {
            Self::best_of::<BINS, _>(items, false, |split, _| split)
        } else if items.len() > VERY_FEW {
            Self::best_of::<BINS_OF_FEW, _>(items, false, |split, _| split)
        } else {
            Self::best_of::<BINS_OF_VERY_FEW, _>(items, false, |split, _| split)
        }
    }

    /// [`best`](Self::best) of more than 96 items, with its sides. Parallel: on the threads of the pool in scope, with the same
    /// result.
    pub(crate) fn measured(items: &[Item], is_parallel: bool) -> Option<Measured> {
        debug_assert!(items.len() > FEW, "as many bins as `apply` takes");
        Self::best_of::<BINS, _>(items, is_parallel, |split, groups| {
            let mut sides = [Group::NOTHING; 2];
            for (group, bin) in groups.iter().zip(0..) {
                sides[usize::from(bin >= split.first_upper)].add(group);
            }
            Measured { split, sides }
        })
    }

    /// `finish` receives the bins of the axis of the split too.
    #[inline(always)]
    fn best_of<const COUNT: usize, R>(
        items: &[Item],
        is_parallel: bool,
        finish: impl FnOnce(Self, &[Group; COUNT]) -> R,
    ) -> Option<R> {
        let (start, end) = chunks::reduce(items, is_parallel, centers_around, |a, b| {
            (a.0.min(b.0), a.1.max(b.1))
        });
        let bins = Bins::new(start, end, last_of::<COUNT>());
        let groups = chunks::reduce(
            items,
            is_parallel,
            |items| groups_of::<COUNT>(items, &bins),
            |mut all, groups| {
                for (all, group) in all.as_flattened_mut().iter_mut().zip(groups.as_flattened()) {
                    all.add(group);
                }
                all
            },
        );
        let mut best: Option<Self> = None;
        for (axis, groups) in Axis::ALL.into_iter().zip(&groups) {
            let along = axis.index();
            // Where differences overflow, all items are in one bin.
            if !(start[along] < end[along] && bins.divide(along)) {
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
        best.map(|best| finish(best, &groups[best.axis.index()]))
    }

    /// Moves the items of the lower side to the front and returns their number, which is neither 0 nor all.
    ///
    /// The items must be those that the split was made for.
    pub fn apply(&self, items: &mut [Item]) -> usize {
        let axis = self.axis.index();
        let mut lower = 0;
        for at in 0..items.len() {
            let center = items[at].min_on(axis) + items[at].max_on(axis);
            let is_lower = self.bins.of_axis(center, axis) < self.first_upper;
            // Always swapped, and counted or not: a branch on the side would be unpredictable.
            items.swap(at, lower);
            lower += usize::from(is_lower);
        }
        lower
    }
}

impl Measured {
    /// The box of all items: its corners.
    pub(crate) fn around(&self) -> (Vec3A, Vec3A) {
        let [lower, upper] = &self.sides;
        (lower.min.min(upper.min), lower.max.max(upper.max))
    }

    /// The half area that the boxes of both sides share, in squared scene units.
    pub(crate) fn overlap(&self) -> f32 {
        let [lower, upper] = &self.sides;
        let shared = lower.max.min(upper.max) - lower.min.max(upper.min);
        if shared.min_element() < 0.0 {
            0.0
        } else {
            half_area(shared)
        }
    }
}

/// The box around the centers of items, in twice their coordinates.
#[inline(always)]
fn centers_around(items: &[Item]) -> (Vec3A, Vec3A) {
    let nothing = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    items.iter().fold(nothing, |(start, end), item| {
        let center = item.min() + item.max();
        (start.min(center), end.max(center))
    })
}

/// What is in each bin of each axis, by centers in twice their coordinates.
#[inline(always)]
fn groups_of<const COUNT: usize>(items: &[Item], bins: &Bins) -> [[Group; COUNT]; 3] {
    let mut groups = [[Group::NOTHING; COUNT]; 3];
    for item in items {
        let own = Group::of(item);
        let places = bins.of::<COUNT>(item.min() + item.max());
        for (groups, bin) in groups.iter_mut().zip(places) {
            groups[bin as usize % COUNT].add(&own);
        }
    }
    groups
}

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
                items[..middle].iter().all(|item| item.number() % 3 != 0),
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
