//! What rays cost, counted.

/// Told about every step of a traversal. `()` does not listen, and costs nothing.
pub(crate) trait Probe {
    /// A ray is compared with a box.
    fn ray_box(&mut self) {}
    /// A packet is compared with a box, as a whole.
    fn packet_box(&mut self) {}
    /// A ray is compared with so many triangles.
    fn triangles(&mut self, _count: u32) {}
}

impl Probe for () {}

/// What rays cost. To compare hierarchies, and ways to trace them, without a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BvhCounts {
    /// Boxes that single rays were compared with.
    pub ray_boxes: u64,
    /// Boxes that whole packets were compared with, in twice as many multiplications as for a ray.
    pub packet_boxes: u64,
    /// Triangles that rays were compared with.
    pub triangles: u64,
}

impl Probe for BvhCounts {
    fn ray_box(&mut self) {
        self.ray_boxes += 1;
    }

    fn packet_box(&mut self) {
        self.packet_boxes += 1;
    }

    fn triangles(&mut self, count: u32) {
        self.triangles += u64::from(count);
    }
}
