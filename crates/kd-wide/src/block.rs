//! A block: up to eight triangles of a leaf, lane by lane.
//!
//! ```text
//! block       9 x 8 f32   corner a: x of 8 triangles, y, z; corner b; corner c
//!             8 x u32     their numbers
//! ```
//! In a tree over boxes, corner a is the lowest of an item's box, and corners b and c are the highest.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use kd_core::{Aabb, Mesh, is_zero_area};
use kd_simd::LANES;

/// Coordinates of eight triangles: by corner, then by axis, then by lane, so that the axes of a ray are offsets.
pub type LaneCorners = [[[f32; LANES]; 3]; 3];

/// The coordinates of a lane without a triangle, and of a triangle of zero area: NaN, which no ray hits and no box contains.
const NO_TRIANGLE: f32 = f32::from_bits(0x7fc0_0000);
const NO_AREA: f32 = f32::from_bits(0x7fc0_0001);
const _: () = assert!(NO_TRIANGLE.is_nan() && NO_AREA.is_nan(), "no ray hits them");

/// Up to eight triangles of a leaf, in lanes. Five cache lines.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Block {
    /// Corners, in scene units; NaN in lanes without a triangle, and in those of triangles of zero area.
    pub corners: LaneCorners,
    /// Slots, of any value; meaningless in lanes without a triangle.
    pub triangles: [u32; LANES],
}

const _: () = assert!(size_of::<Block>() == 320, "five cache lines");

impl Block {
    /// No triangles. No ray hits corners that are NaN.
    pub const EMPTY: Self = Self {
        corners: [[[NO_TRIANGLE; LANES]; 3]; 3],
        triangles: [u32::MAX; LANES],
    };

    /// The block of up to eight triangles of a mesh, which get the first lanes.
    ///
    /// # Panics
    ///
    /// If there are more, or if the mesh lacks one.
    pub fn of(triangles: impl IntoIterator<Item = u32>, mesh: &Mesh) -> Self {
        let mut block = Self::EMPTY;
        for (lane, triangle) in triangles.into_iter().enumerate() {
            block.set(lane, triangle, mesh.corners(triangle));
        }
        block
    }

    /// [`of`](Self::of) for triangles that are known to have an area.
    pub(crate) fn with_area(triangles: &[u32], mesh: &Mesh) -> Self {
        let mut block = Self::EMPTY;
        for (lane, triangle) in triangles.iter().enumerate() {
            block.write_corners(lane, mesh.corners(*triangle));
            block.triangles[lane] = *triangle;
        }
        block
    }

    /// The block of up to eight items of a tree over boxes, which get the first lanes. No coordinate of theirs is NaN.
    pub(crate) fn of_boxes(items: &[u32], boxes: &[Aabb]) -> Self {
        let mut block = Self::EMPTY;
        for (lane, item) in items.iter().enumerate() {
            let Aabb { min, max } = boxes[*item as usize];
            block.write_corners(lane, [min, max, max]);
            block.triangles[lane] = *item;
        }
        block
    }

    /// The number of triangles. They fill the lanes in order.
    #[inline(always)]
    pub fn count(&self) -> u32 {
        // Not by slots: a slot may have any value.
        let some_coordinate = &self.corners[0][0];
        let is_used = |x: &f32| u32::from(x.to_bits() != NO_TRIANGLE.to_bits());
        some_coordinate.iter().map(is_used).sum()
    }

    /// The slots of its triangles, to renumber.
    pub(crate) fn slots_mut(&mut self) -> &mut [u32] {
        let count = self.count() as usize;
        &mut self.triangles[..count]
    }

    /// Puts a triangle in a lane. No coordinate is NaN: those of a [`Mesh`] are finite. A triangle of zero area keeps the lane, and
    /// has no corners there, so that it is not hit and not in a box.
    ///
    /// # Panics
    ///
    /// If `lane` is 8 or more.
    pub fn set(&mut self, lane: usize, triangle: u32, corners: [Vec3; 3]) {
        self.set_corners(lane, corners);
        self.triangles[lane] = triangle;
    }

    #[inline(always)]
    fn set_corners(&mut self, lane: usize, corners: [Vec3; 3]) {
        if is_zero_area(corners) {
            self.write_corners(lane, [Vec3::splat(NO_AREA); 3]);
        } else {
            self.write_corners(lane, corners);
        }
    }

    #[inline(always)]
    fn write_corners(&mut self, lane: usize, corners: [Vec3; 3]) {
        for (rows, corner) in self.corners.iter_mut().zip(corners) {
            for (row, coordinate) in rows.iter_mut().zip(corner.to_array()) {
                row[lane] = coordinate;
            }
        }
    }

    /// Gives its triangles, numbered from `first_slot` on modulo 2³², the corners that they have in `mesh`.
    pub(crate) fn move_corners(&mut self, mesh: &Mesh, first_slot: u32) {
        for lane in 0..self.count() as usize {
            let triangle = self.triangles[lane].wrapping_sub(first_slot);
            self.set_corners(lane, mesh.corners(triangle));
        }
    }

    /// The box around all triangles.
    pub(crate) fn bounds(&self) -> Aabb {
        // Not `f32::min`: this order of operands is one instruction, and skips NaN.
        let pick = |is_better: fn(f32, f32) -> bool, worst: f32, axis: usize| {
            let mut best = [worst; LANES];
            for rows in &self.corners {
                for (best, x) in best.iter_mut().zip(rows[axis]) {
                    *best = if is_better(x, *best) { x } else { *best };
                }
            }
            let better = |a: f32, b: f32| if is_better(a, b) { a } else { b };
            best.into_iter().fold(worst, better)
        };
        let min = |axis| pick(|a, b| a < b, f32::INFINITY, axis);
        let max = |axis| pick(|a, b| a > b, f32::NEG_INFINITY, axis);
        Aabb {
            min: Vec3::new(min(0), min(1), min(2)),
            max: Vec3::new(max(0), max(1), max(2)),
        }
    }

    /// The corners of the triangle in a lane.
    #[inline(always)]
    pub fn corners_of(&self, lane: usize) -> [Vec3; 3] {
        self.corners
            .each_ref()
            .map(|rows| Vec3::from_array(rows.each_ref().map(|row| row[lane])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slots_do_not_say_whether_there_is_a_triangle() {
        let corners = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]];
        let mesh = Mesh::new(corners.to_vec(), vec![[0, 1, 2]; 3]).expect("valid");
        for first in [0, u32::MAX, u32::MAX - 1, u32::MAX - 2, u32::MAX - 3] {
            let mut block = Block::of(0..3, &mesh);
            for slot in block.slots_mut() {
                *slot = slot.wrapping_add(first);
            }
            assert_eq!(block.count(), 3, "from {first}");
            let slots = [0, 1, 2].map(|triangle: u32| first.wrapping_add(triangle));
            assert_eq!(block.slots_mut(), slots, "from {first}");
            let moved = corners.map(|[x, y, z]| [x, y, z + 1.0]);
            let moved = mesh.with_positions(moved.to_vec()).expect("finite");
            block.move_corners(&moved, first);
            for lane in 0..3 {
                let corners = block.corners_of(lane);
                assert_eq!(corners, moved.corners(0), "lane {lane}, from {first}");
            }
        }
        assert_eq!(Block::EMPTY.count(), 0, "no triangles");
    }
}
