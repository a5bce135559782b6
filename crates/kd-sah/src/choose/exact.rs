//! SAH without sorting everything: bins bound what any plane in them can cost, and only those that may hold the best
//! plane are looked into.
//!
//! Where few primitives are left, every candidate is counted ([`small`]). Above that, one pass counts starts and ends
//! in bins. A plane in a bin has at least the primitives of all bins before it below it, and at least those of all
//! bins behind it above it, and cuts off at least as much of the cell as the bin's own faces; so its cost is at least
//! that of such a plane, and at most that of one with all of the bin's primitives on both sides. Whatever cannot beat
//! the least of these upper bounds is left alone; the starts and ends in the other bins, commonly a tenth of all, are
//! collected, sorted and swept, most promising bin first, until no bin can hold anything better.
//!
//! The plane is the same as that of the other exact choosers, ties included, in linear time as long as the cost is
//! not almost the same everywhere. Nothing is kept from cell to cell, so memory is that of the primitives.

use std::cmp::Ordering;

use kd_core::Axis;

use super::Memoryless;
use crate::bins::{self, Bins, Grid, MOST_BINS};
use crate::cell::Cell;
use crate::events::{Event, sweep};
use crate::plane::{BestPlane, CellCost, Plane};
use crate::prim::Prim;
use crate::small::{self, SMALL};
use crate::tasks::{self, CHUNK};

/// The exact plane by bounds.
#[derive(Debug)]
pub(crate) struct Exact;

impl Memoryless for Exact {
    fn plane(&self, cell: &Cell, cost: &CellCost, parallel: bool) -> Option<Plane> {
        let count = cell.prims.len();
        if count <= SMALL {
            return small::best_plane(&cell.prims, cost);
        }
        let grid = Grid::new(&cell.tight, bins_for(count));
        let chunks = bins::count(cell, &grid, 1, parallel);
        let promising = Promising::of(&Bins::sum(&chunks), count, &grid, cost);
        promising.best_plane(cell, &chunks, cost, parallel)
    }
}

/// Enough that a bin holds about a dozen primitives.
fn bins_for(count: usize) -> usize {
    (count / 12).next_power_of_two().clamp(32, MOST_BINS)
}

/// A bin, and what bounds its planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) axis: Axis,
    pub(crate) bin: usize,
    /// No plane in the bin costs less.
    pub(crate) at_least: f32,
    /// Primitives that reach below all of the bin, and those that reach above where it starts.
    pub(crate) before: (usize, usize),
}

/// The bins that may hold the best plane, most promising first, and the grid they are of.
pub(crate) struct Promising<'a> {
    grid: &'a Grid,
    candidates: Vec<Candidate>,
}

/// No candidate.
const NONE: u16 = u16::MAX;

impl<'a> Promising<'a> {
    fn of(bins: &Bins, count: usize, grid: &'a Grid, cost: &CellCost) -> Self {
        let mut candidates = Vec::with_capacity(64);
        let mut at_most = f32::INFINITY;
        for axis in Axis::ALL {
            let along = &cost.axes[axis.index()];
            let (starts, ends) = (&bins.starts[axis.index()], &bins.ends[axis.index()]);
            let (mut lower, mut upper) = (0, count);
            for bin in 0..grid.bins() {
                let (starting, ending) = (starts[bin] as usize, ends[bin] as usize);
                if starting + ending > 0 {
                    let (first, last) = grid.fractions(along, axis, bin);
                    let at_least =
                        cost.of_parts(axis, (first, lower), (1.0 - last, upper - ending));
                    candidates.push(Candidate {
                        axis,
                        bin,
                        at_least,
                        before: (lower, upper),
                    });
                    // What starts or ends between the outer bins does so inside the cell, so there is a plane.
                    if 0 < bin && bin + 1 < grid.bins() {
                        let worst =
                            cost.of_parts(axis, (last, lower + starting), (1.0 - first, upper));
                        at_most = at_most.min(worst);
                    }
                }
                lower += starting;
                upper -= ending;
            }
        }
        candidates.retain(|candidate| candidate.at_least <= at_most);
        candidates.sort_unstable_by(|a, b| {
            let by_cost = a
                .at_least
                .partial_cmp(&b.at_least)
                .unwrap_or(Ordering::Equal);
            by_cost.then_with(|| (a.axis, a.bin).cmp(&(b.axis, b.bin)))
        });
        Self { grid, candidates }
    }

    /// The best plane at a start or end in any of the bins.
    fn best_plane(
        &self,
        cell: &Cell,
        chunks: &[Bins],
        cost: &CellCost,
        parallel: bool,
    ) -> Option<Plane> {
        let table = Table::of(&self.candidates);
        let chunks = cell.prims.chunks(CHUNK).zip(chunks).collect();
        let collected = tasks::map(chunks, parallel, |(prims, bins)| {
            Collected::of(prims, bins, self.grid, &self.candidates, &table)
        });
        let look_into = |best: &mut BestPlane<'_>, events: &mut Vec<Event>, number: usize| {
            events.clear();
            for part in &collected {
                events.extend_from_slice(part.of_candidate(number));
            }
            events.sort_unstable();
            let Candidate { axis, before, .. } = self.candidates[number];
            sweep(events, axis, before, 1, best);
        };
        let mut best = BestPlane::new(cost);
        let mut events = Vec::new();
        if !parallel || collected.len() == 1 {
            for (number, candidate) in self.candidates.iter().enumerate() {
                if candidate.at_least > best.least_cost() {
                    break;
                }
                look_into(&mut best, &mut events, number);
            }
            return best.found();
        }
        // The first tells which others can be left alone, and these are independent of each other.
        if !self.candidates.is_empty() {
            look_into(&mut best, &mut events, 0);
        }
        let first = best;
        let others = (1..self.candidates.len())
            .take_while(|&number| self.candidates[number].at_least <= first.least_cost());
        let found = tasks::map(others.collect(), parallel, |number| {
            let mut best = first;
            look_into(&mut best, &mut Vec::new(), number);
            best.found()
        });
        for plane in found.into_iter().flatten() {
            best.take(plane);
        }
        best.found()
    }
}

/// Which candidate a bin is, if it is one.
struct Table {
    numbers: [[u16; MOST_BINS]; 3],
    /// Whether there is any on an axis.
    has_any: [bool; 3],
}

impl Table {
    fn of(candidates: &[Candidate]) -> Self {
        let mut table = Self {
            numbers: [[NONE; MOST_BINS]; 3],
            has_any: [false; 3],
        };
        for (number, candidate) in (0_u16..).zip(candidates) {
            table.numbers[candidate.axis.index()][candidate.bin] = number;
            table.has_any[candidate.axis.index()] = true;
        }
        table
    }
}

/// Starts and ends of some primitives, those of each candidate together.
struct Collected {
    events: Vec<Event>,
    /// Where those of each candidate are.
    ranges: Vec<(usize, usize)>,
}

impl Collected {
    fn of(
        prims: &[Prim],
        bins: &Bins,
        grid: &Grid,
        candidates: &[Candidate],
        table: &Table,
    ) -> Self {
        let mut ranges = Vec::with_capacity(candidates.len());
        let mut total = 0;
        for candidate in candidates {
            ranges.push((total, total));
            let (axis, bin) = (candidate.axis.index(), candidate.bin);
            total += (bins.starts[axis][bin] + bins.ends[axis][bin]) as usize;
        }
        let mut events = vec![Event::NONE; total];
        let mut put = |number: u16, event: Event| {
            if number != NONE {
                let end = &mut ranges[usize::from(number)].1;
                events[*end] = event;
                *end += 1;
            }
        };
        for axis in Axis::ALL
            .into_iter()
            .filter(|axis| table.has_any[axis.index()])
        {
            let numbers = &table.numbers[axis.index()];
            for prim in prims {
                let (start, end) = (prim.start(axis), prim.end(axis));
                let first = numbers[usize::from(grid.bin(axis, start))];
                if start == end {
                    put(first, Event::planar(start));
                } else {
                    put(first, Event::start(start));
                    put(numbers[usize::from(grid.bin(axis, end))], Event::end(end));
                }
            }
        }
        Self { events, ranges }
    }

    fn of_candidate(&self, number: usize) -> &[Event] {
        let (start, end) = self.ranges[number];
        &self.events[start..end]
    }
}
