//! What lies below each node.

use kd_core::{Node, NodeIndex, NodeView};

/// How many references and leaves lie below each node of an arena, counted once for each segment.
#[derive(Clone, Debug, Default)]
pub struct Census {
    below: Vec<Below>,
}

/// What lies below a node, itself included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Below {
    pub(crate) references: u32,
    pub(crate) leaves: u32,
}

impl Census {
    /// Nothing counted.
    pub fn new() -> Self {
        Self::default()
    }

    /// Counts the nodes that have been added since the last time. Children lie behind their parents, or before what is new,
    /// as in an arena whose last segment is new. Linear in what is new.
    ///
    /// # Panics
    ///
    /// If a child is not there.
    pub fn extend(&mut self, nodes: &[Node]) {
        let old = self.below.len();
        self.below.resize(nodes.len(), Below::default());
        for place in (old..nodes.len()).rev() {
            self.below[place] = match nodes[place].view() {
                NodeView::Leaf { count, .. } => Below {
                    references: count,
                    leaves: 1,
                },
                NodeView::Interior { first, .. } => {
                    let [a, b] = [first, first.sibling()].map(|child| self.below[child.index()]);
                    Below {
                        references: a.references.saturating_add(b.references),
                        leaves: a.leaves.saturating_add(b.leaves),
                    }
                }
            };
        }
    }

    /// Forgets all but the first `nodes` nodes, as [`Arena::truncate`](kd_core::Arena::truncate) does.
    pub fn truncate(&mut self, nodes: usize) {
        self.below.truncate(nodes);
    }

    /// References below a node; one triangle in several leaves counts as often.
    ///
    /// # Panics
    ///
    /// If the node has not been counted.
    pub fn references(&self, node: NodeIndex) -> u32 {
        self.below[node.index()].references
    }

    /// Leaves below a node, empty ones included; 1 for a leaf.
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
    fn segments_are_counted_one_after_the_other() {
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
        // A second tree that shares a part of the first.
        nodes.extend([split(8), Node::EMPTY_LEAF, nodes[3], leaf(5)]);
        census.extend(&nodes);
        let root = NodeIndex(6);
        assert_eq!((census.references(root), census.leaves(root)), (8, 3));
        census.truncate(6);
        census.extend(&nodes);
        assert_eq!(census.references(root), 8, "counted again");
    }
}
