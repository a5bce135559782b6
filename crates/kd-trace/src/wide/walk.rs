//! The traversal loop over wide nodes, for one ray and any processor.
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
use kd_wide::Block;

use super::portable::PortableRay;
use super::stack::Stack;
use super::subtree::Subtree;
use crate::collect::{Collect, Limited};
use crate::probe::Probe;

/// What a ray does with the blocks of a leaf.
pub(crate) trait VisitBlocks: Limited {
    /// Whether the first hit found ends the search.
    const ANY: bool;

    /// Visits the blocks of a leaf. Breaks if nothing else can matter.
    fn visit<P: Probe>(
        &mut self,
        ray: &PortableRay,
        blocks: &[Block],
        probe: &mut P,
    ) -> ControlFlow<()>;
}

/// Blocks of triangles: the collector receives every hit that it may want.
impl<C: Collect> VisitBlocks for C {
    const ANY: bool = C::ANY;

    #[inline(always)]
    fn visit<P: Probe>(
        &mut self,
        ray: &PortableRay,
        blocks: &[Block],
        probe: &mut P,
    ) -> ControlFlow<()> {
        ray.visit(blocks, self, probe)
    }
}

/// Lets a visitor visit every leaf that matters, roughly front to back.
///
/// Always inlined, so that it is compiled for the level of its caller.
#[inline(always)]
pub(crate) fn walk<V: VisitBlocks, P: Probe>(
    subtree: Subtree<'_>,
    ray: &PortableRay,
    visitor: &mut V,
    probe: &mut P,
) {
    let tree = subtree.tree();
    let mut child = subtree.child();
    let end = ray.end;
    let mut stack = Stack::new();
    let mut pending = stack.pending();
    let mut limit = end;
    loop {
        if child.is_leaf() {
            // SAFETY: the child of a subtree or of a node; and a leaf.
            let blocks = unsafe { tree.leaf(child) };
            probe.leaf(|| blocks.iter().map(Block::count).sum());
            if visitor.visit(ray, blocks, probe).is_break() {
                return;
            }
            limit = min(ray.steps(visitor.farthest()), end);
        } else {
            probe.node();
            // SAFETY: the child of a subtree or of a node; and no leaf.
            let node = unsafe { tree.node(child) };
            let next = if V::ANY {
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
        let next = if V::ANY {
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
