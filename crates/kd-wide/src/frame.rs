//! The box that a ray's error bound is made for.

use kd_core::Aabb;

/// 2⁻²³, of the longest side.
const PER_SIDE: f32 = 1.0 / (1 << 23) as f32;
/// 2⁻⁴⁶, of distances and coordinates.
pub const PER_REACH: f32 = 1.0 / (1_u64 << 46) as f32;

/// The box around all triangles of a tree, and the part of the error bound between planes and hits that depends on the box
/// alone. The same for all rays through a tree.
///
/// The bound is derived in `planes.rs` of `kd-trace`.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// The lowest and the highest corner of the box. The fourth number is 0, so that four can be loaded at a time.
    pub corners: [[f32; 4]; 2],
    /// The part of the bound that no ray changes, in scene units.
    pub distance: f32,
}

impl Frame {
    /// The frame of everything within a box.
    #[inline(always)]
    pub fn new(bounds: &Aabb) -> Self {
        let side = bounds.extent().max_element();
        let coordinate = bounds.min.abs().max(bounds.max.abs()).max_element();
        Self {
            corners: [bounds.min, bounds.max].map(|corner| corner.extend(0.0).to_array()),
            distance: PER_SIDE * side + PER_REACH * coordinate + f32::MIN_POSITIVE,
        }
    }
}
