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

    /// The bin of a position in the box.
    #[inline]
    pub(crate) fn bin(&self, axis: Axis, position: f32) -> u8 {
        let axis = axis.index();
        let at = (position - self.origin[axis]) * self.scale[axis] - 0.5;
        let at = if at > 0.0 { at } else { 0.0 };
        let at = if at < self.last { at } else { self.last };
        low_byte(at + INTEGERS)
    }

    /// The bins on all axes: [`bin`](Self::bin) by the same operations on vectors.
    #[inline]
    fn bins_of(&self, position: Vec4) -> [u8; 3] {
        let at = (position - self.origin) * self.scale - Vec4::splat(0.5);
        let at = at.max(Vec4::ZERO).min(Vec4::splat(self.last)) + Vec4::splat(INTEGERS);
        [at.x, at.y, at.z].map(low_byte)
    }

    /// Where a bin starts and ends, as fractions of a cell that holds the box: no position in the bin lies outside,
    /// but they may be a little too far apart.
    pub(crate) fn fractions(&self, along: &AxisCost, axis: Axis, bin: usize) -> (f32, f32) {
        // The number of a bin errs by a few units in the last place of its position, 2⁻²² of the box, and the fraction
        // by no more.
        const MARGIN: f32 = 1.0 / (1 << 20) as f32;
        let scale = self.scale[axis.index()];
        if scale == 0.0 {
            return (0.0, 1.0);
        }
        let edge = |bin: usize| {
            along.fraction(self.origin[axis.index()]) + bin as f32 / scale * along.scale
        };
        let (start, end) = (edge(bin) - MARGIN, edge(bin + 1) + MARGIN);
        (start.clamp(0.0, 1.0), end.clamp(0.0, 1.0))
    }

    /// A plane between two bins: in the box, at the start of `bin` up to rounding.
    pub(crate) fn boundary(&self, axis: Axis, bin: usize) -> f32 {
        self.origin[axis.index()] + bin as f32 / self.scale[axis.index()]
    }

    pub(crate) fn bins(&self) -> usize {
        self.bins
    }
}

/// 2²³: adding it rounds to a whole number, which then stands in the lowest bits.
const INTEGERS: f32 = (1 << 23) as f32;

#[inline]
#[allow(clippy::cast_possible_truncation, reason = "the lowest byte is meant")]
fn low_byte(x: f32) -> u8 {
    x.to_bits() as u8
}

/// The counts.
#[derive(Clone, Debug)]
pub(crate) struct Bins {
    pub(crate) starts: [[u32; MOST_BINS]; 3],
    pub(crate) ends: [[u32; MOST_BINS]; 3],
}

impl Bins {
    const EMPTY: Self = Self {
        starts: [[0; MOST_BINS]; 3],
        ends: [[0; MOST_BINS]; 3],
    };

    /// Counts each `step`th primitive.
    fn of(prims: &[Prim], grid: &Grid, step: usize) -> Self {
        let mut bins = Self::EMPTY;
        let Self { starts, ends } = &mut bins;
        for prim in prims.iter().step_by(step) {
            let [x, y, z] = grid.bins_of(prim.low());
            starts[0][usize::from(x)] += 1;
            starts[1][usize::from(y)] += 1;
            starts[2][usize::from(z)] += 1;
            let [x, y, z] = grid.bins_of(prim.high());
            ends[0][usize::from(x)] += 1;
            ends[1][usize::from(y)] += 1;
            ends[2][usize::from(z)] += 1;
        }
        bins
    }

    /// Of all chunks together (Push).
    pub(crate) fn sum(chunks: &[Self]) -> Cow<'_, Self> {
        match chunks {
            [one] => Cow::Borrowed(one),
            _ => Cow::Owned(chunks.iter().fold(Self::EMPTY, |mut sum, chunk| {
                sum.add(chunk);
                sum
            })),
        }
    }

    /// How many primitives were counted: each starts once.
    pub(crate) fn counted(&self) -> usize {
        self.starts[0].iter().map(|&count| count as usize).sum()
    }

    fn add(&mut self, other: &Self) {
        let pairs = [
            (&mut self.starts, &other.starts),
            (&mut self.ends, &other.ends),
        ];
        for (own, other) in pairs {
            for (own, other) in own.as_flattened_mut().iter_mut().zip(other.as_flattened()) {
                *own += other;
            }
        }
    }
}

/// The counts of every `step`th primitive of a cell, in chunks, so that several threads can count (PreScan of Choi et
/// al. 2010).
pub(crate) fn count(cell: &Cell, grid: &Grid, step: usize, parallel: bool) -> Vec<Bins> {
    tasks::map(
        cell.prims.chunks(CHUNK).collect(),
        parallel,
        |chunk: &[Prim]| Bins::of(chunk, grid, step),
    )
}
