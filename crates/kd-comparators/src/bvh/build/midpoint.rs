//! The division in the middle of the centers.

use kd_core::CostModel;
use kd_trace::kit::Item;

use super::{Divide, Division};
use crate::bvh::bounds::{Around, Bounds, partition};

/// Divides items in the middle of the largest extent of centers.
pub(crate) struct Midpoint(pub(crate) CostModel);

impl Divide for Midpoint {
    type Scratch = ();

    fn divide(&self, items: &mut [Item], around: &Around, (): &mut ()) -> Option<Division> {
        let axis = around.widest_axis();
        let along = axis.index();
        let plane = around.centers.center()[along];
        let middle = partition(items, |item| Bounds::of(item).center()[along] < plane);
        // No division if all centers are in one place, or so close that the middle is rounded to the lowest center.
        let is_divided = middle > 0 && middle < items.len();
        is_divided.then(|| Division::at(middle, items, &self.0))
    }
}
