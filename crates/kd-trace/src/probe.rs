//! Counting what a traversal does, where somebody wants to know.

/// Told about every step of a traversal. `()` does not listen, and costs nothing.
pub(crate) trait Probe {
    /// An interior node was visited.
    fn node(&mut self) {}
    /// A leaf was visited, so many triangles are looked at.
    fn leaf(&mut self, _triangles: u32) {}
    /// A block of triangles is looked at at once.
    fn block(&mut self) {}
    /// A triangle was not rejected early.
    fn decision(&mut self) {}
}

impl Probe for () {}
