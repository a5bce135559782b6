//! A split that sets a few huge items apart: the walls and the floor of a room from what is in it.
//!
//! Neither planes nor object splits do that well. An object split divides by centers, so huge items inflate the box of one side until
//! they are alone, many levels further down. A plane cuts them, so that every cell has a part of a wall, and a box that reaches to it.
//! The surface area heuristic sees neither, since it looks one level ahead.
//!
//! With planes too, rays of five kinds through three generated rooms are 8, 8 and 16 % faster, and nearly as fast as with the trees of
//! [`cheapest`](crate::cheapest); through a city 10 %; through a church, a cathedral, a game level, a monastery and a garden as fast as
//! before. With one huge item in fifty, rays through the church take 4 to 7 % longer: the heuristic estimates too much of a gain in
//! cells of some thousand items. (A throw-away program, 2026-11-30.)

use glam::Vec3A;
use kd_core::Axis;

use crate::bins::{Group, half_area};
use crate::box_tree::Item;
use crate::chunks;
use crate::object_split::ObjectSplit;

/// An item is huge if its box has more than this part of the half area of the box of all.
const HUGE: f32 = 0.1;
/// At least so many items for each huge one.
const PER_HUGE: usize = 1 << 11;
/// The split is made where it costs less than this part of any other split.
const BELOW: f64 = 0.95;

/// Huge items, and all others.
#[derive(Clone, Copy, Debug)]
pub(super) struct HugeSplit {
    /// That on which the centers of both boxes are furthest apart.
    pub(super) axis: Axis,
    /// The number of items on the lower side.
    pub(super) lower: usize,
    cost: f64,
}

impl HugeSplit {
    /// Moves huge items to one end, if there are few. `around` are the corners of the box of all items.
    pub(super) fn of(
        items: &mut [Item],
        (min, max): (Vec3A, Vec3A),
        is_parallel: bool,
    ) -> Option<Self> {
        let most = items.len() / PER_HUGE;
        let least_area = HUGE * half_area(max - min);
        let is_huge = |item: &Item| half_area(item.max() - item.min()) > least_area;
        let [huge, others] = chunks::reduce(
            items,
            is_parallel,
            |items| {
                let mut groups = [Group::NOTHING; 2];
                for item in items {
                    groups[usize::from(!is_huge(item))].add(&Group::of(item));
                }
                groups
            },
            |mut groups, more| {
                for (group, more) in groups.iter_mut().zip(&more) {
                    group.add(more);
                }
                groups
            },
        );
        let count = huge.count as usize;
        if count == 0 || count > most {
            return None;
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

    fn around(items: &[Item]) -> (Vec3A, Vec3A) {
        let Aabb { min, max } = Item::around(items);
        (min.into(), max.into())
    }

    #[test]
    fn a_wall_is_set_apart() {
        for (z, wall_is_lower) in [(-3.0, true), (4.0, false)] {
            let mut items = room(z, 4000);
            let corners = around(&items);
            let split = HugeSplit::of(&mut items, corners, false).expect("one of 4001");
            let lower = if wall_is_lower { 1 } else { 4000 };
            assert_eq!((split.axis, split.lower), (Axis::Z, lower));
            let wall = if wall_is_lower { 0 } else { 4000 };
            assert_eq!(items[wall].number(), 4000, "the wall");
            let mut numbers: Vec<u32> = items.iter().map(Item::number).collect();
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..=4000), "every item once");
            let objects = ObjectSplit::best(&items).expect("centers differ");
            assert!(split.is_cheaper(f64::from(objects.cost)), "{split:?}");
        }
    }

    #[test]
    fn few_items_or_none_that_are_huge_stay() {
        for mut items in [room(1.0, 2000), room(1.0, 4000)[6..].to_vec()] {
            let before: Vec<u32> = items.iter().map(Item::number).collect();
            let corners = around(&items);
            assert!(HugeSplit::of(&mut items, corners, false).is_none());
            assert!(items.iter().map(Item::number).eq(before), "in their order");
        }
    }
}
