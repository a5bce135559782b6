//! The box that a ray's error bound is made for.

use kd_core::Aabb;

/// 2⁻²⁴, of the longest side.
const PER_SIDE: f32 = 1.0 / (1 << 24) as f32;
/// 2⁻⁴⁶, of distances and coordinates.
pub const PER_REACH: f32 = 1.0 / (1_u64 << 46) as f32;
/// 2³⁶, the largest coordinate of a usual ray and of the box around its tree. Up to it no product of three distances overflows, and
/// no distance over a direction of 2⁻⁹⁰.
pub const MOST_USUAL: f32 = (1_u64 << 36) as f32;

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
    /// The largest coordinate of an origin that is usual for this box; -1 if no origin is.
    pub usual_origin: f32,
    /// `distance`, and the part of the bound that depends on the distance of the origin, for the most distant usual one.
    pub usual_distance: f32,
}

impl Frame {
    /// The same box with a wider bound, by a distance in scene units.
    #[must_use]
    #[inline(always)]
    pub fn wider_by(&self, distance: f32) -> Self {
        Self {
            distance: self.distance + distance,
            usual_distance: self.usual_distance + distance,
            ..*self
        }
    }

    /// The frame of everything within a box.
    #[inline(always)]
    pub fn new(bounds: &Aabb) -> Self {
        let side = bounds.extent().max_element();
        let coordinate = bounds.min.abs().max(bounds.max.abs()).max_element();
        let distance = PER_SIDE * side + PER_REACH * coordinate + f32::MIN_POSITIVE;
        // So far away that the bound of the most distant one is at most 2^-24 of the side larger.
        let usual_origin = ((1 << 22) as f32 * side + 2.0 * coordinate).min(MOST_USUAL);
        Self {
            corners: [bounds.min, bounds.max].map(|corner| corner.extend(0.0).to_array()),
            distance,
            usual_origin: if coordinate <= MOST_USUAL {
                usual_origin
            } else {
                -1.0
            },
            usual_distance: distance + PER_REACH * (usual_origin + coordinate),
        }
    }
}
