//! Any chooser for large cells, the exact one for small cells.

use super::{Exact, Memoryless};
use crate::cell::Cell;
use crate::plane::{CellCost, Plane};

/// Chooses by `above` in cells of more than `exact_below` primitives, and exactly in others.
#[derive(Debug)]
pub(crate) struct Hybrid<C> {
    pub(crate) above: C,
    pub(crate) exact_below: u32,
}

impl<C: Memoryless> Memoryless for Hybrid<C> {
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, parallel: bool) -> Option<Plane> {
        if cell.prims.len() <= self.exact_below as usize {
            Exact.plane(cell, cost, parallel)
        } else {
            self.above.plane(cell, cost, parallel)
        }
    }
}
