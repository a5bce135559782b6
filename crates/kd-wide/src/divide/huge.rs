//! A split that sets a few huge items apart: the walls and the floor of a room from what is in it.
//!
//! Neither planes nor object splits do that well. An object split divides by centers, so huge items inflate the box of one side until
//! they are alone, many levels further down. A plane cuts them, so that every cell has a part of a wall, and a box that reaches to it.
//! The surface area heuristic sees neither, since it looks one level ahead.
//!
//! With planes too, rays of five kinds through three generated rooms are 8, 8 and 16 % faster, and nearly as fast as with the trees of
//! [`cheapest`](crate::cheapest); through a city 10 %; through a church, a cathedral, a game level, a monastery and a garden as fast as
//! before. With one huge item in fifty, rays through the church take 4 to 7 % longer: the heuristic estimates too much of a gain in
//! cells of some thousand items. The search takes up to a tenth of the time of a build as objects, and none on scans. (A throw-away
//! program, 2026-11-30.)

use glam::Vec3A;
use kd_core::Axis;

use crate::bins::{Group, half_area};
use crate::box_tree::Item;
use crate::chunks;
use crate::object_split::{Measured, ObjectSplit};

/// An item is huge if its box has more than this part of the half area of the box of all.
const HUGE: f32 = 0.1;
/// A cell has at least this many items per huge item.
const PER_HUGE: usize = 1 << 12;
/// The boxes of an object split overlap by at least this part of the half area of the box of all, where huge items inflate one.
const LEAST_OVERLAP: f32 = 0.1;
/// The split is made where it costs less than this part of any other split.
const BELOW: f64 = 0.95;

/// Huge items, and all others.
#[derive(Clone, Copy, Debug)]
pub(super) struct HugeSplit {
    /// The axis on which the centers of both boxes are furthest apart.
    pub(super) axis: Axis,
    /// The number of items on the lower side.
    pub(super) lower: usize,
    cost: f64,
}

impl HugeSplit {
    /// Moves huge items to one end, if there are few. `objects` is the best object split.
    pub(super) fn of(items: &mut [Item], objects: &Measured, is_parallel: bool) -> Option<Self> {
        let most = items.len() / PER_HUGE;
        let (min, max) = objects.around();
        let area = half_area(max - min);
        if most == 0 || objects.overlap() < LEAST_OVERLAP * area {
            return None;
        }
        let least_area = HUGE * area;
        let is_huge = |item: &Item| half_area(item.max() - item.min()) > least_area;
        // More than `most` in any chunk are enough to know.
        let count_of = |items: &[Item]| {
            let huge = items.iter().filter(|item| is_huge(item));
            huge.take(most + 1).count()
        };
        let count = chunks::reduce(items, is_parallel, count_of, |a, b| a + b);
        if count == 0 || count > most {
            return None;
        }
        let (mut huge, mut others) = (Group::NOTHING, Group::NOTHING);
        for item in &*items {
            let group = if is_huge(item) {
                &mut huge
            } else {
                &mut others
            };
            group.add(&Group::of(item));
        }
        let apart = (huge.min + huge.max) - (others.min + others.max);
        let axis = largest(apart.abs());
        // The huge ones are the lower side if their box is.
        let is_lower = apart[axis.index()] < 0.0;
        let mut next = 0;
        for place in 0..items.len() {
            if is_huge(&items[place]) == is_lower {
                items.swap(place, next);
                next += 1;
            }
        }
        let (lower, upper) = items.split_at(next);
        let others = if is_lower { upper } else { lower };
        let others = ObjectSplit::measured(others, is_parallel)?;
        Some(Self {
            axis,
            lower: next,
            cost: f64::from(huge.cost()) + f64::from(others.split.cost),
        })
    }

    /// Whether it is preferred to a split of this SAH cost.
    pub(super) fn is_cheaper(&self, cost: f64) -> bool {
        self.cost < BELOW * cost
    }
}

fn largest(of: Vec3A) -> Axis {
    let order = |a: &Axis, b: &Axis| of[a.index()].total_cmp(&of[b.index()]);
    Axis::ALL.into_iter().max_by(order).unwrap_or(Axis::X)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;

    use super::*;

    fn item(number: u32, min: Vec3, size: Vec3) -> Item {
        let max = min + size;
        Item::within(Aabb { min, max }, number)
    }

    /// Small items in two clusters, and a wall at the given height.
    fn room(z: f32, small: u32) -> Vec<Item> {
        let mut items: Vec<Item> = (0..small)
            .map(|number| {
                let along = number as f32 / small as f32;
                let x = if number % 2 == 0 { 0.0 } else { 9.0 } + along;
                item(number, Vec3::new(x, 9.0 * along, along), Vec3::splat(0.01))
            })
            .collect();
        items.insert(5, item(small, Vec3::Z * z, Vec3::new(10.0, 10.0, 0.0)));
        items
    }

    fn split(items: &mut [Item]) -> Option<HugeSplit> {
        let objects = ObjectSplit::measured(items, false).expect("centers differ");
        HugeSplit::of(items, &objects, false)
    }

    #[test]
    fn a_wall_is_set_apart() {
        for (z, wall_is_lower) in [(-3.0, true), (4.0, false)] {
            let mut items = room(z, 5000);
            let split = split(&mut items).expect("one of 5001");
            let lower = if wall_is_lower { 1 } else { 5000 };
            assert_eq!((split.axis, split.lower), (Axis::Z, lower));
            let wall = if wall_is_lower { 0 } else { 5000 };
            assert_eq!(items[wall].number(), 5000, "the wall");
            let mut numbers: Vec<u32> = items.iter().map(Item::number).collect();
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..=5000), "every item once");
            let objects = ObjectSplit::best(&items).expect("centers differ");
            assert!(split.is_cheaper(f64::from(objects.cost)), "{split:?}");
        }
    }

    #[test]
    fn few_items_or_none_that_are_huge_stay() {
        for mut items in [room(1.0, 4000), room(1.0, 5000)[6..].to_vec()] {
            let before: Vec<u32> = items.iter().map(Item::number).collect();
            assert!(split(&mut items).is_none());
            assert!(items.iter().map(Item::number).eq(before), "in their order");
        }
    }
}
