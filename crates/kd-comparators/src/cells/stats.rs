//! Statistics of an octree or a BSP tree.

/// Counts and bytes of an octree or a BSP tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CellStats {
    /// Divided cells and leaves. Empty cells are not stored and do not count.
    pub nodes: usize,
    /// Leaves among them, none of them empty.
    pub leaves: usize,
    /// References to triangles in leaves and, in a BSP tree, at planes. A triangle in several counts several times.
    pub references: usize,
    /// Divisions above the deepest leaf or list at a plane.
    pub depth: usize,
    /// Leaves of more triangles than [`with_small_leaf`](crate::CellOptions::with_small_leaf): a limit of depth or references
    /// was reached, or no division separates their triangles.
    pub large_leaves: usize,
    /// Bytes of nodes and references, without the mesh.
    pub bytes: usize,
}
