//! Eight boxes at a time.

use kd_core::Mesh;
use kd_trace::WideTree;
use kd_trace::kit::{BinaryNode, BinaryTree};

use crate::bvh::Bvh;
use crate::node::BvhNodeView;

impl Bvh {
    /// The same hierarchy laid out for speed: nodes of eight children and triangles in blocks of eight, tested at once. It
    /// has the same queries with the same answers, and others for many rays.
    ///
    /// Linear in the number of triangles, on the calling thread. What is made is a copy, which refitting does not change.
    ///
    /// # Panics
    ///
    /// If `mesh` is not the one that the hierarchy was built from or refitted to last, and has fewer triangles.
    pub fn wide(&self, mesh: &Mesh) -> WideTree {
        WideTree::from_binary(&Boxes(self), mesh)
    }
}

/// The nodes as kd-trace asks for them.
struct Boxes<'a>(&'a Bvh);

impl BinaryTree for Boxes<'_> {
    fn root(&self) -> Option<u32> {
        (!self.0.nodes.is_empty()).then_some(0)
    }

    fn node(&self, index: u32) -> BinaryNode<'_> {
        match self.0.nodes[index as usize].view() {
            BvhNodeView::Leaf { first, count } => {
                BinaryNode::Leaf(&self.0.triangles[first as usize..][..count as usize])
            }
            BvhNodeView::Interior { axis, second } => BinaryNode::Split {
                axis,
                children: [index + 1, second],
            },
        }
    }
}
