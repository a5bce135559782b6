//! Nodes and blocks that refer to each other by indices, checked once.
#![allow(
    unsafe_code,
    reason = "rays follow indices that were checked when the arrays were put together; checking them again takes a twentieth \
              of a ray's time"
)]

use kd_buffer::Buffer;

use crate::block::Block;
use crate::node::{Child, WideNode};

mod paged;

pub(crate) use paged::{Paged, State};

/// All nodes and blocks of a tree. Invariant: the root, and every child of a node that rays reach from it, is an index into these nodes
/// or a range of these blocks.
///
/// A forest changes nodes and blocks only while the root is [`Child::NOTHING`].
#[derive(Clone, Debug)]
pub(crate) struct Arrays {
    pub(crate) nodes: Paged<WideNode>,
    pub(crate) blocks: Paged<Block>,
    root: Child,
    /// Whether they are those of a forest.
    has_members: bool,
}

impl Arrays {
    /// Those of a forest without members.
    pub(crate) const fn of_forest() -> Self {
        Self {
            nodes: Paged::new(),
            blocks: Paged::new(),
            root: Child::NOTHING,
            has_members: true,
        }
    }

    pub(crate) fn has_members(&self) -> bool {
        self.has_members
    }

    /// # Panics
    ///
    /// If a child is not among the nodes and blocks.
    pub(crate) fn new(
        nodes: impl Into<Buffer<WideNode>>,
        blocks: impl Into<Buffer<Block>>,
        root: Child,
    ) -> Self {
        let (nodes, blocks) = (nodes.into(), blocks.into());
        let is_there = |child: Child| child.is_within(nodes.len(), blocks.len());
        let children = nodes.iter().flat_map(|node| node.children);
        assert!(
            is_there(root) && children.into_iter().all(is_there),
            "every child is a node or blocks of the same tree"
        );
        // SAFETY: they were just checked.
        unsafe { Self::new_unchecked(nodes, blocks, root) }
    }

    /// [`new`](Self::new) without the check, unread.
    ///
    /// # Safety
    ///
    /// The root and every child of a node is among these nodes and blocks.
    pub(crate) unsafe fn new_unchecked(
        nodes: Buffer<WideNode>,
        blocks: Buffer<Block>,
        root: Child,
    ) -> Self {
        Self {
            nodes: Paged::of(nodes),
            blocks: Paged::of(blocks),
            root,
            has_members: false,
        }
    }

    /// Rays hit nothing until there is another root.
    pub(crate) fn clear_root(&mut self) {
        self.root = Child::NOTHING;
    }

    /// Lets rays begin at `root`, which reaches no child that [`has`](Self::has) would refuse.
    ///
    /// # Panics
    ///
    /// If the root is not among the nodes and blocks.
    pub(crate) fn set_root(&mut self, root: Child) {
        assert!(
            self.has(root),
            "every child is a node or blocks of the same tree"
        );
        self.root = root;
    }

    /// Whether a child is among the nodes and blocks.
    pub(crate) fn has(&self, child: Child) -> bool {
        child.is_within(self.nodes.len(), self.blocks.len())
    }

    /// Makes these arrays, which were equal to `with` in the state `since`, equal to `with` again.
    pub(crate) fn catch_up(&mut self, with: &Self, since: State) {
        self.nodes.catch_up(&with.nodes, since);
        self.blocks.catch_up(&with.blocks, since);
        self.root = with.root;
    }

    #[inline(always)]
    pub(crate) fn root(&self) -> Child {
        self.root
    }

    /// Asks the processor to load a child into its nearest cache, where it has an instruction for that.
    #[inline(always)]
    pub(crate) fn prefetch(&self, child: Child) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            const LINE: usize = 64;
            const LINES: usize = size_of::<WideNode>() / LINE;
            let first: *const i8 = if child.is_leaf() {
                let block = child.blocks().start;
                self.blocks.as_ptr().wrapping_add(block).cast()
            } else {
                self.nodes.as_ptr().wrapping_add(child.index()).cast()
            };
            for line in 0..LINES {
                // SAFETY: a prefetch accepts any address.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(first.wrapping_add(LINE * line)) };
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = child;
    }

    pub(crate) fn nodes(&self) -> &[WideNode] {
        &self.nodes
    }

    pub(crate) fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// A child that is a node.
    ///
    /// # Safety
    ///
    /// It is the root or a child of a node of these arrays, and not a leaf.
    #[inline(always)]
    pub(crate) unsafe fn node(&self, child: Child) -> &WideNode {
        debug_assert!(!child.is_leaf(), "a node");
        // SAFETY: the index was checked when the arrays were put together.
        unsafe { self.nodes.get_unchecked(child.index()) }
    }

    /// The blocks of a child that is a leaf.
    ///
    /// # Safety
    ///
    /// It is a leaf, and the root, a child of a node of these arrays, or [`Child::NOTHING`].
    #[inline(always)]
    pub(crate) unsafe fn leaf(&self, child: Child) -> &[Block] {
        debug_assert!(child.is_leaf(), "a leaf");
        // SAFETY: the range was checked when the arrays were put together.
        unsafe { self.blocks.get_unchecked(child.blocks()) }
    }
}

/// Compares bytes: empty lanes are NaN, which does not equal itself.
impl PartialEq for Arrays {
    fn eq(&self, other: &Self) -> bool {
        fn bytes<T: bytemuck::Pod>(of: &[T]) -> &[u8] {
            bytemuck::cast_slice(of)
        }
        self.root == other.root
            && bytes(&self.nodes) == bytes(&other.nodes)
            && bytes(&self.blocks) == bytes(&other.blocks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "every child is a node or blocks of the same tree")]
    fn missing_children_are_refused() {
        let mut node = WideNode::EMPTY;
        node.children[3] = Child::leaf(0, 2);
        Arrays::new(vec![node], vec![Block::EMPTY], Child::node(0));
    }

    #[test]
    fn present_children_are_kept() {
        let mut node = WideNode::EMPTY;
        node.children[3] = Child::leaf(0, 1);
        node.children[4] = Child::node(0);
        let arrays = Arrays::new(vec![node], vec![Block::EMPTY], Child::node(0));
        assert_eq!(
            (arrays.nodes().len(), arrays.blocks().len()),
            (1, 1),
            "kept"
        );
    }
}
