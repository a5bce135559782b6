//! Where a ray begins in a tree.
#![allow(
    unsafe_code,
    reason = "children are followed without a check of their indices: see `WideTree::node`"
)]

use kd_wide::{Child, WIDTH, WideTree};

/// A tree below one of its children. Invariant: `child` is the root of the tree or a child of one of its nodes.
#[derive(Clone, Copy)]
pub(crate) struct Subtree<'a> {
    tree: &'a WideTree,
    child: Child,
}

impl<'a> Subtree<'a> {
    /// All of a tree.
    #[inline(always)]
    pub(crate) fn whole(tree: &'a WideTree) -> Self {
        let child = tree.root();
        Self { tree, child }
    }

    /// Below a child. `place` is eight times the index of its node, plus its lane.
    ///
    /// # Panics
    ///
    /// If there is no such node.
    #[inline(always)]
    pub(crate) fn at(tree: &'a WideTree, place: usize) -> Self {
        let child = tree.nodes()[place / WIDTH].children[place % WIDTH];
        Self { tree, child }
    }

    /// Below a child.
    ///
    /// # Safety
    ///
    /// `child` is the root of the tree or a child of one of its nodes.
    #[inline(always)]
    pub(crate) unsafe fn below(tree: &'a WideTree, child: Child) -> Self {
        Self { tree, child }
    }

    #[inline(always)]
    pub(crate) fn tree(&self) -> &'a WideTree {
        self.tree
    }

    #[inline(always)]
    pub(crate) fn child(&self) -> Child {
        self.child
    }
}
