//! SAH by bins (Shevtsov, Soupikov, Kapustin 2007, *Highly parallel fast KD-tree construction for interactive ray
//! tracing of dynamic scenes*; Eleftheriades 2010 §2.4.2.1).
//!
//! Each bin of an axis has two counters: one for starts of primitives and one for ends. A pass over the bins selects the
//! most promising few. An exact sweep over the events in these bins then adjusts the plane to the ends of primitives.
//! Planes that cut off empty space come from the box around the primitives, which is known already. (Without them and
//! without clipped boxes, binning gives bad trees.)
//!
//! Differences from the paper: in models of buildings many primitives start and end in one plane, so that the cost has a
//! minimum between two boundaries of high cost. A bin is therefore ranked by the best plane that it could contain
//! ([`promising`](crate::promising)), not by its boundaries. (The best boundary competes too.) Large cells have more bins
//! than small ones, since the cost of counting does not depend on the number of bins: each primitive updates two.

use super::Memoryless;
use crate::bins::{self, Bins, Grid};
use crate::cell::Cell;
use crate::plane::{BestPlane, CellCost, Plane, offer_empty_cuts};
use crate::promising::Promising;

/// With more primitives per bin than this, only every lth primitive is counted, l = log₁₀ N. Counts are then estimates, but
/// the division of the cell compares every primitive with the plane.
const SAMPLE_ABOVE: usize = 64;

/// The least number of primitives per bin, in cells with more than [`MIN_BINS`] bins.
const PRIMS_PER_BIN: usize = 8;

/// The number of bins that pays in any cell.
const MIN_BINS: usize = 32;

/// At most one of this many bins, over all considered axes, is swept to adjust the plane; at least one bin is.
const BINS_PER_SWEEP: usize = 48;

/// The binned chooser.
#[derive(Debug)]
pub(crate) struct Binned {
    /// The greatest number of bins along an axis.
    pub(crate) bins: usize,
    /// A bin is swept only if its lower bound of cost is below this multiple of the cost of the best boundary. Where
    /// geometry is evenly distributed, few planes are much cheaper than the best boundary. Where most geometry is in one
    /// bin, sweeping that bin is the only way to divide it.
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
        let swept = (bins * cost.considered.len() / BINS_PER_SWEEP).max(1);
        promising.limit(swept, self.adjust_below * best.least_cost());
        promising.offer_to(&mut best, cell, &chunks, parallel);
        best.found()
    }
}

impl Binned {
    fn bins_for(&self, count: usize) -> usize {
        let wanted = (count / PRIMS_PER_BIN).next_power_of_two();
        wanted.max(MIN_BINS).min(self.bins)
    }

    /// The distance between counted primitives: every `step`th primitive is counted.
    fn step(&self, count: usize) -> u32 {
        if count > SAMPLE_ABOVE * self.bins {
            count.ilog10()
        } else {
            1
        }
    }
}
