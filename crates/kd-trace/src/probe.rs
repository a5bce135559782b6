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

/// What one ray cost. For heat maps, and to compare trees without a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TraversalCounts {
    /// Interior nodes visited.
    pub nodes: u32,
    /// Leaves visited, empty ones included.
    pub leaves: u32,
    /// Triangles looked at, the same one in several leaves counting anew.
    pub triangles: u32,
    /// Blocks of up to eight triangles looked at together; 0 where triangles are looked at one by one.
    pub blocks: u32,
    /// Triangles among them that the quick test in f32 did not reject.
    pub decisions: u32,
}

impl Probe for TraversalCounts {
    fn node(&mut self) {
        self.nodes += 1;
    }

    fn leaf(&mut self, triangles: u32) {
        self.leaves += 1;
        self.triangles += triangles;
    }

    fn block(&mut self) {
        self.blocks += 1;
    }

    fn decision(&mut self) {
        self.decisions += 1;
    }
}
