//! Sizes that rays which are traced together must have. Others are traced one by one.

use crate::planes::Frame;

/// Of directions: within these no depth underflows or overflows.
pub(super) const LEAST_DIRECTION: f32 = 1.0 / (1 << 20) as f32;
pub(super) const MOST_DIRECTION: f32 = (1 << 20) as f32;
/// Of coordinates, so that products of three differences do not overflow.
pub(super) const MOST_COORDINATE: f32 = (1_u64 << 36) as f32;

/// Whether rays through a tree can be traced together at all.
pub(super) fn fits(frame: &Frame) -> bool {
    let corners = frame.corners.as_flattened();
    corners.iter().all(|x| x.abs() <= MOST_COORDINATE)
}
