//! What a structure looks like, as numbers.

/// Counts and bytes of a structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Stats {
    /// Divided cells and leaves. Empty cells are not stored and do not count.
    pub nodes: usize,
    /// Leaves among them, none of them empty.
    pub leaves: usize,
    /// References to triangles in leaves and, in a BSP tree, at planes. A triangle in several counts several times.
    pub references: usize,
    /// Divisions above the deepest leaf or list at a plane.
    pub depth: usize,
    /// Leaves of more triangles than a small one: a limit of depth or of references kept them from being divided, or no
    /// division would have helped.
    pub large_leaves: usize,
    /// Bytes of nodes and references, without the mesh.
    pub bytes: usize,
}
