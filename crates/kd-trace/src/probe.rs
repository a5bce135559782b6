//! Observes the steps of a traversal.

/// Receives every step of a traversal. `()` ignores them, at no cost.
pub trait Probe {
    /// An interior node was visited.
    fn node(&mut self) {}
    /// A leaf was visited. `triangles` counts its triangles, which only some probes need.
    #[inline(always)]
    fn leaf(&mut self, _triangles: impl FnOnce() -> u32) {}
    /// A block of triangles is tested.
    fn block(&mut self) {}
    /// A triangle was not rejected in f32, and is decided in f64.
    fn decision(&mut self) {}
    /// A ray is compared with a box. (Nodes of kd-trees have none.)
    fn ray_box(&mut self) {}
    /// A packet is compared with a box, as a whole.
    fn packet_box(&mut self) {}
}

impl Probe for () {}
