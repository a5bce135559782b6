//! A cell of the tree being built, and how a plane divides it.

use kd_core::{Aabb, PrimSource};

use crate::plane::{Plane, Side};
use crate::prim::{Around, Prim};
use crate::tasks::{self, CHUNK};

/// Where a cell is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    pub(crate) bounds: Aabb,
    /// The box around all its primitives; empty if there are none.
    pub(crate) tight: Aabb,
    /// Interior nodes above it.
    pub(crate) depth: u32,
}

/// What a chooser is asked about: a place, and the primitives there in ascending order of slots.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell<'a> {
    pub(crate) place: &'a Place,
    pub(crate) prims: &'a [Prim],
}

/// Which side of a plane a primitive lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lies {
    Below,
    Above,
    Across,
}

impl Lies {
    /// Sides follow from comparing boxes with the plane, exactly as planes are counted.
    pub(crate) fn of(prim: &Prim, plane: &Plane) -> Self {
        let (start, end) = (prim.start(plane.axis), prim.end(plane.axis));
        match (start < plane.position, end > plane.position) {
            (true, true) => Self::Across,
            (true, false) => Self::Below,
            (false, true) => Self::Above,
            (false, false) => match plane.planar_side {
                Side::Lower => Self::Below,
                Side::Upper => Self::Above,
            },
        }
    }
}

/// How many primitives go to the lower and to the upper part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counted {
    pub(crate) lower: usize,
    pub(crate) upper: usize,
}

impl Counted {
    /// Before clipping, which may find that a part of a primitive is none.
    pub(crate) fn of(prims: &[Prim], plane: &Plane) -> Self {
        let planar_lower = plane.planar_side == Side::Lower;
        let mut counted = Self::default();
        for prim in prims {
            let (below, above) = (
                prim.start(plane.axis) < plane.position,
                prim.end(plane.axis) > plane.position,
            );
            counted.lower += usize::from(below | (!above & planar_lower));
            counted.upper += usize::from(above | (!below & !planar_lower));
        }
        counted
    }

    /// Of a large cell, possibly on several threads; each chunk's counts, too.
    pub(crate) fn in_chunks(prims: &[Prim], plane: &Plane, parallel: bool) -> (Self, Vec<Self>) {
        let chunks = tasks::map(
            prims.chunks(CHUNK).collect(),
            parallel,
            |chunk: &[Prim]| Self::of(chunk, plane),
        );
        let mut sum = Self::default();
        for chunk in &chunks {
            sum.lower += chunk.lower;
            sum.upper += chunk.upper;
        }
        (sum, chunks)
    }
}

/// A plane that divides a cell.
pub(crate) struct Division<'a, S> {
    pub(crate) source: &'a S,
    pub(crate) place: &'a Place,
    pub(crate) plane: &'a Plane,
}

/// How much of both parts is filled, and the boxes around it.
#[derive(Clone, Copy, Debug)]
struct Filled {
    counted: Counted,
    lower_tight: Around,
    upper_tight: Around,
}

impl<S: PrimSource> Division<'_, S> {
    /// Divides a cell within a list: the primitives from `first` on are replaced by those of the upper part, and
    /// behind them those of the lower part. Gives the places of both parts and where the lower one starts.
    ///
    /// `scratch` keeps the primitives of the cell itself until it is used again.
    pub(crate) fn in_place(
        &self,
        list: &mut Vec<Prim>,
        first: usize,
        counted: Counted,
        scratch: &mut Vec<Prim>,
    ) -> ([Place; 2], usize) {
        scratch.clear();
        scratch.extend_from_slice(&list[first..]);
        list.resize(first + counted.upper + counted.lower, Prim::NONE);
        let (upper, lower) = list[first..].split_at_mut(counted.upper);
        let filled = self.run(scratch, lower, upper);
        let middle = first + filled.counted.upper;
        if filled.counted != counted {
            let lower = first + counted.upper;
            list.copy_within(lower..lower + filled.counted.lower, middle);
            list.truncate(middle + filled.counted.lower);
        }
        (self.places(&filled), middle)
    }

    /// Divides a large cell into two lists, in chunks and possibly on several threads (`ClassifyTriangles` and
    /// `FilterGeometry` of Choi et al. 2010). Each chunk has been counted, so it is known where its part of the outcome
    /// goes, and the order is that of the cell.
    pub(crate) fn in_chunks(
        &self,
        prims: &[Prim],
        (sum, counts): &(Counted, Vec<Counted>),
        parallel: bool,
    ) -> [(Place, Vec<Prim>); 2] {
        let mut lower = vec![Prim::NONE; sum.lower];
        let mut upper = vec![Prim::NONE; sum.upper];
        let mut chunks = Vec::with_capacity(counts.len());
        let (mut lower_rest, mut upper_rest) = (lower.as_mut_slice(), upper.as_mut_slice());
        for (chunk, count) in prims.chunks(CHUNK).zip(counts) {
            let (lower, upper);
            (lower, lower_rest) = lower_rest.split_at_mut(count.lower);
            (upper, upper_rest) = upper_rest.split_at_mut(count.upper);
            chunks.push((chunk, lower, upper));
        }
        let filled = tasks::map(chunks, parallel, |(chunk, lower, upper)| {
            self.run(chunk, lower, upper)
        });
        let gaps = filled.iter().map(|chunk| chunk.counted).zip(counts);
        close_gaps(
            &mut lower,
            gaps.clone()
                .map(|(filled, counted)| (filled.lower, counted.lower)),
        );
        close_gaps(
            &mut upper,
            gaps.map(|(filled, counted)| (filled.upper, counted.upper)),
        );
        let all = filled.iter().copied().reduce(|mut all, chunk| {
            all.lower_tight.join(&chunk.lower_tight);
            all.upper_tight.join(&chunk.upper_tight);
            all
        });
        let [lower_place, upper_place] = self.places(&all.unwrap_or(Filled::NOTHING));
        [(lower_place, lower), (upper_place, upper)]
    }

    fn places(&self, filled: &Filled) -> [Place; 2] {
        let (lower, upper) = self
            .place
            .bounds
            .split(self.plane.axis, self.plane.position);
        [(lower, filled.lower_tight), (upper, filled.upper_tight)].map(|(bounds, tight)| Place {
            bounds,
            tight: tight.bounds(),
            depth: self.place.depth + 1,
        })
    }

    /// Divides primitives into two lists that are as long as was counted. What straddles the plane is clipped anew from
    /// the original primitive ("perfect split").
    ///
    /// All builders divide by this one function, so equal planes give equal trees.
    fn run(&self, prims: &[Prim], lower_list: &mut [Prim], upper_list: &mut [Prim]) -> Filled {
        let plane = self.plane;
        let planar_lower = plane.planar_side == Side::Lower;
        let (mut lower, mut upper) = (0, 0);
        for prim in prims {
            let (below, above) = (
                prim.start(plane.axis) < plane.position,
                prim.end(plane.axis) > plane.position,
            );
            if below && above {
                let [below, above] = self.cut(prim);
                if let Some(part) = below {
                    lower_list[lower] = part;
                    lower += 1;
                }
                if let Some(part) = above {
                    upper_list[upper] = part;
                    upper += 1;
                }
                continue;
            }
            // Which side is as good as random, so it is written to both, and kept on one.
            let is_lower = below | (!above & planar_lower);
            if let Some(place) = lower_list.get_mut(lower) {
                *place = *prim;
            }
            if let Some(place) = upper_list.get_mut(upper) {
                *place = *prim;
            }
            lower += usize::from(is_lower);
            upper += usize::from(!is_lower);
        }
        Filled {
            counted: Counted { lower, upper },
            lower_tight: Around::all(&lower_list[..lower]),
            upper_tight: Around::all(&upper_list[..upper]),
        }
    }

    /// The parts of a primitive that the plane cuts.
    fn cut(&self, prim: &Prim) -> [Option<Prim>; 2] {
        let (slot, plane) = (prim.slot(), self.plane);
        let mut parts =
            self.source
                .clipped_halves(slot, &self.place.bounds, plane.axis, plane.position);
        if parts == [None, None] {
            // Rounding put a sliver of it outside of both; it must not be lost.
            let (below, above) = prim.bounds().split(plane.axis, plane.position);
            parts = [Some(below), Some(above)];
        }
        parts.map(|part| part.map(|bounds| Prim::new(slot, &bounds)))
    }
}

impl Filled {
    const NOTHING: Self = Self {
        counted: Counted { lower: 0, upper: 0 },
        lower_tight: Around::NOTHING,
        upper_tight: Around::NOTHING,
    };
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
