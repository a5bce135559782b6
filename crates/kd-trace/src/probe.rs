//! Counting the steps of a traversal.

/// Receives every step of a traversal. `()` ignores them, and costs nothing.
pub trait Probe {
    /// An interior node is visited.
    fn node(&mut self) {}
    /// A leaf is visited, and `triangles` triangles are tested.
    fn leaf(&mut self, _triangles: u32) {}
    /// A block of triangles is tested at once.
    fn block(&mut self) {}
    /// A triangle is not rejected early.
    fn decision(&mut self) {}
    /// A ray is compared with a box. (Nodes of kd-trees have none.)
    fn ray_box(&mut self) {}
    /// A packet is compared with a box, as a whole.
    fn packet_box(&mut self) {}
}

impl Probe for () {}
