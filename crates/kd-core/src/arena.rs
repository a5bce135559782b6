//! Storage of nodes and references: one append-only array of each, in segments.
//!
//! A child is stored either behind its parent in the fresh range or in a frozen segment, so cycles are impossible. Freezing
//! checks the fresh range only, since the arena stores the height of each frozen node.

use bytemuck::cast_slice;
use thiserror::Error;

use crate::{Node, NodeIndex, Pair, Slot, Tree};

/// The greatest number of interior nodes between a root and a leaf. Builders stay below it, freezing checks it, and
/// traversals size their stacks for it.
pub const MAX_DEPTH: usize = 64;

/// The reason why nodes and references do not form a valid tree.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TreeError {
    /// The list of nodes is empty. An empty tree has one node, an empty leaf.
    #[error("the tree has no root node")]
    NoRoot,
    /// The plane of an interior node is NaN or infinite.
    #[error("node {node}: its split is not finite")]
    SplitNotFinite {
        /// The index of the node.
        node: NodeIndex,
    },
    /// A child index is not the index of the first node of a pair in the arena.
    #[error("node {node}: child {child} is not the start of a pair of the arena")]
    BadChild {
        /// The index of the node.
        node: NodeIndex,
        /// The child index that the node holds.
        child: NodeIndex,
    },
    /// A child is stored before its parent in the fresh range, which could form a cycle.
    #[error("node {node}: child {child} is not stored behind it")]
    ChildNotBehind {
        /// The index of the node.
        node: NodeIndex,
        /// The index of its lower child.
        child: NodeIndex,
    },
    /// The references of a leaf reach past the end of the arena.
    #[error("leaf {node}: references {first} + {count} are out of range, the arena has {refs}")]
    RefsOutOfRange {
        /// The index of the leaf.
        node: NodeIndex,
        /// The index of its first reference.
        first: u32,
        /// The number of its references.
        count: u32,
        /// The number of references of the arena.
        refs: usize,
    },
    /// A reference holds the number of a triangle that does not exist.
    #[error("reference {index}: triangle {slot} is out of range, there are {slots} triangles")]
    SlotOutOfRange {
        /// The index of the reference in the arena.
        index: usize,
        /// The number of the triangle.
        slot: Slot,
        /// The number of triangles.
        slots: u32,
    },
    /// More than [`MAX_DEPTH`] interior nodes above some leaf.
    #[error("node {node}: more than {MAX_DEPTH} levels below it")]
    TooDeep {
        /// The index of a node with more levels below it.
        node: NodeIndex,
    },
    /// Two nodes have the same children, in a tree where each node must have one parent.
    #[error("node {node}: its children {child} already have another parent")]
    SharedChild {
        /// The index of the second parent.
        node: NodeIndex,
        /// The index of the lower child.
        child: NodeIndex,
    },
    /// The leaves have more references in total than the tree, so some leaves share references. Each must have its own.
    #[error("the leaves have {used} references in total, the tree has only {refs}")]
    SharedRefs {
        /// The sum over all leaves.
        used: u64,
        /// The number of references of the tree.
        refs: usize,
    },
    /// The number of triangles is below that of an earlier frozen segment.
    #[error("{slots} triangles are fewer than the {frozen} of the frozen segments")]
    FewerSlots {
        /// The number of triangles given.
        slots: u32,
        /// The number of triangles of the frozen segments.
        frozen: u32,
    },
    /// The root is not a frozen node.
    #[error("root {node} is not a frozen node")]
    BadRoot {
        /// The index of the root.
        node: NodeIndex,
    },
    /// The transform does more than translate and scale along the axes.
    #[error(
        "the transform rotates or shears: split planes would not stay perpendicular to an axis"
    )]
    NotAlongAxes,
    /// The box is neither finite nor empty.
    #[error("the bounds are not finite")]
    BadBounds,
    /// A field of the cost model is out of range.
    #[error("`{field}` must be {rule}")]
    BadCost {
        /// The name of the field, such as `cost.traverse`.
        field: &'static str,
        /// The valid range, such as `positive and finite`.
        rule: &'static str,
    },
    /// Nodes are indexed with 30 bits, references with 32 bits.
    #[error(
        "{nodes} nodes and {refs} references are too many, indices have 30 bits for nodes and 32 for references"
    )]
    TooLarge {
        /// The number of nodes that the tree would have.
        nodes: usize,
        /// The number of references that the tree would have.
        refs: usize,
    },
}

/// Nodes and references of one or more trees.
///
/// A **frozen** segment has been validated and never changes. Nodes of later segments may link to its subtrees. The
/// **fresh** range behind the last frozen segment is being written.
#[derive(Clone, Debug, Default)]
pub struct Arena {
    pairs: Vec<Pair>,
    refs: Vec<Slot>,
    /// The number of levels below each frozen node; 0 for a leaf.
    heights: Vec<u8>,
    /// The end of each frozen segment.
    segments: Vec<SegmentEnd>,
}

/// The end of a segment: the numbers of pairs and references up to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct SegmentEnd {
    pairs: usize,
    refs: usize,
    /// References of this segment and of those before it are below this number.
    slots: u32,
}

/// The number of pairs that 30 bits can index.
const MAX_PAIRS: usize = 1 << 29;

impl Arena {
    /// An empty arena.
    pub fn new() -> Self {
        Self::default()
    }

    /// An arena of a builder's pairs and references, with indices from 0, all fresh. Nothing is copied.
    pub(crate) fn from_vecs(pairs: Vec<Pair>, refs: Vec<Slot>) -> Result<Self, TreeError> {
        if pairs.len() > MAX_PAIRS || u32::try_from(refs.len()).is_err() {
            return Err(TreeError::TooLarge {
                nodes: 2 * pairs.len(),
                refs: refs.len(),
            });
        }
        Ok(Self {
            pairs,
            refs,
            ..Self::default()
        })
    }

    /// The number of triangles that frozen segments may refer to.
    pub(crate) fn slots(&self) -> u32 {
        self.frozen().slots
    }

    /// All nodes, two per pair, in the order in which they were appended. Some may be unreachable from a given root.
    #[inline]
    pub fn nodes(&self) -> &[Node] {
        cast_slice(&self.pairs)
    }

    /// All references, in the order in which they were appended.
    #[inline]
    pub fn refs(&self) -> &[Slot] {
        &self.refs
    }

    /// The number of frozen segments.
    pub fn segments(&self) -> usize {
        self.segments.len()
    }

    /// Appends a complete subtree and returns the index of its root. Indices in the subtree count from 0, and its root is
    /// the first node of its first pair. It is fresh until the next [`freeze`](Self::freeze). Linear in the subtree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if the subtree does not fit; the arena is then unchanged.
    pub fn append(&mut self, pairs: &[Pair], refs: &[Slot]) -> Result<NodeIndex, TreeError> {
        let (old_pairs, old_refs) = (self.pairs.len(), self.refs.len());
        let too_large = TreeError::TooLarge {
            nodes: 2 * (old_pairs + pairs.len()),
            refs: old_refs + refs.len(),
        };
        if old_pairs + pairs.len() > MAX_PAIRS {
            return Err(too_large);
        }
        let (Ok(node_base), Ok(ref_base)) = (u32::try_from(2 * old_pairs), u32::try_from(old_refs))
        else {
            return Err(too_large);
        };
        self.pairs.reserve(pairs.len());
        for pair in pairs {
            let [lower, upper] = pair.0.map(|node| node.relocated(node_base, ref_base));
            let (Some(lower), Some(upper)) = (lower, upper) else {
                self.pairs.truncate(old_pairs);
                return Err(too_large);
            };
            self.pairs.push(Pair([lower, upper]));
        }
        self.refs.extend_from_slice(refs);
        Ok(NodeIndex(node_base))
    }

    /// Appends a whole tree, adds `first_slot` to each of its references, and returns the index of its root. Linear in the
    /// tree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if the tree does not fit, [`TreeError::SlotOutOfRange`] if slots would exceed 32 bits; the
    /// arena is then unchanged.
    pub fn append_tree(&mut self, tree: &Tree, first_slot: u32) -> Result<NodeIndex, TreeError> {
        if first_slot.checked_add(tree.triangles()).is_none() {
            return Err(TreeError::SlotOutOfRange {
                index: 0,
                slot: Slot(first_slot),
                slots: u32::MAX,
            });
        }
        let moved = |slot: &Slot| Slot(slot.0 + first_slot);
        self.append_mapped(tree, moved)
    }

    /// Appends a whole tree, replaces each reference to triangle `i` by `slots[i]`, and returns the index of its root. Linear
    /// in the tree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if the tree does not fit; the arena is then unchanged.
    ///
    /// # Panics
    ///
    /// If `slots` has fewer elements than the tree has triangles.
    pub fn append_renumbered(
        &mut self,
        tree: &Tree,
        slots: &[Slot],
    ) -> Result<NodeIndex, TreeError> {
        self.append_mapped(tree, |slot| slots[slot.index()])
    }

    fn append_mapped(
        &mut self,
        tree: &Tree,
        slot: impl Fn(&Slot) -> Slot,
    ) -> Result<NodeIndex, TreeError> {
        let refs: Vec<Slot> = tree.refs().iter().map(slot).collect();
        let first = self.append(&tree.arena().pairs, &refs)?;
        Ok(NodeIndex(first.0 + tree.root().0))
    }

    /// Appends references and returns the index of the first.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if they do not fit; the arena is then unchanged.
    pub fn push_refs(&mut self, refs: &[Slot]) -> Result<u32, TreeError> {
        let first = self.refs.len();
        let ends = [first, first + refs.len()].map(u32::try_from);
        let [Ok(index), Ok(_)] = ends else {
            return Err(TreeError::TooLarge {
                nodes: 2 * self.pairs.len(),
                refs: first + refs.len(),
            });
        };
        self.refs.extend_from_slice(refs);
        Ok(index)
    }

    /// Appends a pair whose nodes hold absolute indices, and returns the index of its first node. Merging links subtrees
    /// of the arena in this way: a copy of a subtree's root links the subtree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if the pair does not fit; the arena is then unchanged.
    pub fn push(&mut self, pair: Pair) -> Result<NodeIndex, TreeError> {
        let too_large = TreeError::TooLarge {
            nodes: 2 * self.pairs.len() + 2,
            refs: self.refs.len(),
        };
        if self.pairs.len() >= MAX_PAIRS {
            return Err(too_large);
        }
        let index = u32::try_from(2 * self.pairs.len()).map_err(|_| too_large)?;
        self.pairs.push(pair);
        Ok(NodeIndex(index))
    }

    /// Replaces a fresh node. A parent is set in this way once the indices of its children are known.
    ///
    /// # Panics
    ///
    /// If the node is frozen or does not exist.
    pub fn set(&mut self, index: NodeIndex, node: Node) {
        assert!(
            index.index() / 2 >= self.frozen().pairs,
            "node {index} is frozen"
        );
        self.pairs[index.index() / 2].0[index.index() % 2] = node;
    }

    /// Validates the fresh range and freezes it as a new segment. `slots` is the number of triangles, not below that of the
    /// previous call.
    ///
    /// Afterwards every interior node has a finite plane and two children in the arena, the references of every leaf are
    /// in range and refer to existing triangles, no cycle exists, and no path has more than [`MAX_DEPTH`] interior nodes.
    /// Traversals rely on this and check nothing again. Linear in the fresh range, independent of the frozen segments.
    ///
    /// # Errors
    ///
    /// [`TreeError`] names the first invalid node or reference; the range then stays fresh and unchanged.
    pub fn freeze(&mut self, slots: u32) -> Result<(), TreeError> {
        let start = self.frozen();
        if slots < start.slots {
            return Err(TreeError::FewerSlots {
                slots,
                frozen: start.slots,
            });
        }
        if let Some(offset) = self.refs[start.refs..].iter().position(|r| r.0 >= slots) {
            let index = start.refs + offset;
            return Err(TreeError::SlotOutOfRange {
                index,
                slot: self.refs[index],
                slots,
            });
        }
        let mut fresh_heights = vec![0_u8; 2 * (self.pairs.len() - start.pairs)];
        // Children are stored behind their parents, so a backward pass knows their heights first.
        for index in (2 * start.pairs..2 * self.pairs.len()).rev() {
            fresh_heights[index - 2 * start.pairs] = self.checked_height(index, &fresh_heights)?;
        }
        self.heights.extend_from_slice(&fresh_heights);
        self.segments.push(SegmentEnd {
            pairs: self.pairs.len(),
            refs: self.refs.len(),
            slots,
        });
        Ok(())
    }

    /// Removes everything behind the first `segments` frozen segments, fresh nodes included. Constant time.
    ///
    /// # Panics
    ///
    /// If the arena has fewer frozen segments.
    pub fn truncate(&mut self, segments: usize) {
        self.segments.truncate(segments);
        assert_eq!(
            self.segments.len(),
            segments,
            "the arena has fewer frozen segments"
        );
        let end = self.frozen();
        self.pairs.truncate(end.pairs);
        self.refs.truncate(end.refs);
        self.heights.truncate(2 * end.pairs);
    }

    /// The number of levels below a frozen node, 0 for a leaf; `None` for a fresh node. Constant time.
    pub fn height(&self, index: NodeIndex) -> Option<u8> {
        self.heights.get(index.index()).copied()
    }

    /// Bytes of nodes, references and heights.
    pub fn bytes(&self) -> usize {
        size_of_val(self.pairs.as_slice())
            + size_of_val(self.refs.as_slice())
            + size_of_val(self.heights.as_slice())
    }

    /// The end of the last frozen segment.
    fn frozen(&self) -> SegmentEnd {
        self.segments.last().copied().unwrap_or_default()
    }

    /// Checks one fresh node and returns its height. The heights of its fresh children are in `fresh_heights`.
    fn checked_height(&self, index: usize, fresh_heights: &[u8]) -> Result<u8, TreeError> {
        let fresh_start = self.heights.len();
        let node = self.nodes()[index];
        let index =
            NodeIndex(u32::try_from(index).expect("append and push keep indices in 30 bits"));
        if node.is_leaf() {
            let end = u64::from(node.first_ref()) + u64::from(node.count());
            if end > self.refs.len() as u64 {
                return Err(TreeError::RefsOutOfRange {
                    node: index,
                    first: node.first_ref(),
                    count: node.count(),
                    refs: self.refs.len(),
                });
            }
            return Ok(0);
        }
        if !node.split().is_finite() {
            return Err(TreeError::SplitNotFinite { node: index });
        }
        let child = node.first_child();
        if !child.index().is_multiple_of(2) || child.index() >= 2 * self.pairs.len() {
            return Err(TreeError::BadChild { node: index, child });
        }
        let height_of = |node: NodeIndex| {
            self.height(node)
                .unwrap_or_else(|| fresh_heights[node.index() - fresh_start])
        };
        if child.index() >= fresh_start && child.index() <= index.index() {
            return Err(TreeError::ChildNotBehind { node: index, child });
        }
        let height = 1 + height_of(child).max(height_of(child.sibling()));
        if usize::from(height) > MAX_DEPTH {
            return Err(TreeError::TooDeep { node: index });
        }
        Ok(height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Axis;

    fn interior(first: u32) -> Node {
        Node::interior(Axis::X, 0.5, NodeIndex(first)).expect("small")
    }

    fn leaf(first: u32, count: u32) -> Node {
        Node::leaf(first, count).expect("small")
    }

    fn root(node: Node) -> Pair {
        Pair([node, Node::EMPTY_LEAF])
    }

    #[test]
    fn appended_trees_get_their_own_slots() {
        let pairs = vec![root(interior(2)), Pair([leaf(0, 1), leaf(1, 1)])];
        let refs = vec![Slot(1), Slot(0)];
        let tree = Tree::from_parts(
            pairs,
            refs,
            crate::Aabb::EMPTY,
            2,
            crate::CostModel::CLASSIC,
        );
        let tree = tree.expect("valid");
        let mut arena = Arena::new();
        assert_eq!(arena.append_tree(&tree, 0), Ok(NodeIndex(0)), "first tree");
        assert_eq!(arena.append_tree(&tree, 5), Ok(NodeIndex(4)), "second tree");
        assert_eq!(arena.refs(), [1, 0, 6, 5].map(Slot), "slots are offset");
        assert_eq!(arena.nodes()[4], interior(6), "child indices are offset");
        assert_eq!(
            arena.push_refs(&[Slot(3)]),
            Ok(4),
            "references behind the trees"
        );
        let renumbered = arena.append_renumbered(&tree, &[Slot(4), Slot(2)]);
        assert_eq!(renumbered, Ok(NodeIndex(8)), "third tree");
        assert_eq!(arena.refs()[5..], [2, 4].map(Slot), "slots are mapped");
        assert_eq!(arena.freeze(7), Ok(()), "all nodes are valid");
        let refused = arena.append_tree(&tree, u32::MAX - 1);
        assert!(
            refused.is_err() && arena.refs().len() == 7,
            "{refused:?}: the arena is unchanged"
        );
    }

    #[test]
    fn invalid_nodes_are_refused_and_named() {
        let rows: [(Vec<Pair>, &str); 7] = [
            (
                vec![
                    root(Node::interior(Axis::Y, f32::NAN, NodeIndex(2)).expect("small")),
                    root(leaf(0, 1)),
                ],
                "node 0: its split is not finite",
            ),
            (
                vec![root(interior(2))],
                "node 0: child 2 is not the start of a pair of the arena",
            ),
            (
                vec![root(interior(3)), root(leaf(0, 1)), root(leaf(0, 1))],
                "node 0: child 3 is not the start of a pair of the arena",
            ),
            (
                vec![root(interior(0))],
                "node 0: child 0 is not stored behind it",
            ),
            (
                vec![root(interior(2)), Pair([interior(0), leaf(0, 1)])],
                "node 2: child 0 is not stored behind it",
            ),
            (
                vec![root(leaf(1, 2))],
                "leaf 0: references 1 + 2 are out of range, the arena has 2",
            ),
            (
                vec![root(leaf(u32::MAX, 2))],
                "leaf 0: references 4294967295 + 2 are out of range, the arena has 2",
            ),
        ];
        for (pairs, message) in rows {
            let mut arena = Arena::new();
            arena.append(&pairs, &[Slot(0), Slot(1)]).expect("fits");
            let error = arena.freeze(2).expect_err(message);
            assert_eq!(error.to_string(), message, "the message names the node");
            assert_eq!(arena.segments(), 0, "nothing was frozen");
        }
    }

    #[test]
    fn references_out_of_range_are_refused_and_named() {
        let mut arena = Arena::new();
        arena
            .append(&[root(leaf(0, 2))], &[Slot(0), Slot(7)])
            .expect("fits");
        let error = arena.freeze(7).expect_err("slot 7 of 7");
        assert_eq!(
            error.to_string(),
            "reference 1: triangle 7 is out of range, there are 7 triangles",
            "the message names the reference"
        );
    }

    #[test]
    fn a_chain_may_have_max_depth_levels_and_no_more() {
        let chain = |depth: u32| {
            let mut pairs: Vec<Pair> = (0..depth)
                .map(|level| root(interior(2 * level + 2)))
                .collect();
            pairs.push(root(Node::EMPTY_LEAF));
            let mut arena = Arena::new();
            arena.append(&pairs, &[]).expect("fits");
            arena.freeze(0).map(|()| arena.height(NodeIndex(0)))
        };
        assert_eq!(chain(64), Ok(Some(64)), "MAX_DEPTH levels");
        assert_eq!(
            chain(65),
            Err(TreeError::TooDeep { node: NodeIndex(0) }),
            "one level more"
        );
    }

    #[test]
    fn links_to_frozen_subtrees_use_their_stored_heights() {
        let mut arena = Arena::new();
        let pairs = [root(interior(2)), Pair([leaf(0, 1), leaf(1, 1)])];
        let first = arena.append(&pairs, &[Slot(0), Slot(1)]).expect("fits");
        arena.freeze(2).expect("valid");
        let second = arena.append(&pairs, &[Slot(2), Slot(3)]).expect("fits");
        arena.freeze(4).expect("valid");

        // One node over both trees: only two copied roots and a parent.
        let [a, b] = [first, second].map(|root| arena.nodes()[root.index()]);
        let top = arena.push(root(Node::EMPTY_LEAF)).expect("fits");
        let children = arena.push(Pair([a, b])).expect("fits");
        arena.set(top, Node::interior(Axis::Z, 1.0, children).expect("small"));
        arena.freeze(4).expect("valid");
        assert_eq!(arena.height(top), Some(2), "one above height 1");

        // The next frame starts by removing the nodes of this one.
        arena.truncate(2);
        assert_eq!(
            (arena.segments(), arena.nodes().len(), arena.refs().len()),
            (2, 8, 4),
            "only the two trees are left"
        );
        assert_eq!(arena.height(top), None, "the merged root is removed");
    }

    #[test]
    fn later_segments_cannot_have_fewer_triangles() {
        let mut arena = Arena::new();
        let first = arena.append(&[root(leaf(0, 1))], &[Slot(9)]).expect("fits");
        arena.freeze(10).expect("valid");
        let link = arena.nodes()[first.index()];
        arena.push(root(link)).expect("fits");
        let fewer = TreeError::FewerSlots {
            slots: 5,
            frozen: 10,
        };
        assert_eq!(arena.freeze(5), Err(fewer), "a reference to slot 9 exists");
        assert_eq!(arena.freeze(10), Ok(()), "the same number of triangles");
    }

    #[test]
    #[should_panic(expected = "is frozen")]
    fn frozen_nodes_cannot_be_replaced() {
        let mut arena = Arena::new();
        let frozen = arena.append(&[root(leaf(0, 0))], &[]).expect("fits");
        arena.freeze(0).expect("valid");
        arena.set(frozen, Node::EMPTY_LEAF);
    }
}
