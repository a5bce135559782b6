//! The SAH division between bins.

use kd_core::CostModel;
use kd_trace::kit::{Item, ObjectSplit};

use super::{Divide, Division};
use crate::bvh::bounds::Around;

/// The object split of wide nodes ([`ObjectSplit`]): bins of centers on all axes, with the area of boxes times their items as
/// cost.
pub(crate) struct Binned(pub(crate) CostModel);

impl Divide for Binned {
    type Scratch = ();

    fn divide(&self, items: &mut [Item], _: &Around, (): &mut ()) -> Option<Division> {
        let middle = ObjectSplit::best(items)?.apply(items);
        Some(Division::at(middle, items, &self.0))
    }
}
