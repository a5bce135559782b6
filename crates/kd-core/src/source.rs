//! What a builder needs to know about the things it sorts into a tree.

use glam::Vec3;

use crate::{Aabb, Axis, Mesh, clipped_bounds, clipped_halves};

/// Primitives as a builder sees them: how many there are, where they are, and which part of one lies in a cell.
///
/// [`Mesh`] is the source that everybody uses; implement it to build trees over something else.
pub trait PrimSource: Sync {
    /// What of a primitive is needed to clip it.
    type Shape: Copy;

    /// How many primitives there are; at most [`MAX_TRIANGLES`](crate::MAX_TRIANGLES).
    fn count(&self) -> u32;

    /// The box around a primitive, closed and finite. It may be flat, or a point, but not empty.
    fn bounds(&self, primitive: u32) -> Aabb;

    /// The shape of a primitive. It is apart from clipping so that a builder can fetch several from memory before it
    /// clips the first.
    fn shape(&self, primitive: u32) -> Self::Shape;

    /// A box, inside `cell`, around the part of the primitive that lies in it; `None` if no part does. It must hold
    /// every point of the primitive in the cell up to rounding, and may be larger than the part. The cell is infinite
    /// towards sides that are known not to matter.
    fn clipped_bounds(&self, shape: &Self::Shape, cell: &Aabb) -> Option<Aabb>;

    /// [`clipped_bounds`](Self::clipped_bounds) for both parts of a cell that is cut at `position` along `axis`. It
    /// exists because both together may take less time than one after the other.
    fn clipped_halves(
        &self,
        shape: &Self::Shape,
        cell: &Aabb,
        axis: Axis,
        position: f32,
    ) -> [Option<Aabb>; 2] {
        let (lower, upper) = cell.split(axis, position);
        [lower, upper].map(|part| self.clipped_bounds(shape, &part))
    }
}

impl PrimSource for Mesh {
    /// The corners.
    type Shape = [Vec3; 3];

    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has at most MAX_TRIANGLES"
    )]
    fn count(&self) -> u32 {
        self.len() as u32
    }

    #[inline]
    fn bounds(&self, primitive: u32) -> Aabb {
        Aabb::around(self.corners(primitive))
    }

    #[inline]
    fn shape(&self, primitive: u32) -> [Vec3; 3] {
        self.corners(primitive)
    }

    #[inline]
    fn clipped_bounds(&self, corners: &[Vec3; 3], cell: &Aabb) -> Option<Aabb> {
        clipped_bounds(*corners, cell)
    }

    #[inline]
    fn clipped_halves(
        &self,
        corners: &[Vec3; 3],
        cell: &Aabb,
        axis: Axis,
        position: f32,
    ) -> [Option<Aabb>; 2] {
        clipped_halves(*corners, cell, axis, position)
    }
}
