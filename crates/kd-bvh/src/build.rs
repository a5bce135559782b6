//! From the top down: one driver, and several ways to divide.

mod binned;
mod equal_counts;
mod midpoint;
mod sweep;

use kd_core::{CostModel, MAX_DEPTH};

use crate::item::{Around, Bounds, Item, apart};
use crate::node::BvhNode;

pub(crate) use binned::Binned;
pub(crate) use equal_counts::EqualCounts;
pub(crate) use midpoint::Midpoint;
pub(crate) use sweep::Sweep;

/// Subtrees of so many triangles are worth a task: some hundreds of microseconds.
const TASK: usize = 1 << 11;

/// A way to divide triangles in two.
pub(crate) trait Divide: Sync {
    /// Memory that is kept from one node to the next.
    type Scratch: Default + Send;

    /// Divides items, of which there are at least two, and moves those of the first part to the front. `None`, in whatever
    /// order they are then, if it knows no way.
    fn divide(
        &self,
        items: &mut [Item],
        around: &Around,
        scratch: &mut Self::Scratch,
    ) -> Option<Division>;
}

/// Items that were divided.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Division {
    /// How many items are in the first part: some, and not all.
    pub(crate) middle: usize,
    /// What both parts cost as leaves, times half areas.
    pub(crate) cost: f64,
}

impl Division {
    /// Of items that are in order already.
    pub(crate) fn at(middle: usize, items: &[Item], model: &CostModel) -> Self {
        let (lower, upper) = items.split_at(middle);
        let cost = [lower, upper].map(|part| cost_as_leaf(&Bounds::of(part), part.len(), model));
        Self {
            middle,
            cost: cost[0] + cost[1],
        }
    }
}

/// What a leaf of some triangles costs, times its half area.
#[inline(always)]
pub(crate) fn cost_as_leaf(bounds: &Bounds, triangles: usize, model: &CostModel) -> f64 {
    bounds.half_area() * model.leaf(triangles)
}

/// Whether so many triangles below so many nodes must be halved, and their halves be too, for all leaves to be within
/// [`MAX_DEPTH`]. A node where it is not so has no child where it is too late.
pub(crate) fn must_be_halved(triangles: usize, depth: usize) -> bool {
    let halvings = triangles.next_power_of_two().ilog2() as usize;
    depth + halvings >= MAX_DEPTH
}

/// Divides triangles until that pays no more.
pub(crate) struct Driver<'a, D> {
    pub(crate) divide: &'a D,
    pub(crate) model: CostModel,
    pub(crate) max_leaf: usize,
    pub(crate) is_parallel: bool,
}

/// Where nodes go.
#[derive(Debug, Default)]
pub(crate) struct Output<S> {
    pub(crate) nodes: Vec<BvhNode>,
    scratch: S,
}

impl<D: Divide> Driver<'_, D> {
    /// Adds the nodes over some items, at least one, and brings these in the order of the leaves. `first` is the place of the
    /// first item in the list of triangles, `depth` how many nodes lie above.
    pub(crate) fn add(
        &self,
        items: &mut [Item],
        around: &Around,
        first: u32,
        depth: usize,
        to: &mut Output<D::Scratch>,
    ) {
        let bounds = around.bounds.aabb();
        let Some(division) = self.division(items, around, depth, &mut to.scratch) else {
            // Whichever way it was divided before, a leaf has one order.
            items.sort_unstable_by_key(|item| item.triangle);
            to.nodes.push(BvhNode::leaf(&bounds, first, count(items)));
            return;
        };
        let place = to.nodes.len();
        // Filled when it is known where the second child is.
        to.nodes.push(BvhNode::leaf(&bounds, first, 0));
        let mut middle = division.middle;
        let mut parts = [&items[..middle], &items[middle..]].map(Around::of);
        // Whatever told the parts from each other may not be what tells which one a ray meets first.
        let (axis, is_second_lower) = apart(&parts[0].bounds, &parts[1].bounds);
        if is_second_lower {
            items.rotate_left(middle);
            middle = items.len() - middle;
            parts.reverse();
        }
        let (lower, upper) = items.split_at_mut(middle);
        let (at, depth) = (first + count(lower), depth + 1);
        let second;
        if self.is_parallel && lower.len().min(upper.len()) >= TASK {
            let mut other = Output::default();
            kd_tasks::join(
                || self.add(lower, &parts[0], first, depth, to),
                |_| self.add(upper, &parts[1], at, depth, &mut other),
            );
            second = index(&to.nodes);
            to.nodes
                .extend(other.nodes.iter().map(|node| node.moved(second)));
        } else {
            self.add(lower, &parts[0], first, depth, to);
            second = index(&to.nodes);
            self.add(upper, &parts[1], at, depth, to);
        }
        to.nodes[place] = BvhNode::interior(&bounds, axis, second);
    }

    /// How to divide items; `None` if they are a leaf.
    fn division(
        &self,
        items: &mut [Item],
        around: &Around,
        depth: usize,
        scratch: &mut D::Scratch,
    ) -> Option<Division> {
        if items.len() == 1 {
            return None;
        }
        let halve = |items: &mut [Item]| EqualCounts(self.model).halve(items, around);
        let division = if must_be_halved(items.len(), depth) {
            halve(items)
        } else {
            let division = self.divide.divide(items, around, scratch);
            division.unwrap_or_else(|| halve(items))
        };
        let own = f64::from(self.model.traverse) * around.bounds.half_area();
        let as_leaf = cost_as_leaf(&around.bounds, items.len(), &self.model);
        let is_worth_it = own + division.cost < as_leaf;
        (is_worth_it || items.len() > self.max_leaf).then_some(division)
    }
}

/// Where the next node goes.
#[allow(
    clippy::cast_possible_truncation,
    reason = "there are fewer than twice as many nodes as triangles, which are below 2^30"
)]
pub(crate) fn index(nodes: &[BvhNode]) -> u32 {
    nodes.len() as u32
}

#[allow(clippy::cast_possible_truncation, reason = "30 bits count triangles")]
fn count(items: &[Item]) -> u32 {
    items.len() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_depth_is_kept_whatever_divides() {
        // One triangle is split off each time, the worst there can be.
        for triangles in [1, 2, 3, 64, 65, 1000, 1 << 20, (1 << 30) - 1] {
            let (mut left, mut depth) = (triangles, 0);
            while left > 1 {
                left = if must_be_halved(left, depth) {
                    left.div_ceil(2)
                } else {
                    left - 1
                };
                depth += 1;
            }
            assert!(depth <= MAX_DEPTH, "{triangles}: {depth}");
            if triangles > 64 {
                assert_eq!(depth, MAX_DEPTH, "{triangles}: as deep as may be");
            }
        }
    }
}
