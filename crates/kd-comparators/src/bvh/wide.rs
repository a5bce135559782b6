//! Wide nodes of a hierarchy.

use kd_trace::WideTree;
use kd_trace::kit::{BinaryNode, BinaryTree};

use super::{Bvh, BvhNodeView};

impl Bvh {
    /// The hierarchy in the wide layout: nodes of eight children, over blocks of eight triangles. Queries have the same
    /// answers.
    ///
    /// Linear in the number of triangles, on the calling thread.
    pub fn wide(&self) -> WideTree {
        WideTree::from_binary(self, &self.mesh)
    }
}

impl BinaryTree for Bvh {
    fn root(&self) -> Option<u32> {
        (!self.nodes.is_empty()).then_some(0)
    }

    fn node(&self, index: u32) -> BinaryNode<'_> {
        match self.nodes[index as usize].view() {
            BvhNodeView::Leaf { first, count } => {
                BinaryNode::Leaf(&self.triangles[first as usize..][..count as usize])
            }
            BvhNodeView::Interior { axis, second } => BinaryNode::Split {
                axis,
                children: [index + 1, second],
            },
        }
    }
}
