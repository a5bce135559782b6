//! SAH at the boundaries of bins (Shevtsov, Soupikov, Kapustin 2007, *Highly parallel fast KD-tree construction for
//! interactive ray tracing of dynamic scenes*; Eleftheriades 2010 §2.4.2.1).
//!
//! Two counters a bin and axis, one touched where a primitive starts and one where it ends. The least cost at a
//! boundary between bins names the plane, roughly; it is then adjusted to where geometry really ends: all starts and
//! ends in the two bins beside it are swept exactly. Planes that cut off empty space come from the box around the
//! primitives, which is known anyway. (Without them and without clipped boxes, binning gives trees of up to eight
//! times the cost.)

use kd_core::Axis;

use super::Memoryless;
use crate::bins::{self, Bins, Grid};
use crate::cell::Cell;
use crate::events::{Event, sweep};
use crate::plane::{BestPlane, CellCost, Plane, offer_empty_cuts};
use crate::tasks::{self, CHUNK};

/// Above so many primitives only every lth is looked at, l = log₁₀ N: what is counted is then an estimate, while the
/// side of each primitive is decided by the plane, exactly.
const SAMPLE_ABOVE: usize = 1 << 13;

/// Binned planes, with so many bins an axis.
#[derive(Debug)]
pub(crate) struct Binned {
    pub(crate) bins: usize,
}

impl Memoryless for Binned {
    fn plane(&self, cell: &Cell, cost: &CellCost, parallel: bool) -> Option<Plane> {
        let sample = Sample {
            cell,
            step: step(cell.prims.len()),
            parallel,
        };
        let grid = Grid::new(&cell.tight, self.bins);
        let bins = bins::count(cell, &grid, sample.step, parallel);
        let bins = Bins::sum(&bins);
        let mut best = BestPlane::new(cost);
        if let Some(boundary) = best_boundary(&bins, &grid, sample.step, cost) {
            sample.adjust(&boundary, &bins, &grid, &mut best);
        }
        offer_empty_cuts(&mut best, &cell.tight, cell.prims.len());
        best.found()
    }
}

/// Each which primitive is looked at.
fn step(count: usize) -> usize {
    if count > SAMPLE_ABOVE {
        count.ilog10() as usize
    } else {
        1
    }
}

/// The plane between two bins.
struct Boundary {
    axis: Axis,
    /// It is the lower face of this one.
    bin: usize,
}

/// The boundary of least cost among those with something on both sides; lower axis and bin among equals.
fn best_boundary(bins: &Bins, grid: &Grid, step: usize, cost: &CellCost) -> Option<Boundary> {
    let mut best = None;
    let mut least = f32::INFINITY;
    for axis in Axis::ALL {
        let along = &cost.axes[axis.index()];
        let (starts, ends) = (&bins.starts[axis.index()], &bins.ends[axis.index()]);
        let (mut lower, mut upper) = (0, bins.counted());
        for bin in 1..grid.bins() {
            lower += starts[bin - 1] as usize;
            upper -= ends[bin - 1] as usize;
            if lower == 0 || upper == 0 {
                continue;
            }
            let fraction = along.fraction(grid.boundary(axis, bin));
            let cost = cost.of_parts(
                axis,
                (fraction, step * lower),
                (1.0 - fraction, step * upper),
            );
            if cost < least {
                least = cost;
                best = Some(Boundary { axis, bin });
            }
        }
    }
    best
}

/// The primitives that are looked at.
struct Sample<'a> {
    cell: &'a Cell,
    step: usize,
    parallel: bool,
}

impl Sample<'_> {
    /// Offers every start and end in the bins beside the boundary. (The boundary itself is no better: between two of
    /// them the cost is linear, so it is least at one.)
    fn adjust(&self, boundary: &Boundary, bins: &Bins, grid: &Grid, best: &mut BestPlane<'_>) {
        let Boundary { axis, bin } = *boundary;
        let sum = |counts: &[u32]| counts.iter().map(|&count| count as usize).sum::<usize>();
        let before = |bin: usize| {
            let (starts, ends) = (&bins.starts[axis.index()], &bins.ends[axis.index()]);
            (sum(&starts[..bin]), bins.counted() - sum(&ends[..bin]))
        };
        let chunks = self.cell.prims.chunks(CHUNK).collect();
        let found = tasks::map(chunks, self.parallel, |chunk| {
            let mut events = Vec::new();
            for prim in chunk.iter().step_by(self.step) {
                let (start, end) = (prim.start(axis), prim.end(axis));
                let is_beside = |position| {
                    let at = usize::from(grid.bin(axis, position));
                    at == bin || at + 1 == bin
                };
                if start == end {
                    if is_beside(start) {
                        events.push(Event::planar(start));
                    }
                    continue;
                }
                if is_beside(start) {
                    events.push(Event::start(start));
                }
                if is_beside(end) {
                    events.push(Event::end(end));
                }
            }
            events
        });
        let mut events = found.concat();
        events.sort_unstable();
        sweep(&events, axis, before(bin - 1), self.step, best);
    }
}
