//! SAH by bins (Shevtsov, Soupikov, Kapustin 2007, *Highly parallel fast KD-tree construction for interactive ray
//! tracing of dynamic scenes*; Eleftheriades 2010 §2.4.2.1).
//!
//! Two counters a bin and axis, one touched where a primitive starts and one where it ends. A pass over the bins names
//! the few that look best, and the plane is adjusted to where geometry really starts and ends: what lies in these bins
//! is swept exactly. Planes that cut off empty space come from the box around the primitives, which is known anyway.
//! (Without them and without clipped boxes, binning gives bad trees.)
//!
//! Where we differ: a bin looks as good as the best plane that could be in it ([`promising`](crate::promising)), not
//! as its boundaries. In buildings, where many primitives start and end in one plane, the cost dips between two
//! boundaries that look bad, and trees by boundaries alone cost more. (The best boundary competes too.)

use super::Memoryless;
use crate::bins::{self, Bins, Grid};
use crate::cell::Cell;
use crate::plane::{BestPlane, CellCost, Plane, offer_empty_cuts};
use crate::promising::Promising;

/// Above so many primitives a bin, only every lth is looked at, l = log₁₀ N: what is counted is then an estimate, while
/// the side of each primitive is decided by the plane, exactly.
const SAMPLE_ABOVE: usize = 128;

/// Of so many bins on all axes considered, one is looked into, and one at least.
const BINS_PER_LOOK: usize = 12;

/// Binned planes, with so many bins an axis.
#[derive(Debug)]
pub(crate) struct Binned {
    pub(crate) bins: usize,
}

impl Memoryless for Binned {
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, parallel: bool) -> Option<Plane> {
        let step = self.step(cell.prims.len());
        let grid = Grid::new(&cell.place.tight, self.bins);
        let chunks = bins::count(cell, cost.considered, &grid, step, parallel);
        let mut best = BestPlane::new(cost);
        offer_empty_cuts(&mut best, &cell.place.tight, cell.prims.len());
        let mut promising = Promising::of(&Bins::sum(&chunks), step, &grid, cost);
        promising.offer_boundary_to(&mut best);
        let bins = self.bins * cost.considered.len();
        promising.limit((bins / BINS_PER_LOOK).max(1));
        promising.offer_to(&mut best, cell, &chunks, parallel);
        best.found()
    }
}

impl Binned {
    /// Each which primitive is looked at.
    fn step(&self, count: usize) -> usize {
        if count > SAMPLE_ABOVE * self.bins {
            count.ilog10() as usize
        } else {
            1
        }
    }
}
