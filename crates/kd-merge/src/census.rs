//! The number of references and leaves below each node.

use kd_core::{Node, NodeIndex, NodeView};

/// The number of references and of leaves below each node of an arena. Each segment is counted once.
#[derive(Clone, Debug, Default)]
pub struct Census {
    below: Vec<Totals>,
}

/// Totals of a subtree, its root included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Totals {
    pub(crate) references: u32,
    pub(crate) leaves: u32,
}

impl Census {
    /// A census of no nodes.
    pub fn new() -> Self {
        Self::default()
    }

    /// Counts the nodes that were added since the last call. `nodes` are all nodes of the arena. Children of a new node are
    /// stored behind it or before all new nodes, as in an arena whose last segment is new. Linear in the number of new nodes.
    ///
    /// # Panics
    ///
    /// If a child index is out of range.
    pub fn extend(&mut self, nodes: &[Node]) {
        let old = self.below.len();
        self.below.resize(nodes.len(), Totals::default());
        for index in (old..nodes.len()).rev() {
            self.below[index] = match nodes[index].view() {
                NodeView::Leaf { count, .. } => Totals {
                    references: count,
                    leaves: 1,
                },
                NodeView::Interior { first, .. } => {
                    let [a, b] = [first, first.sibling()].map(|child| self.below[child.index()]);
                    Totals {
                        references: a.references.saturating_add(b.references),
                        leaves: a.leaves.saturating_add(b.leaves),
                    }
                }
            };
        }
    }

    /// Removes all but the first `nodes` nodes, to follow [`Arena::truncate`](kd_core::Arena::truncate). Constant time.
    pub fn truncate(&mut self, nodes: usize) {
        self.below.truncate(nodes);
    }

    /// The number of references below a node. A triangle in several leaves counts several times. Constant time.
    ///
    /// # Panics
    ///
    /// If the node has not been counted.
    pub fn references(&self, node: NodeIndex) -> u32 {
        self.below[node.index()].references
    }

    /// The number of leaves below a node, including empty ones; 1 for a leaf. Constant time.
    ///
    /// # Panics
    ///
    /// If the node has not been counted.
    pub fn leaves(&self, node: NodeIndex) -> u32 {
        self.below[node.index()].leaves
    }
}

#[cfg(test)]
mod tests {
    use kd_core::{Axis, Node};

    use super::*;

    #[test]
    fn later_segments_are_counted_incrementally() {
        let leaf = |count| Node::leaf(0, count).expect("small");
        let split = |first| Node::interior(Axis::X, 0.0, NodeIndex(first)).expect("small");
        let mut nodes = vec![
            split(2),
            Node::EMPTY_LEAF,
            leaf(3),
            split(4),
            leaf(1),
            leaf(2),
        ];
        let mut census = Census::new();
        census.extend(&nodes);
        let root = NodeIndex(0);
        assert_eq!((census.references(root), census.leaves(root)), (6, 3));
        // A second tree that shares a subtree of the first.
        nodes.extend([split(8), Node::EMPTY_LEAF, nodes[3], leaf(5)]);
        census.extend(&nodes);
        let root = NodeIndex(6);
        assert_eq!((census.references(root), census.leaves(root)), (8, 3));
        census.truncate(6);
        census.extend(&nodes);
        assert_eq!(census.references(root), 8, "counted again after truncation");
    }
}
