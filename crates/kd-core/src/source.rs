//! The view that builders have of primitives.

use glam::Vec3;

use crate::{Aabb, Axis, Mesh, clipped_bounds, clipped_halves};

/// A list of primitives: their number, their boxes, and the bounds of a primitive clipped to a cell.
///
/// [`Mesh`] implements it for triangles. Implement it to build trees over other primitives.
pub trait PrimSource: Sync {
    /// The data of one primitive that clipping needs.
    type Shape: Copy;

    /// The number of primitives, at most [`MAX_TRIANGLES`](crate::MAX_TRIANGLES).
    fn count(&self) -> u32;

    /// The box around a primitive, closed and finite. It may be flat or a point, but not empty.
    ///
    /// `primitive` is below [`count`](Self::count).
    fn bounds(&self, primitive: u32) -> Aabb;

    /// The shape of a primitive. `primitive` is below [`count`](Self::count).
    ///
    /// Fetching is separate from clipping, so that a builder can load several shapes from memory before it clips the
    /// first.
    fn shape(&self, primitive: u32) -> Self::Shape;

    /// A box inside `cell` around the intersection of the primitive with `cell`; `None` if they do not meet.
    ///
    /// The box must hold every point of the primitive in the cell, up to rounding. It may be larger than needed. `cell`
    /// is infinite towards sides that the primitive is known not to cross.
    fn clipped_bounds(&self, shape: &Self::Shape, cell: &Aabb) -> Option<Aabb>;

    /// [`clipped_bounds`](Self::clipped_bounds) for both children of a cell that is split at `position` along `axis`, the
    /// lower child first. Implementations may be faster than two separate calls.
    fn clipped_halves(
        &self,
        shape: &Self::Shape,
        cell: &Aabb,
        axis: Axis,
        position: f32,
    ) -> [Option<Aabb>; 2] {
        let (lower, upper) = cell.split(axis, position);
        [lower, upper].map(|child| self.clipped_bounds(shape, &child))
    }
}

impl PrimSource for Mesh {
    /// The corners of a triangle.
    type Shape = [Vec3; 3];

    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has at most MAX_TRIANGLES triangles"
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
