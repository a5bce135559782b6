//! Rays through the 8-byte nodes of a kd-tree over items of any kind.

use std::ops::ControlFlow;

use kd_core::{Aabb, Node, NodeIndex, Ray, Tree};

use crate::binary::walk::{Walkable, walk};
use crate::items::{Items, VisitItem};
use crate::probe::Probe;
use crate::triangle::TriangleTest;

/// Calls [`visit`](VisitItem::visit) for every reference in the leaves that the ray may meet between `t_min` and `t_max`, and not beyond
/// [`limit`](VisitItem::limit): roughly from near to far, and once for each leaf that has the reference.
///
/// Cells are widened by the bound between planes and hits that `planes.rs` of kd-trace derives. An item that is referenced in every leaf
/// whose cell meets its box is visited if any `t` in the range is that of a point, computed without rounding, that is at most 2⁻²¹ Q
/// beside its box on each axis, where Q is the largest distance from the ray's origin to a face of the tree's box on that axis.
///
/// A ray that [cannot hit](Ray::can_hit) anything visits nothing. The culling of other rays is for the visitor.
pub fn walk_references<V: VisitItem>(tree: &Tree, ray: &Ray, visitor: &mut V) {
    walk(&References(tree), ray, &mut Items(visitor), &mut ());
}

/// Leaves are lists of items.
struct References<'a>(&'a Tree);

impl<V: VisitItem> Walkable<Items<'_, V>> for References<'_> {
    #[inline]
    fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    #[inline]
    fn root(&self) -> NodeIndex {
        self.0.root()
    }

    #[inline]
    fn nodes(&self) -> &[Node] {
        self.0.nodes()
    }

    #[inline]
    fn visit<P: Probe>(
        &self,
        leaf: Node,
        _: &TriangleTest,
        items: &mut Items<'_, V>,
        _: &mut P,
    ) -> ControlFlow<()> {
        for slot in self.0.leaf_refs(leaf) {
            items.0.visit(slot.0)?;
        }
        ControlFlow::Continue(())
    }
}
