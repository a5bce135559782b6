//! Top-down construction: one driver and several divisions.

mod binned;
mod equal_counts;
mod midpoint;
mod sweep;

use kd_core::{CostModel, MAX_DEPTH};
use kd_trace::kit::Item;

use super::bounds::{Around, Bounds, apart};
use super::node::BvhNode;

pub(crate) use binned::Binned;
pub(crate) use equal_counts::EqualCounts;
pub(crate) use midpoint::Midpoint;
pub(crate) use sweep::Sweep;

/// Subtrees of this many triangles become tasks: some hundreds of microseconds.
const TASK: usize = 1 << 11;

/// A way to divide triangles in two.
pub(crate) trait Divide: Sync {
    /// Memory reused from node to node.
    type Scratch: Default + Send;

    /// Divides at least two items, and moves those of the first side to the front. `None`, with the items in any order, if no
    /// division exists.
    fn divide(
        &self,
        items: &mut [Item],
        around: &Around,
        scratch: &mut Self::Scratch,
    ) -> Option<Division>;
}

/// The outcome of a division.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Division {
    /// Number of items on the first side: at least one, and not all.
    pub(crate) middle: usize,
    /// Cost of both sides as leaves, times half areas.
    pub(crate) cost: f64,
}

impl Division {
    /// A division of items that are in order already.
    pub(crate) fn at(middle: usize, items: &[Item], model: &CostModel) -> Self {
        let (lower, upper) = items.split_at(middle);
        let cost =
            [lower, upper].map(|side| cost_as_leaf(&Bounds::of_all(side), side.len(), model));
        Self {
            middle,
            cost: cost[0] + cost[1],
        }
    }
}

/// The cost of a leaf, times its half area.
#[inline(always)]
pub(crate) fn cost_as_leaf(bounds: &Bounds, triangles: usize, model: &CostModel) -> f64 {
    bounds.half_area() * model.leaf(triangles)
}

/// Whether `triangles` triangles below `depth` nodes must be halved, again and again, to keep all leaves within [`MAX_DEPTH`].
/// The answer changes from `false` to `true` early enough on every path.
pub(crate) fn must_be_halved(triangles: usize, depth: usize) -> bool {
    let halvings = triangles.next_power_of_two().ilog2() as usize;
    depth + halvings >= MAX_DEPTH
}

/// Divides triangles until a leaf costs less.
pub(crate) struct Driver<'a, D> {
    pub(crate) divide: &'a D,
    pub(crate) model: CostModel,
    pub(crate) max_leaf: usize,
    pub(crate) is_parallel: bool,
}

/// The nodes so far.
#[derive(Debug, Default)]
pub(crate) struct Output<S> {
    pub(crate) nodes: Vec<BvhNode>,
    scratch: S,
}

impl<D: Divide> Driver<'_, D> {
    /// Adds the nodes over at least one item, and sorts the items in the order of the leaves. `first` is the index of the first
    /// item in the triangle list, `depth` the number of nodes above.
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
            // The order in a leaf does not depend on the divisions above it.
            items.sort_unstable_by_key(|item| item.number());
            to.nodes.push(BvhNode::leaf(&bounds, first, count(items)));
            return;
        };
        let place = to.nodes.len();
        // Replaced once the index of the second child is known.
        to.nodes.push(BvhNode::leaf(&bounds, first, 0));
        let mut middle = division.middle;
        let mut sides = [&items[..middle], &items[middle..]].map(Around::of);
        // The axis of the division need not be the axis on which the boxes are furthest apart.
        let (axis, is_second_lower) = apart(&sides[0].bounds, &sides[1].bounds);
        if is_second_lower {
            items.rotate_left(middle);
            middle = items.len() - middle;
            sides.reverse();
        }
        let (lower, upper) = items.split_at_mut(middle);
        let (at, depth) = (first + count(lower), depth + 1);
        let second;
        if self.is_parallel && lower.len().min(upper.len()) >= TASK {
            let mut other = Output::default();
            kd_tasks::join(
                || self.add(lower, &sides[0], first, depth, to),
                |_| self.add(upper, &sides[1], at, depth, &mut other),
            );
            second = index(&to.nodes);
            to.nodes
                .extend(other.nodes.iter().map(|node| node.moved(second)));
        } else {
            self.add(lower, &sides[0], first, depth, to);
            second = index(&to.nodes);
            self.add(upper, &sides[1], at, depth, to);
        }
        to.nodes[place] = BvhNode::interior(&bounds, axis, second);
    }

    /// The division of items; `None` if they become a leaf.
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

/// The index of the next node.
#[allow(
    clippy::cast_possible_truncation,
    reason = "nodes are fewer than twice the triangles, which are below 2^30"
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
    fn no_division_exceeds_the_depth_limit() {
        // The worst case: each division splits off one triangle.
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
                assert_eq!(depth, MAX_DEPTH, "{triangles}: the limit");
            }
        }
    }
}
