//! A cell of the tree being built, and how a plane divides it.

use kd_core::{Aabb, PrimSource};

use crate::plane::{Plane, Side};

/// A primitive, or the part of one that lies in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Prim {
    /// Which one: its number in the source.
    pub(crate) slot: u32,
    /// The box around the part.
    pub(crate) bounds: Aabb,
}

/// What a chooser is asked about.
#[derive(Clone, Debug)]
pub(crate) struct Cell {
    pub(crate) bounds: Aabb,
    /// In ascending order of slots.
    pub(crate) prims: Vec<Prim>,
    /// Interior nodes above it.
    pub(crate) depth: u32,
}

/// Where a primitive of a cell went when the cell was divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Moved {
    /// Below the plane, under this number, as it was.
    Lower(u32),
    /// Above the plane, under this number, as it was.
    Upper(u32),
    /// The plane cut it, so that what is left of it has new boxes.
    Cut,
}

/// A cell divided.
#[derive(Debug)]
pub(crate) struct Division {
    pub(crate) lower: Cell,
    pub(crate) upper: Cell,
    /// Where each primitive of the divided cell went.
    pub(crate) moved: Vec<Moved>,
    /// Numbers in `lower` of primitives that were cut.
    pub(crate) cut_lower: Vec<u32>,
    /// Numbers in `upper` of primitives that were cut.
    pub(crate) cut_upper: Vec<u32>,
}

impl Cell {
    /// Divides the cell. What straddles the plane is clipped anew from the original primitive ("perfect split").
    ///
    /// All builders divide by this one function, and sides follow from comparing boxes with the plane, exactly as
    /// planes are counted; so equal planes give equal trees.
    pub(crate) fn divide(&self, source: &impl PrimSource, plane: &Plane) -> Division {
        let (lower_bounds, upper_bounds) = self.bounds.split(plane.axis, plane.position);
        let below = |bounds| Self {
            bounds,
            prims: Vec::new(),
            depth: self.depth + 1,
        };
        let mut division = Division {
            lower: below(lower_bounds),
            upper: below(upper_bounds),
            moved: Vec::with_capacity(self.prims.len()),
            cut_lower: Vec::new(),
            cut_upper: Vec::new(),
        };
        for prim in &self.prims {
            division.add(source, plane, prim);
        }
        division
    }
}

impl Division {
    /// The two parts; everything else is freed.
    pub(crate) fn into_cells(self) -> (Cell, Cell) {
        (self.lower, self.upper)
    }

    fn add(&mut self, source: &impl PrimSource, plane: &Plane, prim: &Prim) {
        let axis = plane.axis.index();
        let (start, end) = (prim.bounds.min[axis], prim.bounds.max[axis]);
        let is_planar = start == plane.position && end == plane.position;
        let moved = match (is_planar, plane.planar_side) {
            (true, Side::Lower) => Moved::Lower(push(&mut self.lower, *prim)),
            (true, Side::Upper) => Moved::Upper(push(&mut self.upper, *prim)),
            (false, _) if end <= plane.position => Moved::Lower(push(&mut self.lower, *prim)),
            (false, _) if start >= plane.position => Moved::Upper(push(&mut self.upper, *prim)),
            (false, _) => {
                self.cut(source, plane, prim);
                Moved::Cut
            }
        };
        self.moved.push(moved);
    }

    fn cut(&mut self, source: &impl PrimSource, plane: &Plane, prim: &Prim) {
        let mut lower = source.clipped_bounds(prim.slot, &self.lower.bounds);
        let mut upper = source.clipped_bounds(prim.slot, &self.upper.bounds);
        if lower.is_none() && upper.is_none() {
            // Rounding put a sliver of it outside of both; it must not be lost.
            let (below, above) = prim.bounds.split(plane.axis, plane.position);
            (lower, upper) = (Some(below), Some(above));
        }
        let slot = prim.slot;
        if let Some(bounds) = lower {
            self.cut_lower
                .push(push(&mut self.lower, Prim { slot, bounds }));
        }
        if let Some(bounds) = upper {
            self.cut_upper
                .push(push(&mut self.upper, Prim { slot, bounds }));
        }
    }
}

#[allow(
    clippy::cast_possible_truncation,
    reason = "at most MAX_TRIANGLES, which has 30 bits"
)]
fn push(cell: &mut Cell, prim: Prim) -> u32 {
    cell.prims.push(prim);
    cell.prims.len() as u32 - 1
}
