//! What a builder needs to know about the things it sorts into a tree.

use crate::{Aabb, Axis, Mesh, clipped_bounds, clipped_halves};

/// Primitives as a builder sees them: how many there are, where they are, and which part of one lies in a cell.
///
/// [`Mesh`] is the source that everybody uses; implement it to build trees over something else.
pub trait PrimSource: Sync {
    /// How many primitives there are; at most [`MAX_TRIANGLES`](crate::MAX_TRIANGLES).
    fn count(&self) -> u32;

    /// The box around a primitive, closed and finite. It may be flat, or a point, but not empty.
    fn bounds(&self, primitive: u32) -> Aabb;

    /// A box, inside `cell`, around the part of the primitive that lies in it; `None` if no part does. It must hold
    /// every point of the primitive in the cell up to rounding, and may be larger than the part.
    fn clipped_bounds(&self, primitive: u32, cell: &Aabb) -> Option<Aabb>;

    /// [`clipped_bounds`](Self::clipped_bounds) for both parts of a cell that is cut at `position` along `axis`. It
    /// exists because both together may take less time than one after the other.
    fn clipped_halves(
        &self,
        primitive: u32,
        cell: &Aabb,
        axis: Axis,
        position: f32,
    ) -> [Option<Aabb>; 2] {
        let (lower, upper) = cell.split(axis, position);
        [lower, upper].map(|part| self.clipped_bounds(primitive, &part))
    }
}

impl PrimSource for Mesh {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has at most MAX_TRIANGLES"
    )]
    fn count(&self) -> u32 {
        self.len() as u32
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        Aabb::around(self.corners(primitive))
    }

    fn clipped_bounds(&self, primitive: u32, cell: &Aabb) -> Option<Aabb> {
        clipped_bounds(self.corners(primitive), cell)
    }

    fn clipped_halves(
        &self,
        primitive: u32,
        cell: &Aabb,
        axis: Axis,
        position: f32,
    ) -> [Option<Aabb>; 2] {
        clipped_halves(self.corners(primitive), cell, axis, position)
    }
}
