//! A cell of the tree being built, and how a plane divides it.

use kd_core::{Aabb, PrimSource};

use crate::plane::{Plane, Side};
use crate::prim::{Around, Prim};
use crate::tasks::{self, CHUNK};

/// What a chooser is asked about.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) bounds: Aabb,
    /// The box around all its primitives; empty if there are none.
    pub(crate) tight: Aabb,
    /// In ascending order of slots.
    pub(crate) prims: Vec<Prim>,
    /// Interior nodes above it.
    pub(crate) depth: u32,
}

/// Where a primitive lies, as seen from a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Place {
    Lower,
    Upper,
    /// On both sides.
    Across,
}

impl Place {
    /// Sides follow from comparing boxes with the plane, exactly as planes are counted.
    #[inline]
    pub(crate) fn of(prim: &Prim, plane: &Plane) -> Self {
        let (start, end) = (prim.start(plane.axis), prim.end(plane.axis));
        let (below, above) = (start < plane.position, end > plane.position);
        match (below, above) {
            (true, true) => Self::Across,
            (true, false) => Self::Lower,
            (false, true) => Self::Upper,
            (false, false) => match plane.planar_side {
                Side::Lower => Self::Lower,
                Side::Upper => Self::Upper,
            },
        }
    }
}

impl Cell {
    /// Divides the cell. What straddles the plane is clipped anew from the original primitive ("perfect split").
    ///
    /// All builders divide by this one function, so equal planes give equal trees. Large cells are divided in chunks,
    /// possibly on several threads (ClassifyTriangles and FilterGeometry of Choi et al. 2010): each chunk is counted,
    /// so that each knows where its part of the outcome goes, and the order is that of the cell.
    pub(crate) fn divide(
        &self,
        source: &impl PrimSource,
        plane: &Plane,
        parallel: bool,
    ) -> (Self, Self) {
        let (lower_bounds, upper_bounds) = self.bounds.split(plane.axis, plane.position);
        let counts = tasks::map(
            self.prims.chunks(CHUNK).collect(),
            parallel,
            |chunk: &[Prim]| Counted::of(chunk, plane),
        );
        let total = counts
            .iter()
            .fold(Counted::default(), |sum, count| Counted {
                lower: sum.lower + count.lower,
                upper: sum.upper + count.upper,
            });
        let mut lower = vec![Prim::NONE; total.lower];
        let mut upper = vec![Prim::NONE; total.upper];

        let mut chunks = Vec::with_capacity(counts.len());
        let (mut lower_rest, mut upper_rest) = (lower.as_mut_slice(), upper.as_mut_slice());
        for (chunk, count) in self.prims.chunks(CHUNK).zip(&counts) {
            let (lower, upper);
            (lower, lower_rest) = lower_rest.split_at_mut(count.lower);
            (upper, upper_rest) = upper_rest.split_at_mut(count.upper);
            chunks.push(Division {
                source,
                plane,
                cell: &self.bounds,
                prims: chunk,
                lower,
                upper,
            });
        }
        let divided = tasks::map(chunks, parallel, Division::run);
        let (mut lower_tight, mut upper_tight) = (Around::NOTHING, Around::NOTHING);
        for done in &divided {
            lower_tight.join(&done.lower_tight);
            upper_tight.join(&done.upper_tight);
        }
        close_gaps(
            &mut lower,
            divided
                .iter()
                .zip(&counts)
                .map(|(done, count)| (done.filled.lower, count.lower)),
        );
        close_gaps(
            &mut upper,
            divided
                .iter()
                .zip(&counts)
                .map(|(done, count)| (done.filled.upper, count.upper)),
        );
        let part = |bounds, tight: Around, prims| Self {
            bounds,
            tight: tight.bounds(),
            prims,
            depth: self.depth + 1,
        };
        (
            part(lower_bounds, lower_tight, lower),
            part(upper_bounds, upper_tight, upper),
        )
    }
}

/// How many primitives reach below and above a plane.
#[derive(Clone, Copy, Debug, Default)]
struct Counted {
    lower: usize,
    upper: usize,
}

impl Counted {
    fn of(prims: &[Prim], plane: &Plane) -> Self {
        let planar_lower = plane.planar_side == Side::Lower;
        let (mut lower, mut upper) = (0, 0);
        for prim in prims {
            let (below, above) = (
                prim.start(plane.axis) < plane.position,
                prim.end(plane.axis) > plane.position,
            );
            lower += usize::from(below | (!above & planar_lower));
            upper += usize::from(above | (!below & !planar_lower));
        }
        Self { lower, upper }
    }
}

/// One chunk of a cell on its way to both parts.
struct Division<'a, S> {
    source: &'a S,
    plane: &'a Plane,
    cell: &'a Aabb,
    prims: &'a [Prim],
    lower: &'a mut [Prim],
    upper: &'a mut [Prim],
}

/// What came of it.
struct Divided {
    filled: Counted,
    lower_tight: Around,
    upper_tight: Around,
}

impl<S: PrimSource> Division<'_, S> {
    fn run(self) -> Divided {
        let plane = self.plane;
        let planar_lower = plane.planar_side == Side::Lower;
        let (mut lower, mut upper) = (0, 0);
        let (mut lower_tight, mut upper_tight) = (Around::NOTHING, Around::NOTHING);
        for prim in self.prims {
            let (below, above) = (
                prim.start(plane.axis) < plane.position,
                prim.end(plane.axis) > plane.position,
            );
            if below && above {
                let [low, high] = self.cut(prim);
                if let Some(part) = low {
                    self.lower[lower] = part;
                    lower_tight.add(&part);
                    lower += 1;
                }
                if let Some(part) = high {
                    self.upper[upper] = part;
                    upper_tight.add(&part);
                    upper += 1;
                }
                continue;
            }
            // Which side is as good as random, so it is written to both, and kept on one.
            let is_lower = below | (!above & planar_lower);
            if let Some(place) = self.lower.get_mut(lower) {
                *place = *prim;
            }
            if let Some(place) = self.upper.get_mut(upper) {
                *place = *prim;
            }
            lower += usize::from(is_lower);
            upper += usize::from(!is_lower);
        }
        for prim in &self.lower[..lower] {
            lower_tight.add(prim);
        }
        for prim in &self.upper[..upper] {
            upper_tight.add(prim);
        }
        Divided {
            filled: Counted { lower, upper },
            lower_tight,
            upper_tight,
        }
    }

    /// The parts of a primitive that the plane cuts.
    fn cut(&self, prim: &Prim) -> [Option<Prim>; 2] {
        let (slot, plane) = (prim.slot(), self.plane);
        let mut parts = self
            .source
            .clipped_halves(slot, self.cell, plane.axis, plane.position);
        if parts == [None, None] {
            // Rounding put a sliver of it outside of both; it must not be lost.
            let (below, above) = prim.bounds().split(plane.axis, plane.position);
            parts = [Some(below), Some(above)];
        }
        parts.map(|part| part.map(|bounds| Prim::new(slot, &bounds)))
    }
}

/// Moves what was filled together, where clipping left less of a chunk than was counted.
fn close_gaps(prims: &mut Vec<Prim>, chunks: impl Iterator<Item = (usize, usize)>) {
    let (mut to, mut from) = (0, 0);
    for (filled, counted) in chunks {
        if to < from {
            prims.copy_within(from..from + filled, to);
        }
        to += filled;
        from += counted;
    }
    prims.truncate(to);
}
