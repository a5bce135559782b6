//! Where nodes and references live: one append-only array of each, in segments.
//!
//! Because a child lies either further on in the fresh part or in a frozen segment, there are no cycles, and freezing
//! looks at the fresh part only: the depth below a frozen node is stored as its height.

use bytemuck::cast_slice;
use thiserror::Error;

use crate::{Node, NodeIndex, Pair, Slot, Tree};

/// The greatest number of interior nodes between a root and a leaf. Builders stay below it, freezing checks it, and
/// traversals size their stacks by it.
pub const MAX_DEPTH: usize = 64;

/// Why nodes do not make a valid tree.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TreeError {
    /// There are no nodes at all; an empty tree is one empty leaf.
    #[error("there is no root node")]
    NoRoot,
    /// An interior node's plane is NaN or infinite.
    #[error("node {node}: its split is not finite")]
    SplitNotFinite {
        /// The node's index.
        node: NodeIndex,
    },
    /// A child index does not name the first node of a pair in the arena.
    #[error("node {node}: child {child} is not the start of a pair of the arena")]
    BadChild {
        /// The node's index.
        node: NodeIndex,
        /// Where its children should be.
        child: NodeIndex,
    },
    /// A child lies before its parent in the segment being written, which could make a cycle.
    #[error("node {node}: child {child} does not lie behind it")]
    ChildNotBehind {
        /// The node's index.
        node: NodeIndex,
        /// Where its children are.
        child: NodeIndex,
    },
    /// A leaf's references reach past the end of the arena.
    #[error("leaf {node}: references {first} + {count} are out of range, there are {refs}")]
    RefsOutOfRange {
        /// The leaf's index.
        node: NodeIndex,
        /// Its first reference.
        first: u32,
        /// How many references it has.
        count: u32,
        /// How many there are in the arena.
        refs: usize,
    },
    /// A reference names a triangle that does not exist.
    #[error("reference {index}: triangle {slot} is out of range, there are {slots}")]
    SlotOutOfRange {
        /// Position of the reference in the arena.
        index: usize,
        /// What it refers to.
        slot: Slot,
        /// How many triangles there are.
        slots: u32,
    },
    /// More than [`MAX_DEPTH`] interior nodes above some leaf.
    #[error("node {node}: more than {MAX_DEPTH} levels below it")]
    TooDeep {
        /// The node where the limit is passed.
        node: NodeIndex,
    },
    /// Two parents have the same children, where each node should have one parent.
    #[error("node {node}: its children {child} have another parent already")]
    SharedChild {
        /// The second parent.
        node: NodeIndex,
        /// The children.
        child: NodeIndex,
    },
    /// The leaves together have more references than there are, so some of them share references, where each should
    /// have its own.
    #[error("leaves have {used} references, but there are only {refs}")]
    SharedRefs {
        /// The sum over all leaves.
        used: u64,
        /// How many there are.
        refs: usize,
    },
    /// Fewer triangles than a segment that is frozen already may refer to.
    #[error("{slots} triangles, but frozen segments refer to as many as {frozen}")]
    FewerSlots {
        /// How many there should be now.
        slots: u32,
        /// How many there were.
        frozen: u32,
    },
    /// The node that should be the root is not frozen.
    #[error("root {node} is not a frozen node")]
    BadRoot {
        /// The node.
        node: NodeIndex,
    },
    /// A transform that does more than to translate, and to scale along the axes.
    #[error("the transform turns or shears, so that planes across axes would no longer be such")]
    NotAlongAxes,
    /// The box is neither finite nor empty.
    #[error("the bounds are not finite")]
    BadBounds,
    /// The cost model that came with the nodes makes no sense.
    #[error("`{field}` must be {rule}")]
    BadCost {
        /// Which number.
        field: &'static str,
        /// What it must be.
        rule: &'static str,
    },
    /// Nodes are indexed with 30 bits, references with 32.
    #[error("the tree does not fit: {nodes} nodes, {refs} references")]
    TooLarge {
        /// How many nodes there would be.
        nodes: usize,
        /// How many references there would be.
        refs: usize,
    },
}

/// Nodes and references of one or more trees.
///
/// A **frozen** segment has been validated and never changes; nodes of any later segment may link to its subtrees.
/// Behind the last frozen segment lies the **fresh** part, which is being written.
#[derive(Clone, Debug, Default)]
pub struct Arena {
    pairs: Vec<Pair>,
    refs: Vec<Slot>,
    /// Levels below each frozen node; 0 for a leaf.
    heights: Vec<u8>,
    /// Where each frozen segment ends.
    segments: Vec<End>,
}

/// The end of a segment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct End {
    pairs: usize,
    refs: usize,
    /// References in all segments up to here are below this.
    slots: u32,
}

/// As many as 30 bits can index.
const MAX_PAIRS: usize = 1 << 29;

impl Arena {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Pairs and references that a builder made, with indices from 0, all fresh. Nothing is copied.
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

    /// How many triangles the frozen segments may refer to.
    pub(crate) fn slots(&self) -> u32 {
        self.frozen().slots
    }

    /// All nodes, two to a pair, in the order they were appended. Some may be unreachable from a given tree.
    #[inline]
    pub fn nodes(&self) -> &[Node] {
        cast_slice(&self.pairs)
    }

    /// All references.
    #[inline]
    pub fn refs(&self) -> &[Slot] {
        &self.refs
    }

    /// How many segments are frozen.
    pub fn segments(&self) -> usize {
        self.segments.len()
    }

    /// Appends a finished subtree whose indices count from 0, root in the first node of its first pair, and gives
    /// the root's place. It is fresh until the next [`freeze`](Self::freeze). Linear in the subtree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if it does not fit; the arena is unchanged then.
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

    /// Appends all of a tree, whose references become those of `first_slot` and on, and gives its root's place. Linear in
    /// the tree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if it does not fit, [`TreeError::SlotOutOfRange`] if slots would be larger than 32 bits; the
    /// arena is unchanged then.
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

    /// Appends all of a tree, whose reference `i` becomes `slots[i]`, and gives its root's place. Linear in the tree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if it does not fit; the arena is unchanged then.
    ///
    /// # Panics
    ///
    /// If there are fewer slots than the tree has triangles.
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

    /// Appends references, and gives the place of the first.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if they do not fit.
    pub fn push_refs(&mut self, refs: &[Slot]) -> Result<u32, TreeError> {
        let first = self.refs.len();
        let ends = [first, first + refs.len()].map(u32::try_from);
        let [Ok(place), Ok(_)] = ends else {
            return Err(TreeError::TooLarge {
                nodes: 2 * self.pairs.len(),
                refs: first + refs.len(),
            });
        };
        self.refs.extend_from_slice(refs);
        Ok(place)
    }

    /// Appends a pair whose nodes hold absolute indices, and gives the place of its first node. This is how a tree
    /// is put together from parts that lie in the arena already: a subtree is linked by copying its root.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if it does not fit.
    pub fn push(&mut self, pair: Pair) -> Result<NodeIndex, TreeError> {
        let too_large = TreeError::TooLarge {
            nodes: 2 * self.pairs.len() + 2,
            refs: self.refs.len(),
        };
        if self.pairs.len() >= MAX_PAIRS {
            return Err(too_large);
        }
        let place = u32::try_from(2 * self.pairs.len()).map_err(|_| too_large)?;
        self.pairs.push(pair);
        Ok(NodeIndex(place))
    }

    /// Replaces a fresh node; used to put in a parent once its children have their places.
    ///
    /// # Panics
    ///
    /// If the node is frozen or does not exist.
    pub fn set(&mut self, place: NodeIndex, node: Node) {
        assert!(
            place.index() / 2 >= self.frozen().pairs,
            "node {place} is frozen"
        );
        self.pairs[place.index() / 2].0[place.index() % 2] = node;
    }

    /// Validates the fresh part and freezes it as one more segment. `slots` is the number of triangles there are, no
    /// fewer than the time before.
    ///
    /// Afterwards every interior node has a finite plane and two children in the arena, every leaf's references are
    /// in range and name existing triangles, there are no cycles, and no path is longer than [`MAX_DEPTH`].
    /// Traversals rely on this instead of checking again. Linear in the fresh part, whatever the frozen one holds.
    ///
    /// # Errors
    ///
    /// [`TreeError`] names the first broken node; the fresh part stays as it is, not frozen.
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
        // Children lie behind their parents, so that going backwards their heights are known first.
        for place in (2 * start.pairs..2 * self.pairs.len()).rev() {
            fresh_heights[place - 2 * start.pairs] = self.checked_height(place, &fresh_heights)?;
        }
        self.heights.extend_from_slice(&fresh_heights);
        self.segments.push(End {
            pairs: self.pairs.len(),
            refs: self.refs.len(),
            slots,
        });
        Ok(())
    }

    /// Forgets everything behind the first `segments` frozen segments. Constant time.
    ///
    /// # Panics
    ///
    /// If fewer segments are frozen.
    pub fn truncate(&mut self, segments: usize) {
        self.segments.truncate(segments);
        assert_eq!(self.segments.len(), segments, "so many segments are frozen");
        let end = self.frozen();
        self.pairs.truncate(end.pairs);
        self.refs.truncate(end.refs);
        self.heights.truncate(2 * end.pairs);
    }

    /// Levels below a frozen node, 0 for a leaf; `None` for a fresh one.
    pub fn height(&self, place: NodeIndex) -> Option<u8> {
        self.heights.get(place.index()).copied()
    }

    /// Bytes held by nodes, references and heights.
    pub fn bytes(&self) -> usize {
        size_of_val(self.pairs.as_slice())
            + size_of_val(self.refs.as_slice())
            + size_of_val(self.heights.as_slice())
    }

    fn frozen(&self) -> End {
        self.segments.last().copied().unwrap_or_default()
    }

    /// Checks one fresh node whose children, if fresh, have their heights in `fresh_heights` already.
    fn checked_height(&self, place: usize, fresh_heights: &[u8]) -> Result<u8, TreeError> {
        let fresh_start = self.heights.len();
        let node = self.nodes()[place];
        let place =
            NodeIndex(u32::try_from(place).expect("append and push keep indices in 30 bits"));
        if node.is_leaf() {
            let end = u64::from(node.first_ref()) + u64::from(node.count());
            if end > self.refs.len() as u64 {
                return Err(TreeError::RefsOutOfRange {
                    node: place,
                    first: node.first_ref(),
                    count: node.count(),
                    refs: self.refs.len(),
                });
            }
            return Ok(0);
        }
        if !node.split().is_finite() {
            return Err(TreeError::SplitNotFinite { node: place });
        }
        let child = node.first_child();
        if !child.index().is_multiple_of(2) || child.index() >= 2 * self.pairs.len() {
            return Err(TreeError::BadChild { node: place, child });
        }
        let height_of = |node: NodeIndex| {
            self.height(node)
                .unwrap_or_else(|| fresh_heights[node.index() - fresh_start])
        };
        if child.index() >= fresh_start && child.index() <= place.index() {
            return Err(TreeError::ChildNotBehind { node: place, child });
        }
        let height = 1 + height_of(child).max(height_of(child.sibling()));
        if usize::from(height) > MAX_DEPTH {
            return Err(TreeError::TooDeep { node: place });
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
    fn trees_are_appended_with_slots_of_their_own() {
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
        assert_eq!(arena.append_tree(&tree, 0), Ok(NodeIndex(0)), "the first");
        assert_eq!(arena.append_tree(&tree, 5), Ok(NodeIndex(4)), "the second");
        assert_eq!(arena.refs(), [1, 0, 6, 5].map(Slot), "numbered on");
        assert_eq!(arena.nodes()[4], interior(6), "and its nodes are its own");
        assert_eq!(arena.push_refs(&[Slot(3)]), Ok(4), "behind them");
        let renumbered = arena.append_renumbered(&tree, &[Slot(4), Slot(2)]);
        assert_eq!(renumbered, Ok(NodeIndex(8)), "and a third");
        assert_eq!(arena.refs()[5..], [2, 4].map(Slot), "numbered as told");
        assert_eq!(arena.freeze(7), Ok(()), "all of it is valid");
        let refused = arena.append_tree(&tree, u32::MAX - 1);
        assert!(
            refused.is_err() && arena.refs().len() == 7,
            "{refused:?}: as it was"
        );
    }

    #[test]
    fn broken_nodes_are_named() {
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
                "node 0: child 0 does not lie behind it",
            ),
            (
                vec![root(interior(2)), Pair([interior(0), leaf(0, 1)])],
                "node 2: child 0 does not lie behind it",
            ),
            (
                vec![root(leaf(1, 2))],
                "leaf 0: references 1 + 2 are out of range, there are 2",
            ),
            (
                vec![root(leaf(u32::MAX, 2))],
                "leaf 0: references 4294967295 + 2 are out of range, there are 2",
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
    fn references_to_nothing_are_named() {
        let mut arena = Arena::new();
        arena
            .append(&[root(leaf(0, 2))], &[Slot(0), Slot(7)])
            .expect("fits");
        let error = arena.freeze(7).expect_err("slot 7 of 7");
        assert_eq!(
            error.to_string(),
            "reference 1: triangle 7 is out of range, there are 7",
            "the message names the reference"
        );
    }

    #[test]
    fn a_chain_may_be_as_deep_as_the_stack_and_no_deeper() {
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
            "one more"
        );
    }

    #[test]
    fn frozen_subtrees_are_linked_and_counted_by_their_height() {
        let mut arena = Arena::new();
        let pairs = [root(interior(2)), Pair([leaf(0, 1), leaf(1, 1)])];
        let first = arena.append(&pairs, &[Slot(0), Slot(1)]).expect("fits");
        arena.freeze(2).expect("valid");
        let second = arena.append(&pairs, &[Slot(2), Slot(3)]).expect("fits");
        arena.freeze(4).expect("valid");

        // One node over both: two copied roots and a parent, nothing else.
        let [a, b] = [first, second].map(|place| arena.nodes()[place.index()]);
        let top = arena.push(root(Node::EMPTY_LEAF)).expect("fits");
        let children = arena.push(Pair([a, b])).expect("fits");
        arena.set(top, Node::interior(Axis::Z, 1.0, children).expect("small"));
        arena.freeze(4).expect("valid");
        assert_eq!(arena.height(top), Some(2), "one above height 1");

        // The next frame begins by forgetting this one.
        arena.truncate(2);
        assert_eq!(
            (arena.segments(), arena.nodes().len(), arena.refs().len()),
            (2, 8, 4),
            "as before"
        );
        assert_eq!(arena.height(top), None, "gone");
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
        assert_eq!(arena.freeze(5), Err(fewer), "slot 9 is referred to");
        assert_eq!(arena.freeze(10), Ok(()), "as many as before");
    }

    #[test]
    #[should_panic(expected = "is frozen")]
    fn frozen_nodes_cannot_be_replaced() {
        let mut arena = Arena::new();
        let place = arena.append(&[root(leaf(0, 0))], &[]).expect("fits");
        arena.freeze(0).expect("valid");
        arena.set(place, Node::EMPTY_LEAF);
    }
}
