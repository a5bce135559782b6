//! The division with equal counts on both sides.

use kd_core::CostModel;
use kd_trace::kit::Item;

use super::{Divide, Division};
use crate::bvh::bounds::{Around, key};

/// Halves items on the axis with the largest extent of centers.
///
/// This division always exists: centers in one place are ordered by their triangles.
pub(crate) struct EqualCounts(pub(crate) CostModel);

impl EqualCounts {
    pub(crate) fn halve(&self, items: &mut [Item], around: &Around) -> Division {
        let axis = around.widest_axis();
        let middle = items.len() / 2;
        items.select_nth_unstable_by_key(middle, |item| key(item, axis));
        Division::at(middle, items, &self.0)
    }
}

impl Divide for EqualCounts {
    type Scratch = ();

    fn divide(&self, items: &mut [Item], around: &Around, (): &mut ()) -> Option<Division> {
        Some(self.halve(items, around))
    }
}
