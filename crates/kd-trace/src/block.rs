//! Triangles of a leaf side by side, ready for vector instructions.
//!
//! ```text
//! block       9 x 8 f32   corner a: x of 8 triangles, y, z; corner b; corner c
//!             8 x u32     their numbers
//! ```

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use kd_core::Mesh;

use crate::lanes::LANES;
use crate::triangle::LaneCorners;

/// Up to eight triangles of a leaf. Five cache lines.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Block {
    pub(crate) corners: LaneCorners,
    /// [`NONE`](Self::NONE) in lanes without a triangle.
    pub(crate) triangles: [u32; LANES],
}

const _: () = assert!(size_of::<Block>() == 320, "five cache lines");

impl Block {
    /// Stands where there is no triangle.
    pub(crate) const NONE: u32 = u32::MAX;

    /// No triangles: whatever looks at a corner that is NaN finds no hit.
    pub(crate) const EMPTY: Self = Self {
        corners: [[[f32::NAN; LANES]; 3]; 3],
        triangles: [Self::NONE; LANES],
    };

    /// The block of up to eight triangles of a mesh.
    pub(crate) fn of(triangles: impl IntoIterator<Item = u32>, mesh: &Mesh) -> Self {
        let mut block = Self::EMPTY;
        for (lane, triangle) in triangles.into_iter().enumerate() {
            block.set(lane, triangle, mesh);
        }
        block
    }

    /// How many triangles there are; they fill the lanes in order.
    #[inline(always)]
    pub(crate) fn count(&self) -> u32 {
        self.triangles
            .iter()
            .map(|triangle| u32::from(*triangle != Self::NONE))
            .sum()
    }

    fn set(&mut self, lane: usize, triangle: u32, mesh: &Mesh) {
        for (rows, corner) in self.corners.iter_mut().zip(mesh.corners(triangle)) {
            for (row, coordinate) in rows.iter_mut().zip(corner.to_array()) {
                row[lane] = coordinate;
            }
        }
        self.triangles[lane] = triangle;
    }

    #[inline(always)]
    pub(crate) fn corners_of(&self, lane: usize) -> [Vec3; 3] {
        self.corners
            .each_ref()
            .map(|rows| Vec3::from_array(rows.each_ref().map(|row| row[lane])))
    }
}
