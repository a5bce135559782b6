//! Counts of primitives that start and end in each of a few bins of equal width, on all axes (Shevtsov et al. 2007).

use std::borrow::Cow;

use glam::Vec4;
use kd_core::{Aabb, Axis};
use kd_simd::{F32x8, LANES, Level, Simd, Task};

use crate::CHUNK;
use crate::cell::Cell;
use crate::plane::AxisCost;
use crate::prim::Prim;

/// The largest number of bins along an axis. A bin fits a byte, which indexes a table of this length without a check.
pub(crate) const MOST_BINS: usize = 256;

/// Divides a box into bins of equal width along each axis, and finds the bin of a position.
///
/// Bins never decrease along the axis, rounding included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    bins: usize,
    origin: Vec4,
    /// Bins per unit of length; 0 along an axis that cannot be divided.
    scale: Vec4,
    /// The last bin.
    last: f32,
}

impl Grid {
    /// `bins` is at most [`MOST_BINS`].
    pub(crate) fn new(bounds: &Aabb, bins: usize) -> Self {
        let scale = (bins as f32) / bounds.extent();
        let usable = |x: f32| if x.is_finite() { x } else { 0.0 };
        let scale = glam::Vec3::from_array(scale.to_array().map(usable));
        Self {
            bins,
            origin: bounds.min.extend(0.0),
            scale: scale.extend(0.0),
            last: bins as f32 - 1.0,
        }
    }

    /// A plane where a bin starts, up to rounding, along an axis that can be divided.
    pub(crate) fn boundary(&self, axis: Axis, bin: usize) -> f32 {
        self.origin[axis.index()] + bin as f32 / self.scale[axis.index()]
    }

    /// The grid along one axis.
    pub(crate) fn along(&self, axis: Axis) -> AxisGrid {
        AxisGrid {
            origin: self.origin[axis.index()],
            scale: self.scale[axis.index()],
            last: self.last,
        }
    }

    /// Where the bins of an axis start and end, as fractions of a cell that holds the box.
    pub(crate) fn edges(&self, along: &AxisCost, axis: Axis) -> Edges {
        let scale = self.scale[axis.index()];
        if scale == 0.0 {
            return Edges {
                first: 0.0,
                step: 1.0,
            };
        }
        Edges {
            first: along.fraction(self.origin[axis.index()]),
            step: along.scale / scale,
        }
    }
}

/// A [`Grid`] along one axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisGrid {
    pub(crate) origin: f32,
    pub(crate) scale: f32,
    pub(crate) last: f32,
}

impl AxisGrid {
    /// 2²³: adding it rounds to an integer, in the lowest bits.
    pub(crate) const INTEGERS: f32 = (1 << 23) as f32;

    /// The bin of a position in the box.
    #[inline]
    pub(crate) fn bin(&self, position: f32) -> u8 {
        low_byte(self.rounded(position))
    }

    /// The number of the bin, with [`INTEGERS`](Self::INTEGERS) added.
    #[inline]
    pub(crate) fn rounded(&self, position: f32) -> f32 {
        let at = (position - self.origin) * self.scale - 0.5;
        let at = if at > 0.0 { at } else { 0.0 };
        let at = if at < self.last { at } else { self.last };
        at + Self::INTEGERS
    }

    /// [`rounded`](Self::rounded) of eight positions.
    #[inline(always)]
    pub(crate) fn rounded_lanes<S: Simd>(&self, simd: S, positions: S::F32) -> S::F32 {
        let grids = Lanes {
            origin: simd.splat(self.origin),
            scale: simd.splat(self.scale),
            last: simd.splat(self.last),
        };
        grids.rounded(simd, positions)
    }

    /// What [`rounded`](Self::rounded) gives for positions in a bin.
    pub(crate) fn as_rounded(bin: u8) -> f32 {
        f32::from(bin) + Self::INTEGERS
    }
}

/// Four times the largest error of a face, as a fraction of a cell.
const MARGIN: f32 = 1.0 / (1 << 20) as f32;

/// Faces of bins along an axis, as fractions of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Edges {
    first: f32,
    step: f32,
}

impl Edges {
    /// The lower face of a bin, up to rounding.
    #[inline]
    fn at(&self, bin: u32) -> f32 {
        // Signed, which is one instruction.
        self.first + bin.cast_signed() as f32 * self.step
    }

    /// An interval that contains all positions of the bin: faces err by a few units in the last place of the box, 2⁻²² of it,
    /// and fractions by no more.
    #[inline]
    pub(crate) fn around(&self, bin: u32) -> (f32, f32) {
        let (start, end) = (self.at(bin) - MARGIN, self.at(bin + 1) + MARGIN);
        let start = if start > 0.0 { start } else { 0.0 };
        let end = if end < 1.0 { end } else { 1.0 };
        (start, end)
    }

    /// An interval that contains the exact lower face of a bin.
    #[inline]
    pub(crate) fn near(&self, bin: u32) -> (f32, f32) {
        let face = self.at(bin);
        (face - MARGIN, face + MARGIN)
    }
}

#[inline]
#[allow(clippy::cast_possible_truncation, reason = "the lowest byte")]
fn low_byte(x: f32) -> u8 {
    x.to_bits() as u8
}

/// The size of a small table, which most cells need: less memory to clear.
const FEW_BINS: usize = 32;

/// The number of primitives that start, and that end, in each bin of each counted axis.
#[derive(Clone)]
pub(crate) struct Bins {
    bins: usize,
    /// The axes that were counted, in order.
    axes: &'static [Axis],
    /// For each axis a table of starts and one of ends, of [`FEW_BINS`] or [`MOST_BINS`] entries.
    counts: Vec<u32>,
}

impl Bins {
    /// Counts each `step`th primitive.
    fn of(prims: &[Prim], axes: &'static [Axis], grid: &Grid, step: usize) -> Self {
        let room = if grid.bins <= FEW_BINS {
            FEW_BINS
        } else {
            MOST_BINS
        };
        let mut bins = Self {
            bins: grid.bins,
            axes,
            counts: vec![0; 2 * axes.len() * room],
        };
        let counting = Counting {
            prims,
            step,
            axes,
            grid,
        };
        if room == FEW_BINS {
            counting.count::<FEW_BINS>(&mut bins.counts);
        } else {
            counting.count::<MOST_BINS>(&mut bins.counts);
        }
        bins
    }

    /// The sum of all chunks (Push).
    pub(crate) fn sum(chunks: &[Self]) -> Cow<'_, Self> {
        let (first, others) = chunks.split_first().expect("a cell is not empty");
        let mut sum = Cow::Borrowed(first);
        for other in others {
            for (own, other) in sum.to_mut().counts.iter_mut().zip(&other.counts) {
                *own += other;
            }
        }
        sum
    }

    /// The number of primitives that start in a bin, and of those that end there.
    #[inline]
    pub(crate) fn at(&self, axis: Axis, bin: usize) -> (usize, usize) {
        let (starts, ends) = self.along(axis);
        (starts[bin] as usize, ends[bin] as usize)
    }

    /// The number of primitives that start, and that end, in each bin of a counted axis.
    #[inline]
    pub(crate) fn along(&self, axis: Axis) -> (&[u32], &[u32]) {
        let axis = if self.axes.len() == 1 {
            0
        } else {
            axis.index()
        };
        let room = self.counts.len() / (2 * self.axes.len());
        let (starts, ends) = self.counts[2 * axis * room..][..2 * room].split_at(room);
        (&starts[..self.bins], &ends[..self.bins])
    }
}

/// Counts every `step`th primitive of a cell, in chunks, so that several threads can count (`PreScan` of Choi et al. 2010).
/// `axes` is one axis, or all in order.
pub(crate) fn count(
    cell: Cell<'_>,
    axes: &'static [Axis],
    grid: &Grid,
    step: usize,
    parallel: bool,
) -> Vec<Bins> {
    let chunks = cell.prims.chunks(CHUNK).collect();
    kd_tasks::map(chunks, parallel, |chunk: &[Prim]| {
        Bins::of(chunk, axes, grid, step)
    })
}

/// The primitives to count.
pub(crate) struct Counting<'a> {
    prims: &'a [Prim],
    step: usize,
    axes: &'static [Axis],
    grid: &'a Grid,
}

/// A grid for each of eight positions, of equally many bins.
#[derive(Clone, Copy, Debug)]
struct EightGrids {
    origin: [f32; LANES],
    scale: [f32; LANES],
    last: f32,
}

/// The bin of each position in its grid, as [`AxisGrid::bin`] finds it.
struct FindBins<'a> {
    grids: &'a EightGrids,
    positions: &'a [f32; LANES],
}

impl<S: Simd> Task<S> for FindBins<'_> {
    type Output = [u8; LANES];

    #[inline(always)]
    fn run(self, simd: S) -> [u8; LANES] {
        let grids = Lanes {
            origin: simd.load(&self.grids.origin),
            scale: simd.load(&self.grids.scale),
            last: simd.splat(self.grids.last),
        };
        grids.rounded(simd, simd.load(self.positions)).low_bytes()
    }
}

/// A grid along an axis in each lane.
struct Lanes<F> {
    origin: F,
    scale: F,
    last: F,
}

impl<F: F32x8> Lanes<F> {
    /// [`AxisGrid::rounded`] of each position, by the same operations in the same order.
    #[inline(always)]
    fn rounded<S: Simd<F32 = F>>(&self, simd: S, positions: F) -> F {
        let at = (positions - self.origin) * self.scale - simd.splat(0.5);
        let at = at.max(simd.splat(0.0)).min(self.last);
        at + simd.splat(AxisGrid::INTEGERS)
    }
}

impl Counting<'_> {
    /// Counts in tables of `ROOM` bins.
    fn count<const ROOM: usize>(&self, counts: &mut [u32]) {
        Level::detect().run(Count::<ROOM> {
            counting: self,
            counts,
        });
    }

    #[inline(always)]
    fn count_by<const ROOM: usize, S: Simd>(&self, simd: S, counts: &mut [u32]) {
        match (self.axes, counts.as_chunks_mut::<ROOM>().0) {
            (&[axis], [starts, ends]) => self.count_axis(simd, axis, [starts, ends]),
            (_, [a, b, c, d, e, f]) => self.count_all(simd, [a, b, c, d, e, f]),
            _ => unreachable!("one axis or all of them"),
        }
    }

    /// Along one axis, both ends of four primitives at a time.
    #[inline(always)]
    fn count_axis<const ROOM: usize, S: Simd>(
        &self,
        simd: S,
        axis: Axis,
        [starts, ends]: [&mut [u32; ROOM]; 2],
    ) {
        let grid = self.grid.along(axis);
        let grids = EightGrids {
            origin: [grid.origin; 8],
            scale: [grid.scale; 8],
            last: grid.last,
        };
        let mut tables = [starts, ends];
        let rest = if self.step == 1 {
            let (fours, rest) = self.prims.as_chunks::<4>();
            for four in fours {
                count_four::<ROOM, 4, S>(simd, axis, &grids, four.each_ref(), &mut tables);
            }
            rest
        } else {
            self.prims
        };
        for prim in rest.iter().step_by(self.step) {
            count_four::<ROOM, 1, S>(simd, axis, &grids, [prim; 4], &mut tables);
        }
    }

    /// Along all axes, all six ends of a primitive at a time.
    #[inline(always)]
    fn count_all<const ROOM: usize, S: Simd>(
        &self,
        simd: S,
        [x_starts, x_ends, y_starts, y_ends, z_starts, z_ends]: [&mut [u32; ROOM]; 6],
    ) {
        let twice = |v: Vec4| bytemuck::cast([v.to_array(); 2]);
        let grids = EightGrids {
            origin: twice(self.grid.origin),
            scale: twice(self.grid.scale),
            last: self.grid.last,
        };
        for prim in self.prims.iter().step_by(self.step) {
            let bins = simd.run(FindBins {
                grids: &grids,
                positions: prim.ends(),
            });
            let bins = bins.map(|bin| usize::from(bin) % ROOM);
            x_starts[bins[0]] += 1;
            y_starts[bins[1]] += 1;
            z_starts[bins[2]] += 1;
            x_ends[bins[4]] += 1;
            y_ends[bins[5]] += 1;
            z_ends[bins[6]] += 1;
        }
    }
}

/// Counts in tables of `ROOM` bins at some level.
struct Count<'a, 'c, const ROOM: usize> {
    counting: &'a Counting<'a>,
    counts: &'c mut [u32],
}

impl<S: Simd, const ROOM: usize> Task<S> for Count<'_, '_, ROOM> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        self.counting.count_by::<ROOM, S>(simd, self.counts);
    }
}

/// Counts the first `NUMBER` of four primitives.
#[inline(always)]
fn count_four<const ROOM: usize, const NUMBER: usize, S: Simd>(
    simd: S,
    axis: Axis,
    grids: &EightGrids,
    four: [&Prim; 4],
    [starts, ends]: &mut [&mut [u32; ROOM]; 2],
) {
    let [a, b, c, d] = four.map(|prim| prim.start(axis));
    let [e, f, g, h] = four.map(|prim| prim.end(axis));
    let bins = simd.run(FindBins {
        grids,
        positions: &[a, b, c, d, e, f, g, h],
    });
    for lane in 0..NUMBER {
        starts[usize::from(bins[lane]) % ROOM] += 1;
        ends[usize::from(bins[4 + lane]) % ROOM] += 1;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::prim::samples::boxes;

    proptest! {
        /// The detected and the portable level equal a count one end at a time.
        #[test]
        fn all_levels_count_the_same(
            boxes_at in prop::collection::vec(([-20_i8..20, -20_i8..20, -20_i8..20], [0_i8..8, 0_i8..8, 0_i8..8]), 1..40),
            step in 1_usize..4,
            bins in prop::sample::select(vec![2_usize, 7, 32, 33, 256]),
        ) {
            let (prims, bounds) = boxes(&boxes_at);
            let grid = Grid::new(&bounds, bins);
            for axes in [&Axis::ALL[..], &Axis::ALL[1..2]] {
                let counted = Bins::of(&prims, axes, &grid, step);
                let mut portable = Bins { counts: vec![0; counted.counts.len()], ..counted.clone() };
                let counting = Counting { prims: &prims, step, axes, grid: &grid };
                let counts = &mut portable.counts[..];
                if bins <= FEW_BINS {
                    Level::portable().run(Count::<FEW_BINS> { counting: &counting, counts });
                } else {
                    Level::portable().run(Count::<MOST_BINS> { counting: &counting, counts });
                }
                prop_assert_eq!(&counted.counts, &portable.counts);
                for &axis in axes {
                    let along = grid.along(axis);
                    let (mut starts, mut ends) = (vec![0; bins], vec![0; bins]);
                    for prim in prims.iter().step_by(step) {
                        starts[usize::from(along.bin(prim.start(axis)))] += 1;
                        ends[usize::from(along.bin(prim.end(axis)))] += 1;
                    }
                    prop_assert_eq!(counted.along(axis), (&starts[..], &ends[..]));
                }
            }
        }
    }
}
