//! SAH by bins (Shevtsov, Soupikov, Kapustin 2007, *Highly parallel fast KD-tree construction for interactive ray
//! tracing of dynamic scenes*; Eleftheriades 2010 §2.4.2.1).
//!
//! Two counters a bin and axis, one touched where a primitive starts and one where it ends. A pass over the bins names
//! the few that look best, and the plane is adjusted to where geometry really starts and ends: what lies in these bins
//! is swept exactly. Planes that cut off empty space come from the box around the primitives, which is known anyway.
//! (Without them and without clipped boxes, binning gives bad trees.)
//!
//! Where we differ: in buildings, where many primitives start and end in one plane, the cost dips between two boundaries
//! that look bad, so a bin looks as good as the best plane that could be in it ([`promising`](crate::promising)), not as
//! its boundaries. (The best boundary competes too.) And bins are cheap, as each primitive touches two however many there
//! are, so large cells have more of them than small ones.

use super::Memoryless;
use crate::bins::{self, Bins, Grid};
use crate::cell::Cell;
use crate::plane::{BestPlane, CellCost, Plane, offer_empty_cuts};
use crate::promising::Promising;

/// Above so many primitives a bin, only every lth is looked at, l = log₁₀ N: what is counted is then an estimate, while
/// the side of each primitive is decided by the plane, exactly.
const SAMPLE_ABOVE: usize = 64;

/// At least so many primitives to a bin, in cells that have more than [`FEW_BINS`].
const PRIMS_PER_BIN: usize = 8;

/// Bins that are worth their while in any cell.
const FEW_BINS: usize = 32;

/// Of so many bins on all axes considered, one at most is looked into to adjust the plane, or one of all of them.
const BINS_PER_LOOK: usize = 48;

/// Binned planes.
#[derive(Debug)]
pub(crate) struct Binned {
    /// Most bins along an axis.
    pub(crate) bins: usize,
    /// What a plane in a bin must be able to cost, over the best boundary, for the bin to be looked into. Where geometry
    /// is spread evenly few can cost much less; where most of it lies in one bin, that is the only way on.
    pub(crate) adjust_below: f32,
}

impl Memoryless for Binned {
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, parallel: bool) -> Option<Plane> {
        let count = cell.prims.len();
        let (bins, step) = (self.bins_for(count), self.step(count));
        let grid = Grid::new(&cell.place.tight, bins);
        let chunks = bins::count(cell, cost.considered, &grid, step as usize, parallel);
        let mut best = BestPlane::new(cost);
        offer_empty_cuts(&mut best, &cell.place.tight, count);
        let mut promising = Promising::of(&Bins::sum(&chunks), step, &grid, cost);
        promising.offer_boundary_to(&mut best);
        let looks = (bins * cost.considered.len() / BINS_PER_LOOK).max(1);
        promising.limit(looks, self.adjust_below * best.least_cost());
        promising.offer_to(&mut best, cell, &chunks, parallel);
        best.found()
    }
}

impl Binned {
    fn bins_for(&self, count: usize) -> usize {
        let wanted = (count / PRIMS_PER_BIN).next_power_of_two();
        wanted.max(FEW_BINS).min(self.bins)
    }

    /// Each which primitive is looked at.
    fn step(&self, count: usize) -> u32 {
        if count > SAMPLE_ABOVE * self.bins {
            count.ilog10()
        } else {
            1
        }
    }
}
