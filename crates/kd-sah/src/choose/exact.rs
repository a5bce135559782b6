//! Exact SAH without sorting all events. Bins give a lower bound of the cost of the planes in them, and only bins that may
//! contain the best plane are swept ([`promising`](crate::promising)). In small cells every candidate is counted
//! ([`small`]).
//!
//! The plane is the same as that of the other exact choosers, ties included. The time is linear unless the cost is almost
//! constant over the cell. No data is kept between cells, so the memory is that of the primitives.

use super::Memoryless;
use crate::bins::{self, Bins, Grid, MOST_BINS};
use crate::cell::Cell;
use crate::plane::{BestPlane, CellCost, Plane};
use crate::promising::Promising;
use crate::small::{self, SMALL};

/// The exact chooser by lower bounds.
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

/// A number of bins such that a bin holds about a dozen primitives.
fn bins_for(count: usize) -> usize {
    (count / 12).next_power_of_two().clamp(32, MOST_BINS)
}
