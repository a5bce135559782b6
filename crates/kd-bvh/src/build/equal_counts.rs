//! As many triangles on each side.

use kd_core::CostModel;

use super::{Divide, Division};
use crate::item::{Around, Item};

/// Halves items across the axis on which their centres lie furthest apart.
///
/// It finds a way where nothing else does: centres in one place are told apart by the numbers of triangles.
pub(crate) struct EqualCounts(pub(crate) CostModel);

impl EqualCounts {
    pub(crate) fn halve(&self, items: &mut [Item], around: &Around) -> Division {
        let axis = around.widest_axis();
        let middle = items.len() / 2;
        items.select_nth_unstable_by_key(middle, |item| item.key(axis));
        Division::at(middle, items, &self.0)
    }
}

impl Divide for EqualCounts {
    type Scratch = ();

    fn divide(&self, items: &mut [Item], around: &Around, (): &mut ()) -> Option<Division> {
        Some(self.halve(items, around))
    }
}
