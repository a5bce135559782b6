//! Limits of directions and coordinates of rays that are traced together. Rays beyond them are traced one by one.

use crate::planes::Frame;

/// Largest component of a direction: within these limits no depth underflows or overflows.
pub(super) const LEAST_DIRECTION: f32 = 1.0 / (1 << 20) as f32;
pub(super) const MOST_DIRECTION: f32 = (1 << 20) as f32;
/// Coordinates: within this limit no product of three differences overflows.
pub(super) use kd_wide::MOST_USUAL as MOST_COORDINATE;

/// Whether the coordinates of a tree are within the limit.
pub(super) fn fits(frame: &Frame) -> bool {
    let corners = frame.corners.as_flattened();
    corners.iter().all(|x| x.abs() <= MOST_COORDINATE)
}
