//! How many primitives start and end in each of a few intervals of equal width, on all axes (Shevtsov et al. 2007).

use std::borrow::Cow;

use glam::Vec4;
use kd_core::{Aabb, Axis};

use crate::cell::Cell;
use crate::plane::AxisCost;
use crate::prim::Prim;
use crate::tasks::{self, CHUNK};

/// Most bins along an axis: their numbers fit into a byte, which needs no check when it indexes a table of so many.
pub(crate) const MOST_BINS: usize = 256;

/// Divides a box into intervals of equal width along each axis, and tells in which one a position lies.
///
/// The number of a bin never decreases along the axis, rounding included.
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

    /// The bins on all axes: [`AxisGrid::bin`] by the same operations on vectors.
    #[inline]
    fn bins_of(&self, position: Vec4) -> [u8; 3] {
        let at = (position - self.origin) * self.scale - Vec4::splat(0.5);
        let at = at.max(Vec4::ZERO).min(Vec4::splat(self.last)) + Vec4::splat(AxisGrid::INTEGERS);
        [at.x, at.y, at.z].map(low_byte)
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
    /// 2²³: adding it rounds to a whole number, which then stands in the lowest bits.
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

    /// What [`rounded`](Self::rounded) gives for positions in a bin.
    pub(crate) fn as_rounded(bin: u8) -> f32 {
        f32::from(bin) + Self::INTEGERS
    }
}

/// How far off a face may be, as a fraction of a cell, four times over.
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
    fn at(&self, bin: usize) -> f32 {
        self.first + bin as f32 * self.step
    }

    /// An interval that no position in the bin lies outside of: faces are a few units in the last place of the box
    /// off, 2⁻²² of it, and fractions by no more.
    #[inline]
    pub(crate) fn around(&self, bin: usize) -> (f32, f32) {
        let (start, end) = (self.at(bin) - MARGIN, self.at(bin + 1) + MARGIN);
        (start.max(0.0), end.min(1.0))
    }

    /// An interval around the lower face of a bin that the true face lies in.
    #[inline]
    pub(crate) fn near(&self, bin: usize) -> (f32, f32) {
        let face = self.at(bin);
        (face - MARGIN, face + MARGIN)
    }
}

#[inline]
#[allow(clippy::cast_possible_truncation, reason = "the lowest byte is meant")]
fn low_byte(x: f32) -> u8 {
    x.to_bits() as u8
}

/// How many primitives start, and how many end, in one bin of each axis.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bin {
    pub(crate) starts: [u32; 3],
    pub(crate) ends: [u32; 3],
}

/// The counts.
#[derive(Clone, Debug)]
pub(crate) struct Bins(Vec<Bin>);

impl Bins {
    /// Counts each `step`th primitive, along one axis only.
    fn of_axis(prims: &[Prim], grid: &Grid, step: usize, axis: Axis) -> Self {
        let mut bins = vec![Bin::default(); grid.bins];
        let grid = grid.along(axis);
        for prim in prims.iter().step_by(step) {
            bins[usize::from(grid.bin(prim.start(axis)))].starts[axis.index()] += 1;
            bins[usize::from(grid.bin(prim.end(axis)))].ends[axis.index()] += 1;
        }
        Self(bins)
    }

    /// Counts each `step`th primitive.
    fn of(prims: &[Prim], grid: &Grid, step: usize) -> Self {
        let mut bins = vec![Bin::default(); grid.bins];
        for prim in prims.iter().step_by(step) {
            let [x, y, z] = grid.bins_of(prim.low());
            bins[usize::from(x)].starts[0] += 1;
            bins[usize::from(y)].starts[1] += 1;
            bins[usize::from(z)].starts[2] += 1;
            let [x, y, z] = grid.bins_of(prim.high());
            bins[usize::from(x)].ends[0] += 1;
            bins[usize::from(y)].ends[1] += 1;
            bins[usize::from(z)].ends[2] += 1;
        }
        Self(bins)
    }

    /// Of all chunks together (Push).
    pub(crate) fn sum(chunks: &[Self]) -> Cow<'_, Self> {
        let Some((first, others)) = chunks.split_first() else {
            return Cow::Owned(Self(Vec::new()));
        };
        let mut sum = Cow::Borrowed(first);
        for other in others {
            for (own, other) in sum.to_mut().0.iter_mut().zip(&other.0) {
                for axis in 0..3 {
                    own.starts[axis] += other.starts[axis];
                    own.ends[axis] += other.ends[axis];
                }
            }
        }
        sum
    }

    /// How many primitives start and end in each bin of an axis.
    #[inline]
    pub(crate) fn along(
        &self,
        axis: Axis,
    ) -> impl DoubleEndedIterator<Item = (usize, usize)> + ExactSizeIterator {
        let axis = axis.index();
        let counts = move |bin: &Bin| (bin.starts[axis] as usize, bin.ends[axis] as usize);
        self.0.iter().map(counts)
    }

    /// How many primitives start in a bin, and how many end there.
    #[inline]
    pub(crate) fn at(&self, axis: Axis, bin: usize) -> (usize, usize) {
        let axis = axis.index();
        (
            self.0[bin].starts[axis] as usize,
            self.0[bin].ends[axis] as usize,
        )
    }

    /// How many primitives were counted, along an axis that was: each starts once.
    pub(crate) fn counted(&self, axis: Axis) -> usize {
        self.along(axis).map(|(starts, _)| starts).sum()
    }
}

/// The counts of every `step`th primitive of a cell, in chunks, so that several threads can count (`PreScan` of Choi et
/// al. 2010).
pub(crate) fn count(
    cell: Cell<'_>,
    axes: &[Axis],
    grid: &Grid,
    step: usize,
    parallel: bool,
) -> Vec<Bins> {
    tasks::map(
        cell.prims.chunks(CHUNK).collect(),
        parallel,
        |chunk: &[Prim]| match axes {
            [axis] => Bins::of_axis(chunk, grid, step, *axis),
            _ => Bins::of(chunk, grid, step),
        },
    )
}
