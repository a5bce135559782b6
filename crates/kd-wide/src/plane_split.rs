//! The plane split: the plane between two bins that divides triangles at least SAH cost, where a triangle that crosses the plane
//! counts on both sides (M. Stich, H. Friedrich, A. Dietrich, *Spatial Splits in Bounding Volume Hierarchies*, 2009, section 4).

use glam::Vec3A;
use kd_core::Axis;

use crate::bins::{Bins, Group, half_area, last_of};
use crate::box_tree::Item;
use crate::chunks;

/// Bins of an axis.
const BINS: usize = 32;
const LAST: u32 = last_of::<BINS>();

/// A plane between bins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneSplit {
    pub(crate) axis: Axis,
    pub(crate) position: f32,
    /// The half area of the box on each side times its number of items, in squared scene units. Boxes end at the plane; otherwise
    /// items are not clipped, so that this is an upper bound.
    pub(crate) cost: f32,
    /// Items on the lower and the upper side, as close as rounding permits: those that cross the plane count twice.
    pub(crate) counts: [u32; 2],
}

/// The items of a bin.
#[derive(Clone, Copy)]
struct Bin {
    /// Those that are in no other bin.
    inside: Group,
    /// Those that begin in it and end in a later bin.
    begin: Group,
    /// Those that end in it and begin in an earlier bin.
    end: Group,
}

impl Bin {
    const EMPTY: Self = Self {
        inside: Group::NOTHING,
        begin: Group::NOTHING,
        end: Group::NOTHING,
    };

    fn add(&mut self, other: &Self) {
        self.inside.add(&other.inside);
        self.begin.add(&other.begin);
        self.end.add(&other.end);
    }
}

impl PlaneSplit {
    /// The plane of least cost that has items on both sides. `start` and `end` are the corners of the box around the items.
    ///
    /// Linear in the number of items: 32 bins on each axis. Parallel: on the threads of the pool in scope, with the same result.
    pub(crate) fn best(
        items: &[Item],
        (start, end): (Vec3A, Vec3A),
        is_parallel: bool,
    ) -> Option<Self> {
        let bins = Bins::new(start, end, LAST);
        let counted = chunks::reduce(
            items,
            is_parallel,
            |items| bins_of(items, &bins),
            |mut all, bins| {
                for (all, bin) in all.as_flattened_mut().iter_mut().zip(bins.as_flattened()) {
                    all.add(bin);
                }
                all
            },
        );
        let mut best: Option<Self> = None;
        for (axis, counted) in Axis::ALL.into_iter().zip(&counted) {
            if bins.divide(axis.index()) {
                best = cheapest(axis, counted, &bins, best);
            }
        }
        best
    }
}

fn bins_of(items: &[Item], bins: &Bins) -> [[Bin; BINS]; 3] {
    let mut counted = [[Bin::EMPTY; BINS]; 3];
    for item in items {
        let own = Group::of(item);
        let corners = [item.min(), item.max()];
        let [first, last] = corners.map(|corner| bins.of::<BINS>(corner));
        for (counted, (first, last)) in counted.iter_mut().zip(first.into_iter().zip(last)) {
            let (first, last) = (first as usize % BINS, last as usize % BINS);
            if first == last {
                counted[first].inside.add(&own);
            } else {
                counted[first].begin.add(&own);
                counted[last].end.add(&own);
            }
        }
    }
    counted
}

/// The cheapest plane of an axis, or the one from before if that costs no more.
fn cheapest(
    axis: Axis,
    counted: &[Bin; BINS],
    bins: &Bins,
    mut best: Option<PlaneSplit>,
) -> Option<PlaneSplit> {
    let along = axis.index();
    // From each bin on.
    let mut uppers = [Group::NOTHING; BINS];
    let mut upper = Group::NOTHING;
    for (all, bin) in uppers.iter_mut().zip(counted).rev() {
        upper.add(&bin.inside);
        upper.add(&bin.end);
        *all = upper;
    }
    let mut lower = Group::NOTHING;
    for ((bin, counted), upper) in (0..).zip(counted).zip(&uppers[1..]) {
        lower.add(&counted.inside);
        lower.add(&counted.begin);
        if lower.count == 0 || upper.count == 0 {
            continue;
        }
        let position = bins.end_of(bin, along);
        let (mut high, mut low) = (lower.max, upper.min);
        high[along] = high[along].min(position);
        low[along] = low[along].max(position);
        let cost = half_area(high - lower.min) * lower.count as f32
            + half_area(upper.max - low) * upper.count as f32;
        if best.is_none_or(|best| cost < best.cost) {
            best = Some(PlaneSplit {
                axis,
                position,
                cost,
                counts: [lower.count, upper.count],
            });
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;

    use super::*;

    fn item(min: [f32; 3], max: [f32; 3], number: u32) -> Item {
        let bounds = Aabb {
            min: Vec3::from(min),
            max: Vec3::from(max),
        };
        Item::within(bounds, number)
    }

    fn best(items: &[Item]) -> Option<PlaneSplit> {
        let around = Item::around(items);
        PlaneSplit::best(items, (around.min.into(), around.max.into()), false)
    }

    /// Every boundary of every axis, counted item by item.
    fn by_counting(items: &[Item]) -> f32 {
        let around = Item::around(items);
        let bins = Bins::new(around.min.into(), around.max.into(), LAST);
        let mut least = f32::INFINITY;
        for axis in 0..3 {
            for boundary in 0..LAST {
                let position = bins.end_of(boundary, axis);
                let mut sides = [Group::NOTHING; 2];
                for item in items {
                    if bins.of_axis(item.min()[axis], axis) <= boundary {
                        sides[0].add(&Group::of(item));
                    }
                    if bins.of_axis(item.max()[axis], axis) > boundary {
                        sides[1].add(&Group::of(item));
                    }
                }
                if sides.iter().any(|side| side.count == 0) {
                    continue;
                }
                sides[0].max[axis] = sides[0].max[axis].min(position);
                sides[1].min[axis] = sides[1].min[axis].max(position);
                least = least.min(sides[0].cost() + sides[1].cost());
            }
        }
        least
    }

    #[test]
    fn the_best_plane_is_the_cheapest_of_all() {
        let mut state = 7_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        for round in 0..40 {
            let large = 2.0_f32.powi(round % 8 - 6);
            let items: Vec<Item> = (0..200)
                .map(|number| {
                    let min = [random(), random(), 3.0 * random()];
                    let max = min.map(|x| x + large * random());
                    item(min, max, number)
                })
                .collect();
            let found = best(&items).expect("they have an extent");
            assert_eq!(found.cost, by_counting(&items), "round {round}");
            let crossing = |item: &&Item| {
                let along = found.axis.index();
                item.min()[along] < found.position && found.position < item.max()[along]
            };
            let crossing = items.iter().filter(crossing).count();
            let twice = (found.counts[0] + found.counts[1]) as usize - items.len();
            assert!(
                crossing.abs_diff(twice) <= 2,
                "{crossing} cross, {twice} count twice"
            );
        }
    }

    #[test]
    fn a_box_without_extent_has_no_plane() {
        let pile: Vec<Item> = (0..9).map(|i| item([1.0; 3], [1.0; 3], i)).collect();
        assert!(best(&pile).is_none(), "a point");
        let far: Vec<Item> = [-3e38, 3e38]
            .map(|x| item([x, 0.0, 0.0], [x, 0.0, 0.0], 0))
            .to_vec();
        assert!(best(&far).is_none(), "the extent overflows");
    }
}
