//! Promising bins: those that may hold the best plane, by a lower bound of the cost of all planes in a bin.
//!
//! A plane in a bin has at least the primitives of all bins before it below it, and at least those of all bins after it above
//! it. It leaves at least as much of the cell on each side as the faces of the bin do. So it costs at least as much as a plane
//! with these numbers. The boundaries between bins, whose costs are known, bound the cost of the best plane from above: the cost
//! is linear between two neighboring starts or ends, so that one of the two costs no more than any plane between them. Bins
//! whose lower bound exceeds that are skipped. The starts and ends in the other bins are collected, sorted and swept, most
//! promising bin first, until no remaining bin can hold a cheaper plane.

use kd_core::Axis;
use kd_simd::{LANES, Level, Task};
use smallvec::SmallVec;

use crate::CHUNK;
use crate::bins::{Bins, Edges, Grid};
use crate::cell::Cell;
use crate::collect::{Collected, Wanted};
use crate::events::sweep;
use crate::plane::{BestPlane, CellCost, Side};

/// A bin, with the bound of its planes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) axis: Axis,
    pub(crate) bin: usize,
    /// No plane in the bin costs less.
    pub(crate) at_least: f32,
    /// The number of primitives that start before the bin, and of those that do not end before it.
    pub(crate) before: (usize, usize),
}

/// The first and the last bin between the outer ones in which a primitive starts or ends; the first after the last if none
/// does.
fn occupied_between(bins: &Bins, axis: Axis) -> (usize, usize) {
    let (starts, ends) = bins.along(axis);
    let outer = starts.len() - 1;
    let is_occupied = |&bin: &usize| starts[bin] + ends[bin] > 0;
    let first = (1..outer).find(is_occupied).unwrap_or(outer);
    let last = (0..outer).rfind(is_occupied).unwrap_or(0);
    (first, last)
}

/// The bins that may hold the best plane, most promising first, and the grid they are of.
pub(crate) struct Promising<'a> {
    grid: &'a Grid,
    step: u32,
    candidates: SmallVec<[Candidate; 64]>,
    boundary: Option<Boundary>,
}

/// A boundary between bins, and the number of counted primitives on each side.
#[derive(Clone, Copy, Debug)]
struct Boundary {
    axis: Axis,
    bin: usize,
    counts: (usize, usize),
}

/// Eight neighboring bins.
pub(crate) struct Group {
    /// The first one.
    from: usize,
    /// For each bin: primitives that start before it, primitives that do not end before it, and those of the latter that do not
    /// end in it.
    lower: [u32; LANES],
    upper: [u32; LANES],
    beyond: [u32; LANES],
}

impl Group {
    /// `before` has the number of primitives that start before the first bin, and of those that do not end before it. It is
    /// advanced to the bin after the last.
    fn new(from: usize, before: &mut (u32, u32), starts: &[u32], ends: &[u32]) -> Self {
        let mut group = Self {
            from,
            lower: [0; LANES],
            upper: [0; LANES],
            beyond: [0; LANES],
        };
        let (lower, upper) = before;
        for (lane, (starts, ends)) in starts.iter().zip(ends).enumerate() {
            group.lower[lane] = *lower;
            group.upper[lane] = *upper;
            *lower += starts;
            *upper -= ends;
            group.beyond[lane] = *upper;
        }
        group
    }

    fn before(&self, lane: usize) -> (usize, usize) {
        (self.lower[lane] as usize, self.upper[lane] as usize)
    }

    /// The cost of a plane at the start of each bin, and the lower bound of the costs of all planes in the bin.
    fn costs(
        &self,
        cost: &CellCost,
        axis: Axis,
        edges: &Edges,
        step: u32,
    ) -> ([f32; LANES], [f32; LANES]) {
        Level::detect().run(Costs {
            group: self,
            cost,
            axis,
            edges,
            step,
        })
    }

    /// [`costs`](Self::costs) at the level that its caller is compiled for, whose vector instructions the loops become.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "at most MOST_BINS")]
    fn costs_here(
        &self,
        cost: &CellCost,
        axis: Axis,
        edges: &Edges,
        step: u32,
    ) -> ([f32; LANES], [f32; LANES]) {
        let lower = self.lower.map(|count| step * count);
        let upper = self.upper.map(|count| step * count);
        let beyond = self.beyond.map(|count| step * count);
        let first = self.from as u32;
        let (mut near_lower, mut near_upper) = ([0.0; LANES], [0.0; LANES]);
        let (mut around_lower, mut around_upper) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let bin = first + lane as u32;
            let (from, to) = edges.near(bin);
            (near_lower[lane], near_upper[lane]) = (to, 1.0 - from);
            let (from, to) = edges.around(bin);
            (around_lower[lane], around_upper[lane]) = (from, 1.0 - to);
        }
        let at_boundary = cost.of_lanes(axis, (&near_lower, &lower), (&near_upper, &upper));
        let at_least = cost.of_lanes(axis, (&around_lower, &lower), (&around_upper, &beyond));
        (at_boundary, at_least)
    }
}

/// [`Group::costs`] at some level.
struct Costs<'a> {
    group: &'a Group,
    cost: &'a CellCost,
    axis: Axis,
    edges: &'a Edges,
    step: u32,
}

impl<S> Task<S> for Costs<'_> {
    type Output = ([f32; LANES], [f32; LANES]);

    #[inline(always)]
    fn run(self, _: S) -> Self::Output {
        self.group
            .costs_here(self.cost, self.axis, self.edges, self.step)
    }
}

/// Costs are linear up to rounding.
const ROUNDING: f32 = 1.0 + 1.0 / (1 << 18) as f32;

impl<'a> Promising<'a> {
    /// `bins` hold every `step`th primitive.
    pub(crate) fn of(bins: &Bins, step: u32, grid: &'a Grid, cost: &CellCost) -> Self {
        let mut candidates = SmallVec::<[Candidate; 64]>::new();
        let mut at_most = f32::INFINITY;
        let mut boundary = None;
        for &axis in cost.considered {
            let edges = grid.edges(&cost.axes[axis.index()], axis);
            let (first, last) = occupied_between(bins, axis);
            let (starts, ends) = bins.along(axis);
            let mut before = (0, starts.iter().sum());
            for (number, (starts, ends)) in starts.chunks(LANES).zip(ends.chunks(LANES)).enumerate()
            {
                let from = LANES * number;
                let group = Group::new(from, &mut before, starts, ends);
                let (at_boundary, at_least) = group.costs(cost, axis, &edges, step);
                for (lane, (bin, &cost)) in (from..).zip(&at_boundary[..starts.len()]).enumerate() {
                    if cost < at_most && first < bin && bin <= last {
                        at_most = cost;
                        let counts = group.before(lane);
                        boundary = Some(Boundary { axis, bin, counts });
                    }
                }
                for (lane, (starts, ends)) in starts.iter().zip(ends).enumerate() {
                    let at_least = at_least[lane];
                    if at_least <= at_most * ROUNDING && starts + ends > 0 {
                        candidates.push(Candidate {
                            axis,
                            bin: from + lane,
                            at_least,
                            before: group.before(lane),
                        });
                    }
                }
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
            let step = self.step as usize;
            let counts = (step * counts.0, step * counts.1);
            best.offer_side(axis, self.grid.boundary(axis, bin), counts, Side::Lower);
        }
    }

    /// Keeps the first `most` candidates, and of them those that may cost at most `below`.
    pub(crate) fn limit(&mut self, most: usize, below: f32) {
        self.candidates.truncate(most);
        self.candidates
            .retain(|candidate| candidate.at_least <= below);
    }

    /// Offers the starts and ends in all candidate bins that may hold a better plane. `chunks` are the counts of the cell's
    /// chunks.
    pub(crate) fn offer_to(
        &self,
        best: &mut BestPlane<'_>,
        cell: Cell<'_>,
        chunks: &[Bins],
        parallel: bool,
    ) {
        if self.candidates.is_empty() {
            return;
        }
        let bins = self.candidates.iter().map(|c| (c.axis, c.bin));
        let wanted = Wanted::new(bins.clone());
        let chunks = cell.prims.chunks(CHUNK).zip(chunks).collect();
        let collected = kd_tasks::map(chunks, parallel, |(prims, counted): (_, &Bins)| {
            let counts = bins.clone().map(|(axis, bin)| {
                let (starts, ends) = counted.at(axis, bin);
                starts + ends
            });
            Collected::of(prims, self.step as usize, self.grid, &wanted, counts)
        });
        // Bins that several threads sweep at once do not share their best plane.
        let stride = if parallel && collected.len() > 1 {
            self.candidates.len()
        } else {
            1
        };
        let known = *best;
        let found = kd_tasks::map((0..stride).collect(), parallel, |first| {
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
                    self.step as usize,
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

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::{Aabb, CostModel};
    use proptest::prelude::*;

    use super::*;
    use crate::plane::LeafCost;

    proptest! {
        /// The detected level equals the portable one, and both equal one plane at a time.
        #[test]
        fn all_levels_cost_the_same(
            starts in prop::collection::vec(0_u32..50, 1..=LANES),
            ends in prop::collection::vec(0_u32..50, LANES),
            step in 1_u32..5,
            lanes in 1_u32..10,
            axis in 0_usize..3,
        ) {
            let cell = Aabb { min: Vec3::new(-1.0, 2.0, 0.0), max: Vec3::new(3.0, 2.5, 7.0) };
            let cost = CellCost::new(LeafCost::new(&CostModel { lanes, ..CostModel::PACKED }), &cell);
            let axis = Axis::ALL[axis];
            let grid = Grid::new(&cell, 16);
            let edges = grid.edges(&cost.axes[axis.index()], axis);
            let mut before = (3, 400);
            let group = Group::new(8, &mut before, &starts, &ends);
            let here = group.costs_here(&cost, axis, &edges, step);
            prop_assert_eq!(group.costs(&cost, axis, &edges, step), here);
            for (lane, bin) in (8..).take(starts.len()).enumerate() {
                let (from, to) = edges.near(bin);
                let (lower, upper) = (step * group.lower[lane], step * group.upper[lane]);
                let boundary = cost.of_parts(axis, (to, lower), (1.0 - from, upper));
                prop_assert_eq!(here.0[lane], boundary);
                let (from, to) = edges.around(bin);
                let beyond = upper - step * ends[lane];
                prop_assert_eq!(here.1[lane], cost.of_parts(axis, (from, lower), (1.0 - to, beyond)));
            }
        }
    }
}
