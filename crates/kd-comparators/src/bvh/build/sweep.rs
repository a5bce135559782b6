//! The SAH division among all positions in the order of centers.

use kd_core::{Axis, CostModel};
use kd_trace::kit::Item;

use super::{Divide, Division, cost_as_leaf};
use crate::bvh::bounds::{Around, Bounds, key};

/// `PARTITIONSWEEP` (algorithm 1 of Eleftheriades 2010): sorts items by their centers on each axis, sweeps over them from above
/// for the cost of each upper side, then from below. Equal centers are ordered by their triangles. Among equal costs the first
/// axis and the lowest position win.
pub(crate) struct Sweep(pub(crate) CostModel);

impl Divide for Sweep {
    /// The cost, as a leaf, of the items from each position on.
    type Scratch = Vec<f64>;

    fn divide(
        &self,
        items: &mut [Item],
        _: &Around,
        upper_costs: &mut Vec<f64>,
    ) -> Option<Division> {
        let mut best: Option<(Division, Axis)> = None;
        upper_costs.clear();
        upper_costs.resize(items.len(), 0.0);
        for axis in Axis::ALL {
            items.sort_unstable_by_key(|item| key(item, axis));
            let mut upper = Bounds::NOTHING;
            for (place, item) in items.iter().enumerate().skip(1).rev() {
                upper.grow(&Bounds::of(item));
                upper_costs[place] = cost_as_leaf(&upper, items.len() - place, &self.0);
            }
            let mut lower = Bounds::NOTHING;
            for (place, item) in (1..items.len()).zip(&*items) {
                lower.grow(&Bounds::of(item));
                let cost = cost_as_leaf(&lower, place, &self.0) + upper_costs[place];
                if best.is_none_or(|(best, _)| cost < best.cost) {
                    let middle = place;
                    best = Some((Division { middle, cost }, axis));
                }
            }
        }
        let (division, axis) = best?;
        items.sort_unstable_by_key(|item| key(item, axis));
        Some(division)
    }
}
