//! A cell of the tree under construction, and the sides of its primitives with respect to a plane.

use kd_core::Aabb;

use crate::plane::{Plane, Side};
use crate::prim::Prim;

/// The geometry of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place {
    pub(crate) bounds: Aabb,
    /// The box around its primitives, clipped to the cell; empty if it has none.
    pub(crate) tight: Aabb,
    /// The number of interior nodes above it.
    pub(crate) depth: u32,
}

/// The input of a chooser: a cell and its primitives in ascending order of slots.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell<'a> {
    pub(crate) place: &'a Place,
    pub(crate) prims: &'a [Prim],
}

/// The side of a plane on which a primitive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lies {
    Below,
    Above,
    Across,
}

impl Lies {
    /// Compares the primitive's box with the plane, by the same rule as the counts of candidate planes.
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

/// The numbers of primitives that go to the lower and to the upper child.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counted {
    pub(crate) lower: usize,
    pub(crate) upper: usize,
}

impl Counted {
    /// Counts before clipping. Clipping may remove a primitive from one child.
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

    /// The number of one child.
    pub(crate) fn at(self, side: Side) -> usize {
        match side {
            Side::Lower => self.lower,
            Side::Upper => self.upper,
        }
    }
}
