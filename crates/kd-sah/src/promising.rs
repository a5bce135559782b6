//! Bins that may hold the best plane: each has a bound of what any plane in it can cost.
//!
//! A plane in a bin has at least the primitives of all bins before it below it, at least those of all bins behind it
//! above it, and cuts off at least as much of the cell as the bin's own faces, so it costs at least as much as such a
//! plane would. On the other hand, between two neighbouring starts or ends the cost is linear, so that one of them
//! costs no more than a plane anywhere between: the boundaries of bins, whose cost is known, tell what the best plane
//! costs at most. Whatever cannot beat that is left alone; the starts and ends in the other bins are collected, sorted and swept, most promising bin first, until no bin can hold anything better.

use kd_core::Axis;
use smallvec::SmallVec;

use crate::bins::{Bins, Grid};
use crate::cell::Cell;
use crate::collect::{Collected, Wanted};
use crate::events::sweep;
use crate::plane::{BestPlane, CellCost, Side};
use crate::tasks::{self, CHUNK};

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

/// The first and the last bin, of those between the outer ones, where anything starts or ends; the first behind the
/// last if there is none.
fn occupied_between(bins: &Bins, axis: Axis) -> (usize, usize) {
    let is_occupied = |(starts, ends): (usize, usize)| starts + ends > 0;
    let last = bins.along(axis).len() - 1;
    let mut inner = bins.along(axis).take(last).skip(1);
    let first = inner.position(is_occupied).map_or(last, |at| at + 1);
    let last = bins.along(axis).take(last).rposition(is_occupied);
    (first, last.unwrap_or(0))
}

/// The bins that may hold the best plane, most promising first, and the grid they are of.
pub(crate) struct Promising<'a> {
    grid: &'a Grid,
    step: usize,
    candidates: SmallVec<[Candidate; 64]>,
    boundary: Option<Boundary>,
}

/// A boundary between bins, and how many of the counted primitives reach below and above it.
#[derive(Clone, Copy, Debug)]
struct Boundary {
    axis: Axis,
    bin: usize,
    counts: (usize, usize),
}

/// What is computed of a cost that is linear is so up to rounding.
const ROUNDING: f32 = 1.0 + 1.0 / (1 << 18) as f32;

impl<'a> Promising<'a> {
    /// `bins` hold every `step`th primitive.
    pub(crate) fn of(bins: &Bins, step: usize, grid: &'a Grid, cost: &CellCost) -> Self {
        let of_parts = |axis, below: (f32, usize), above: (f32, usize)| {
            cost.of_parts(axis, (below.0, step * below.1), (above.0, step * above.1))
        };
        let mut candidates = SmallVec::<[Candidate; 64]>::new();
        let mut at_most = f32::INFINITY;
        let mut boundary = None;
        for &axis in cost.considered {
            let edges = grid.edges(&cost.axes[axis.index()], axis);
            let (first, last) = occupied_between(bins, axis);
            let (mut lower, mut upper) = (0, bins.counted(axis));
            for (bin, (starting, ending)) in bins.along(axis).enumerate() {
                if first < bin && bin <= last {
                    let (from, to) = edges.near(bin);
                    let cost = of_parts(axis, (to, lower), (1.0 - from, upper));
                    if cost < at_most {
                        at_most = cost;
                        let counts = (lower, upper);
                        boundary = Some(Boundary { axis, bin, counts });
                    }
                }
                if starting + ending > 0 {
                    let (from, to) = edges.around(bin);
                    let at_least = of_parts(axis, (from, lower), (1.0 - to, upper - ending));
                    if at_least <= at_most * ROUNDING {
                        candidates.push(Candidate {
                            axis,
                            bin,
                            at_least,
                            before: (lower, upper),
                        });
                    }
                }
                lower += starting;
                upper -= ending;
            }
        }
        candidates.retain(|candidate| candidate.at_least <= at_most * ROUNDING);
        candidates.sort_unstable_by(|a, b| {
            let by_cost = a.at_least.total_cmp(&b.at_least);
            by_cost.then_with(|| (a.axis, a.bin).cmp(&(b.axis, b.bin)))
        });
        Self {
            grid,
            step,
            candidates,
            boundary,
        }
    }

    /// Offers the best boundary between bins.
    pub(crate) fn offer_boundary_to(&self, best: &mut BestPlane<'_>) {
        if let Some(Boundary { axis, bin, counts }) = self.boundary {
            let counts = (self.step * counts.0, self.step * counts.1);
            best.offer_side(axis, self.grid.boundary(axis, bin), counts, Side::Lower);
        }
    }

    /// Forgets all but the first few.
    pub(crate) fn limit(&mut self, most: usize) {
        self.candidates.truncate(most);
    }

    /// Offers the starts and ends in all of the bins, but for what cannot be best. `chunks` are the counts of the
    /// cell's chunks.
    pub(crate) fn offer_to(
        &self,
        best: &mut BestPlane<'_>,
        cell: Cell<'_>,
        chunks: &[Bins],
        parallel: bool,
    ) {
        let bins = self.candidates.iter().map(|c| (c.axis, c.bin));
        let wanted = Wanted::new(bins.clone());
        let chunks = cell.prims.chunks(CHUNK).zip(chunks).collect();
        let collected = tasks::map(chunks, parallel, |(prims, counted): (_, &Bins)| {
            let counts = bins.clone().map(|(axis, bin)| {
                let (starts, ends) = counted.at(axis, bin);
                starts + ends
            });
            Collected::of(prims, self.step, self.grid, &wanted, counts)
        });
        // Those that several threads look into at once do not know of each other.
        let stride = if parallel && collected.len() > 1 {
            self.candidates.len()
        } else {
            1
        };
        let known = *best;
        let found = tasks::map((0..stride).collect(), parallel, |first| {
            let mut best = known;
            let mut events = Vec::new();
            for number in (first..self.candidates.len()).step_by(stride) {
                let candidate = &self.candidates[number];
                if candidate.at_least > best.least_cost() {
                    break;
                }
                events.clear();
                for part in &collected {
                    events.extend_from_slice(part.in_bin(number));
                }
                events.sort_unstable();
                sweep(
                    &events,
                    candidate.axis,
                    candidate.before,
                    self.step,
                    &mut best,
                );
            }
            best.found()
        });
        for plane in found.into_iter().flatten() {
            best.take(plane);
        }
    }
}
