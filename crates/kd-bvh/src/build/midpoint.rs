//! The middle between the outermost centres.

use kd_core::CostModel;

use super::{Divide, Division};
use crate::item::{Around, Item, partition};

/// Divides items in the middle of the axis on which their centres lie furthest apart.
pub(crate) struct Midpoint(pub(crate) CostModel);

impl Divide for Midpoint {
    type Scratch = ();

    fn divide(&self, items: &mut [Item], around: &Around, (): &mut ()) -> Option<Division> {
        let axis = around.widest_axis();
        let along = axis.index();
        let plane = around.centers.center()[along];
        let middle = partition(items, |item| item.bounds.center()[along] < plane);
        // Centres in one place, or so close that the middle is rounded to the lowest of them.
        let is_divided = middle > 0 && middle < items.len();
        is_divided.then(|| Division::at(middle, items, &self.0))
    }
}
