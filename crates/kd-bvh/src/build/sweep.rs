//! The cheapest of all divisions along the order of centres.

use kd_core::{Axis, CostModel};

use super::{Divide, Division, cost_as_leaf};
use crate::item::{Around, Bounds, Item};

/// `PARTITIONSWEEP` (algorithm 1 of Eleftheriades 2010): sorts items by their centres on each axis, and sweeps over them once
/// from above, for the costs of all upper parts, and once from below. Equal centres are in the order of their triangles; among
/// equal costs the first axis and the lowest place win.
pub(crate) struct Sweep(pub(crate) CostModel);

impl Divide for Sweep {
    /// What the items from each place on cost as a leaf.
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
            items.sort_unstable_by_key(|item| item.key(axis));
            let mut upper = Bounds::NOTHING;
            for (place, item) in items.iter().enumerate().skip(1).rev() {
                upper.grow(&item.bounds);
                upper_costs[place] = cost_as_leaf(&upper, items.len() - place, &self.0);
            }
            let mut lower = Bounds::NOTHING;
            for (place, item) in (1..items.len()).zip(&*items) {
                lower.grow(&item.bounds);
                let cost = cost_as_leaf(&lower, place, &self.0) + upper_costs[place];
                if best.is_none_or(|(best, _)| cost < best.cost) {
                    let middle = place;
                    best = Some((Division { middle, cost }, axis));
                }
            }
        }
        let (division, axis) = best?;
        items.sort_unstable_by_key(|item| item.key(axis));
        Some(division)
    }
}
