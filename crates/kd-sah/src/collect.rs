//! Collects the starts and ends in wanted bins, bin by bin.
//!
//! Most positions lie in no wanted bin, so eight at a time are first compared with the outermost wanted bins. The search is
//! compiled for each [`Level`].

use std::ops::Range;

use kd_core::Axis;
use kd_simd::{LANES, Level, Mask, Number, Simd, Task};
use smallvec::SmallVec;

use crate::bins::{AxisGrid, Grid, MOST_BINS};
use crate::bits::numbers;
use crate::events::Event;
use crate::prim::Prim;

/// Wanted bins, each with a number.
pub(crate) struct Wanted {
    axes: [WantedAxis; 3],
    count: usize,
}

/// The wanted bins along one axis.
#[derive(Clone, Copy)]
struct WantedAxis {
    /// The number of each bin. All unwanted bins share the number after the last one.
    numbers: [u16; MOST_BINS],
    /// The outermost wanted bins; the first after the last if none is wanted.
    first: u8,
    last: u8,
}

impl Wanted {
    /// Numbers the bins in their order.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "at most MOST_BINS along three axes, each below MOST_BINS"
    )]
    pub(crate) fn new(bins: impl ExactSizeIterator<Item = (Axis, usize)>) -> Self {
        let count = bins.len();
        let none = WantedAxis {
            numbers: [count as u16; MOST_BINS],
            first: u8::MAX,
            last: 0,
        };
        let mut axes = [none; 3];
        for (number, (axis, bin)) in (0_u16..).zip(bins) {
            let axis = &mut axes[axis.index()];
            axis.numbers[bin] = number;
            axis.first = axis.first.min(bin as u8);
            axis.last = axis.last.max(bin as u8);
        }
        Self { axes, count }
    }
}

/// Starts and ends of some primitives.
#[derive(Debug)]
pub(crate) struct Collected {
    events: Vec<Event>,
    /// The events of each bin.
    ranges: SmallVec<[Range<usize>; 64]>,
}

impl Collected {
    /// `counts` has the number of starts and ends in each wanted bin, both ends of planar primitives included.
    pub(crate) fn of(
        prims: &[Prim],
        step: usize,
        grid: &Grid,
        wanted: &Wanted,
        counts: impl Iterator<Item = usize>,
    ) -> Self {
        let mut ranges = SmallVec::with_capacity(wanted.count + 1);
        let mut total = 0;
        // Unwanted events share a place at the end.
        for count in counts.chain([1]) {
            ranges.push(total..total);
            total += count;
        }
        let mut collected = Self {
            events: vec![Event::NONE; total],
            ranges,
        };
        let mut places = Places {
            events: &mut collected.events,
            ranges: &mut collected.ranges,
        };
        for axis in Axis::ALL {
            let along = &wanted.axes[axis.index()];
            if along.first <= along.last {
                let grid = grid.along(axis);
                let search = Search {
                    axis,
                    grid: &grid,
                    along,
                    unwanted: wanted.count,
                };
                search.collect(prims, step, &mut places);
            }
        }
        collected
    }

    /// Those in one of the wanted bins.
    pub(crate) fn in_bin(&self, number: usize) -> &[Event] {
        &self.events[self.ranges[number].clone()]
    }
}

/// Where the next event of each bin is stored: at the end of its range.
pub(crate) struct Places<'a> {
    events: &'a mut [Event],
    ranges: &'a mut [Range<usize>],
}

/// A search along one axis.
pub(crate) struct Search<'a> {
    axis: Axis,
    grid: &'a AxisGrid,
    along: &'a WantedAxis,
    unwanted: usize,
}

/// A search at some level, of each `step`th primitive.
struct Collect<'a, 'p, 'e> {
    search: &'a Search<'a>,
    prims: &'a [Prim],
    step: usize,
    into: &'p mut Places<'e>,
}

impl<S: Simd> Task<S> for Collect<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        self.search
            .collect_by(simd, self.prims, self.step, self.into);
    }
}

/// A bit for each position between two bins, given by their [`AxisGrid::as_rounded`].
struct Between<'a> {
    grid: &'a AxisGrid,
    bins: (f32, f32),
    positions: [f32; LANES],
}

impl<S: Simd> Task<S> for Between<'_> {
    type Output = u64;

    #[inline(always)]
    fn run(self, simd: S) -> u64 {
        let (first, last) = self.bins;
        let at = self.grid.rounded_lanes(simd, simd.values(self.positions));
        let is_between = simd.splat(first).le(at) & at.le(simd.splat(last));
        u64::from(is_between.bits())
    }
}

impl Search<'_> {
    fn collect(&self, prims: &[Prim], step: usize, into: &mut Places<'_>) {
        Level::detect().run(Collect {
            search: self,
            prims,
            step,
            into,
        });
    }

    #[inline(always)]
    fn collect_by<S: Simd>(&self, simd: S, prims: &[Prim], step: usize, into: &mut Places<'_>) {
        let bins = (
            AxisGrid::as_rounded(self.along.first),
            AxisGrid::as_rounded(self.along.last),
        );
        let between = |positions| Between {
            grid: self.grid,
            bins,
            positions,
        };
        let axis = self.axis;
        let groups = prims.chunks_exact(step * LANES);
        for prim in groups.remainder().iter().step_by(step) {
            self.put_start(prim, into);
            self.put_end(prim, into);
        }
        for group in groups {
            // Values in registers: a load of a list that was just written would wait for the writes.
            let starts = std::array::from_fn(|lane| group[lane * step].start(axis));
            let ends = std::array::from_fn(|lane| group[lane * step].end(axis));
            for lane in numbers::<LANES>(simd.run(between(starts))) {
                self.put_start(&group[lane * step], into);
            }
            for lane in numbers::<LANES>(simd.run(between(ends))) {
                self.put_end(&group[lane * step], into);
            }
        }
    }

    #[inline(always)]
    fn put_start(&self, prim: &Prim, into: &mut Places<'_>) {
        let (start, end) = (prim.start(self.axis), prim.end(self.axis));
        let event = if start == end {
            Event::planar(start)
        } else {
            Event::start(start)
        };
        self.put(start, event, into);
    }

    /// Planar primitives have one event, at their start.
    #[inline(always)]
    fn put_end(&self, prim: &Prim, into: &mut Places<'_>) {
        let (start, end) = (prim.start(self.axis), prim.end(self.axis));
        if start != end {
            self.put(end, Event::end(end), into);
        }
    }

    /// Stores an event, without a branch on whether its bin is wanted.
    #[inline(always)]
    fn put(&self, position: f32, event: Event, into: &mut Places<'_>) {
        let bin = self.grid.bin(position);
        let number = usize::from(self.along.numbers[usize::from(bin)]);
        let range = &mut into.ranges[number];
        into.events[range.end] = event;
        range.end += usize::from(number != self.unwanted);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::bins::{self, Bins};
    use crate::cell::{Cell, Place};
    use crate::prim::samples::boxes;

    proptest! {
        /// The detected and the portable level equal asking for the bin of each position.
        #[test]
        fn all_levels_collect_the_same(
            boxes_at in prop::collection::vec(([-20_i8..20, -20_i8..20, -20_i8..20], [0_i8..8, 0_i8..8, 0_i8..8]), 1..90),
            step in 1_usize..4,
            first in 0_usize..16,
            second in 0_usize..16,
        ) {
            let (prims, bounds) = boxes(&boxes_at);
            let place = Place { bounds, tight: bounds, depth: 0 };
            let cell = Cell { place: &place, prims: &prims };
            let grid = Grid::new(&bounds, 16);
            let bins = Bins::sum(&bins::count(cell, &Axis::ALL, &grid, step, false)).into_owned();
            let asked = [(Axis::X, first), (Axis::X, second), (Axis::Z, second)];
            let asked = if first == second { &asked[1..] } else { &asked };
            let wanted = Wanted::new(asked.iter().copied());
            let counts = asked.iter().map(|&(axis, bin)| {
                let (starts, ends) = bins.at(axis, bin);
                starts + ends
            });
            let collected = Collected::of(&prims, step, &grid, &wanted, counts);
            for (number, &(axis, bin)) in asked.iter().enumerate() {
                let grid = grid.along(axis);
                let mut expected = Vec::new();
                for prim in prims.iter().step_by(step) {
                    let mut all = Vec::new();
                    crate::events::push_events(&mut all, axis, 0, prim);
                    expected.extend(all.into_iter().filter(|event| usize::from(grid.bin(event.position())) == bin));
                }
                let mut found = collected.in_bin(number).to_vec();
                found.sort_unstable();
                expected.sort_unstable();
                prop_assert_eq!(found, expected, "bin {} of {:?}", bin, axis);
            }
            let positions: [f32; LANES] = std::array::from_fn(|lane| prims[lane % prims.len()].start(Axis::Y));
            let (grid, range) = (grid.along(Axis::Y), (first.min(second), first.max(second)));
            let range = (AxisGrid::as_rounded(range.0.try_into().expect("small")), AxisGrid::as_rounded(range.1.try_into().expect("small")));
            let look = || Between { grid: &grid, bins: range, positions };
            let portable = Level::portable().run(look());
            prop_assert_eq!(Level::detect().run(look()), portable);
            let expected = positions.map(|position| (range.0..=range.1).contains(&grid.rounded(position)));
            prop_assert_eq!(expected, std::array::from_fn(|lane| portable >> lane & 1 != 0));
            prop_assert!(portable < 256);
        }
    }
}
