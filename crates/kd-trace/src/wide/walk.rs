//! The traversal loop over wide nodes, for one ray.
//!
//! A ray visits the nearest child whose box it meets, and pushes the others, the farthest first. The order of the children
//! comes from the splits that the node was made from and the signs of the direction, as in a binary tree, and not from sorted
//! distances: each node stores the order of its children for every octant of directions (V. Fuetterling,
//! C. Lojewski, F.-J. Pfreundt, B. Hamann, A. Ebert, *Accelerated Single Ray Tracing for Wide Vector Units*, 2017).
#![allow(
    unsafe_code,
    reason = "children are followed without a check of their indices: see `WideTree::node`"
)]

use std::ops::ControlFlow;

use kd_simd::min;
use kd_wide::{Block, Child, WideNode};

use super::stack::{Pending, Stack};
use super::subtree::Subtree;
use crate::collect::Collect;
use crate::probe::Probe;

/// A ray, prepared for wide nodes and blocks, for one set of instructions.
///
/// Distances are in steps (see [`planes`](crate::planes)).
pub(crate) trait WideRay {
    /// The end of the ray, in steps.
    fn end(&self) -> f32;

    /// A value of `t` in steps.
    fn steps(&self, t: f32) -> f32;

    /// The nearest child whose box the ray may meet up to `limit`. Pushes the other ones, farthest first.
    ///
    /// With `ANY`, the child in the last lane, where a hit is likely for little work; the other ones are pushed in the order of
    /// their lanes, without distances.
    fn enter<const ANY: bool>(
        &self,
        node: &WideNode,
        limit: f32,
        pending: &mut Pending<'_>,
    ) -> Option<Child>;

    /// [`enter`](Self::enter), or [`pop_last`](Pending::pop_last) if the ray meets no box.
    ///
    /// # Panics
    ///
    /// If nothing is pending.
    #[inline(always)]
    fn enter_or_pop(&self, node: &WideNode, limit: f32, pending: &mut Pending<'_>) -> Child {
        self.enter::<false>(node, limit, pending)
            .unwrap_or_else(|| pending.pop_last())
    }

    /// Passes every hit in the blocks up to `limit` to the collector. Breaks if the collector does.
    fn visit<C: Collect, P: Probe>(
        &self,
        blocks: &[Block],
        limit: f32,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()>;
}

/// Gives the collector every hit of the ray that it may want, roughly front to back.
///
/// Always inlined, so that it is compiled for the level of its caller.
#[inline(always)]
pub(crate) fn walk<R: WideRay, C: Collect, P: Probe>(
    subtree: Subtree<'_>,
    ray: &R,
    collector: &mut C,
    probe: &mut P,
) {
    let tree = subtree.tree();
    let mut child = subtree.child();
    let end = ray.end();
    let mut stack = Stack::new();
    let mut pending = stack.pending();
    let mut limit = end;
    loop {
        if child.is_leaf() {
            // SAFETY: the child of a subtree or of a node; and a leaf.
            let blocks = unsafe { tree.leaf(child) };
            probe.leaf(|| blocks.iter().map(Block::count).sum());
            if ray.visit(blocks, limit, collector, probe).is_break() {
                return;
            }
            limit = min(ray.steps(collector.limit()), end);
        } else {
            probe.node();
            // SAFETY: the child of a subtree or of a node; and no leaf.
            let node = unsafe { tree.node(child) };
            let next = if C::ANY {
                ray.enter::<true>(node, limit, &mut pending)
            } else {
                ray.enter::<false>(node, limit, &mut pending)
            };
            if let Some(next) = next {
                child = next;
                continue;
            }
        }
        // A ray that ends at its first hit has the same limit throughout.
        let next = if C::ANY {
            pending.pop_any()
        } else {
            pending.pop(limit)
        };
        match next {
            Some(next) => child = next,
            None => return,
        }
    }
}
