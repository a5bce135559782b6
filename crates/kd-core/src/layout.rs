//! The layouts that rays traverse, by name, and their size.

/// Which copy of a tree and its triangles rays traverse. Answers do not depend on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Layout {
    /// The 8-byte nodes of the kd-tree over blocks of eight triangles: follows every plane that the builder chose. The
    /// least memory for nodes, the shortest time to lay out, and the reference for [`Wide`](Self::Wide).
    Binary,
    /// Nodes of eight children with their boxes, all tested at once: 256 bytes a node over blocks of eight triangles. Traces
    /// in about half the time of [`Binary`](Self::Binary). The default.
    #[default]
    Wide,
}

/// Bytes of a layout: everything that rays may read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LayoutBytes {
    /// Bytes of nodes.
    pub nodes: usize,
    /// Bytes of blocks of triangles.
    pub blocks: usize,
}

impl LayoutBytes {
    /// Nodes and blocks together.
    pub const fn total(&self) -> usize {
        self.nodes + self.blocks
    }
}

impl std::ops::Add for LayoutBytes {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            nodes: self.nodes + other.nodes,
            blocks: self.blocks + other.blocks,
        }
    }
}

impl std::iter::Sum for LayoutBytes {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), std::ops::Add::add)
    }
}
