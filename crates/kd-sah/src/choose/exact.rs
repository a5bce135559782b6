//! SAH without sorting everything: bins bound what any plane in them can cost, and only those that may hold the best
//! plane are looked into ([`promising`](crate::promising)). Where few primitives are left, every candidate is counted
//! ([`small`]).
//!
//! The plane is the same as that of the other exact choosers, ties included, in linear time as long as the cost is
//! not almost the same everywhere. Nothing is kept from cell to cell, so memory is that of the primitives.

use super::Memoryless;
use crate::bins::{self, Bins, Grid, MOST_BINS};
use crate::cell::Cell;
use crate::plane::{BestPlane, CellCost, Plane};
use crate::promising::Promising;
use crate::small::{self, SMALL};

/// The exact plane by bounds.
#[derive(Debug)]
pub(crate) struct Exact;

impl Memoryless for Exact {
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, parallel: bool) -> Option<Plane> {
        let count = cell.prims.len();
        if count <= SMALL {
            return small::best_plane(cell.prims, cost);
        }
        let grid = Grid::new(&cell.place.tight, bins_for(count));
        let chunks = bins::count(cell, cost.considered, &grid, 1, parallel);
        let mut best = BestPlane::new(cost);
        Promising::of(&Bins::sum(&chunks), 1, &grid, cost)
            .offer_to(&mut best, cell, &chunks, parallel);
        best.found()
    }
}

/// Enough that a bin holds about a dozen primitives.
fn bins_for(count: usize) -> usize {
    (count / 12).next_power_of_two().clamp(32, MOST_BINS)
}
