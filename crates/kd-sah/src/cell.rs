//! A cell of the tree being built, and on which side of a plane its primitives lie.

use kd_core::Aabb;

use crate::plane::{Plane, Side};
use crate::prim::Prim;

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

    /// Of one part.
    pub(crate) fn at(self, side: Side) -> usize {
        match side {
            Side::Lower => self.lower,
            Side::Upper => self.upper,
        }
    }
}
