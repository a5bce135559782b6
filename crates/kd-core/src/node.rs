//! The 8-byte node.
//!
//! ```text
//!             word 0 (u32)            word 1 (u32)
//! interior    split, f32 bits         index of first child << 2 | axis 0, 1, 2
//! leaf        index of first ref      number of refs << 2 | 3
//! ```
//! The two children of a node are adjacent, at `first` and `first + 1`. The index is absolute in the arena, so that
//! copying one node links a whole subtree into another tree. (After Shi 2011, listing 2.1, with two tag bits and children
//! in pairs.)

use bytemuck::{Pod, Zeroable};

use crate::{Axis, NodeIndex};

const LEAF: u32 = 3;
const TAG_BITS: u32 = 2;
/// The first value that does not fit beside the tag.
const PAYLOAD_LIMIT: u32 = 1 << (32 - TAG_BITS);

/// One node of a tree, packed into 8 bytes; [`view`](Self::view) unpacks it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Node {
    word0: u32,
    word1: u32,
}

const _: () = assert!(size_of::<Node>() == 8, "eight nodes to a cache line");

/// Two sibling nodes, aligned so that they never straddle a cache line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct Pair(pub [Node; 2]);

const _: () = assert!(
    size_of::<Pair>() == 16 && align_of::<Pair>() == 16,
    "a pair fills its alignment"
);

/// A node in unpacked form, as an enum to match on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NodeView {
    /// A plane and two children.
    Interior {
        /// The axis perpendicular to the plane.
        axis: Axis,
        /// The coordinate of the plane on that axis, in scene units.
        split: f32,
        /// The lower child; the upper one is its [`sibling`](NodeIndex::sibling).
        first: NodeIndex,
    },
    /// A range of the arena's references.
    Leaf {
        /// The index of the first reference.
        first: u32,
        /// The number of references, possibly 0.
        count: u32,
    },
}

impl Node {
    /// A leaf without references.
    pub const EMPTY_LEAF: Self = Self {
        word0: 0,
        word1: LEAF,
    };

    /// An interior node; `None` if the index does not fit into 30 bits.
    #[inline]
    pub const fn interior(axis: Axis, split: f32, first: NodeIndex) -> Option<Self> {
        if first.0 >= PAYLOAD_LIMIT {
            return None;
        }
        Some(Self {
            word0: split.to_bits(),
            word1: first.0 << TAG_BITS | axis as u32,
        })
    }

    /// A leaf over `count` references starting at index `first`; `None` if the count does not fit into 30 bits.
    #[inline]
    pub const fn leaf(first: u32, count: u32) -> Option<Self> {
        if count >= PAYLOAD_LIMIT {
            return None;
        }
        Some(Self {
            word0: first,
            word1: count << TAG_BITS | LEAF,
        })
    }

    /// The node in unpacked form.
    #[inline]
    pub const fn view(self) -> NodeView {
        match self.word1 & LEAF {
            LEAF => NodeView::Leaf {
                first: self.word0,
                count: self.count(),
            },
            axis => NodeView::Interior {
                axis: match axis {
                    0 => Axis::X,
                    1 => Axis::Y,
                    _ => Axis::Z,
                },
                split: self.split(),
                first: self.first_child(),
            },
        }
    }

    /// Whether the node is a leaf.
    #[inline]
    pub const fn is_leaf(self) -> bool {
        self.word1 & LEAF == LEAF
    }

    /// The coordinate of the plane, in scene units; meaningless for a leaf.
    #[inline]
    pub const fn split(self) -> f32 {
        f32::from_bits(self.word0)
    }

    /// The tag: the axis (0, 1 or 2) of an interior node, 3 for a leaf.
    #[inline]
    pub const fn tag(self) -> usize {
        (self.word1 & LEAF) as usize
    }

    /// The index of the lower child; meaningless for a leaf.
    #[inline]
    pub const fn first_child(self) -> NodeIndex {
        NodeIndex(self.word1 >> TAG_BITS)
    }

    /// The index of the first reference; meaningless for an interior node.
    #[inline]
    pub const fn first_ref(self) -> u32 {
        self.word0
    }

    /// The number of references; meaningless for an interior node.
    #[inline]
    pub const fn count(self) -> u32 {
        self.word1 >> TAG_BITS
    }

    /// The node for an arena in which its children have moved by `nodes` and its references by `refs` towards the end;
    /// `None` if the new index does not fit.
    #[inline]
    pub const fn relocated(self, nodes: u32, refs: u32) -> Option<Self> {
        if self.is_leaf() {
            return match self.word0.checked_add(refs) {
                Some(word0) => Some(Self { word0, ..self }),
                None => None,
            };
        }
        let first = self.first_child().0 as u64 + nodes as u64;
        if first >= PAYLOAD_LIMIT as u64 {
            return None;
        }
        Some(Self {
            word1: self.word1 + (nodes << TAG_BITS),
            ..self
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn interior_nodes_survive_packing(axis in 0_usize..3, split: f32, first in 0_u32..PAYLOAD_LIMIT) {
            let axis = Axis::ALL[axis];
            let node = Node::interior(axis, split, NodeIndex(first)).expect("30 bits");
            prop_assert!(!node.is_leaf());
            prop_assert_eq!(node.tag(), axis.index());
            prop_assert_eq!(node.split().to_bits(), split.to_bits());
            prop_assert_eq!(node.first_child(), NodeIndex(first));
            match node.view() {
                NodeView::Interior { axis: a, split: s, first: f } => {
                    prop_assert_eq!((a, s.to_bits(), f), (axis, split.to_bits(), NodeIndex(first)));
                }
                NodeView::Leaf { .. } => prop_assert!(false, "an interior node"),
            }
        }

        #[test]
        fn leaves_survive_packing(first: u32, count in 0_u32..PAYLOAD_LIMIT) {
            let node = Node::leaf(first, count).expect("30 bits");
            prop_assert!(node.is_leaf());
            prop_assert_eq!((node.first_ref(), node.count()), (first, count));
            prop_assert_eq!(node.view(), NodeView::Leaf { first, count });
        }

        #[test]
        fn relocation_shifts_children_and_references(first in 0_u32..1 << 29, nodes in 0_u32..1 << 29, refs in 0_u32..1 << 29) {
            let interior = Node::interior(Axis::Z, 1.5, NodeIndex(first)).expect("30 bits");
            prop_assert_eq!(
                interior.relocated(nodes, refs),
                Node::interior(Axis::Z, 1.5, NodeIndex(first + nodes))
            );
            let leaf = Node::leaf(first, 7).expect("30 bits");
            prop_assert_eq!(leaf.relocated(nodes, refs), Node::leaf(first + refs, 7));
        }
    }

    #[test]
    fn values_beyond_30_bits_are_refused() {
        assert_eq!(
            Node::interior(Axis::X, 0.0, NodeIndex(PAYLOAD_LIMIT)),
            None,
            "31 bits of index"
        );
        assert_eq!(Node::leaf(0, PAYLOAD_LIMIT), None, "31 bits of count");
        let last =
            Node::interior(Axis::X, 0.0, NodeIndex(PAYLOAD_LIMIT - 2)).expect("the last pair");
        assert_eq!(last.relocated(2, 0), None, "children past the limit");
        let leaf = Node::leaf(u32::MAX, 1).expect("any first index fits");
        assert_eq!(leaf.relocated(0, 1), None, "references past the limit");
    }
}
