//! The layouts that rays traverse, by name, their size, and what may be wrong with one from a file.

use thiserror::Error;

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

/// The reason why nodes and blocks from elsewhere are not a layout of a mesh.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum LayoutError {
    /// A child is not among the nodes and blocks.
    #[error("node {node}, child {lane}: not in the layout")]
    MissingChild {
        /// The index of the node.
        node: usize,
        /// The lane of the child.
        lane: usize,
    },
    /// A child is stored before its parent, which could form a cycle.
    #[error("node {node}, child {lane}: not stored behind the node")]
    ChildNotBehind {
        /// The index of the node.
        node: usize,
        /// The lane of the child.
        lane: usize,
    },
    /// A child has two parents.
    #[error("node {node}, child {lane}: has another parent")]
    SharedChild {
        /// The index of the second parent.
        node: usize,
        /// The lane of the child.
        lane: usize,
    },
    /// The root is not among the nodes and blocks.
    #[error("the root is not in the layout")]
    MissingRoot,
    /// An order of children names a child twice.
    #[error("node {node}: octant {octant} does not order all children")]
    BadOrder {
        /// The index of the node.
        node: usize,
        /// The octant of directions.
        octant: usize,
    },
    /// More levels of nodes than a ray's stack is made for.
    #[error("{levels} levels of nodes, at most {most} are valid")]
    TooDeep {
        /// The number of levels.
        levels: usize,
        /// The greatest valid number.
        most: usize,
    },
    /// A lane of a block has not the corners of the triangle whose number it has, or comes behind an empty lane.
    #[error("block {block}, lane {lane}: not a triangle of the mesh")]
    BadTriangle {
        /// The index of the block.
        block: usize,
        /// The lane.
        lane: usize,
    },
    /// A node differs from that of the kd-tree.
    #[error("node {node}: not that of the kd-tree")]
    BadNode {
        /// The index of the node.
        node: usize,
    },
    /// There are more or fewer blocks than the leaves refer to.
    #[error("{blocks} blocks, the leaves refer to {expected}")]
    BlockCount {
        /// The number of blocks.
        blocks: usize,
        /// The number that leaves refer to.
        expected: usize,
    },
}
