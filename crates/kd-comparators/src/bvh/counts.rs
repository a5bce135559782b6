//! The cost of rays, as counts.

use kd_trace::kit::Probe;

/// The cost of rays. Compares hierarchies, and single rays with packets, without a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BvhCounts {
    /// Boxes compared with single rays.
    pub ray_boxes: u64,
    /// Boxes compared with whole packets. Each takes twice as many multiplications as for a ray.
    pub packet_boxes: u64,
    /// Triangles compared with rays.
    pub triangles: u64,
}

impl Probe for BvhCounts {
    fn leaf(&mut self, triangles: impl FnOnce() -> u32) {
        self.triangles += u64::from(triangles());
    }

    fn ray_box(&mut self) {
        self.ray_boxes += 1;
    }

    fn packet_box(&mut self) {
        self.packet_boxes += 1;
    }
}
