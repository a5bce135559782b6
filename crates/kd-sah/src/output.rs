//! Nodes and references of a tree under construction.

use kd_core::{CostModel, Node, NodeIndex, Pair, Slot, TreeError};

use crate::cell::Place;
use crate::options::BuildError;
use crate::plane::Plane;

/// The nodes of a subtree, with indices from 0, in depth-first order: a pair, all nodes below its lower node, all nodes
/// below its upper node. The order does not depend on threads.
#[derive(Debug, Default)]
pub(crate) struct Output {
    pub(crate) pairs: Vec<Pair>,
    pub(crate) refs: Vec<Slot>,
    /// The number of cells that were not divided because the limit of references was reached, including cells of retracted
    /// subtrees.
    pub(crate) limited_cells: usize,
}

/// A finished node that is not yet stored, and its expected cost for a ray that enters it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Built {
    pub(crate) node: Node,
    pub(crate) cost: f64,
}

/// An interior node whose subtrees are being built.
#[derive(Debug)]
pub(crate) struct Interior {
    /// The index of the pair of its children.
    pair: usize,
    /// The index of the first reference below it.
    first_ref: usize,
    /// The probability of entering each child, for a ray that enters the node.
    probabilities: [f64; 2],
}

impl Interior {
    /// Appends a pair for the children.
    pub(crate) fn begin(place: &Place, children: &[Place; 2], output: &mut Output) -> Self {
        let half_area = place.bounds.half_area();
        let interior = Self {
            pair: output.pairs.len(),
            first_ref: output.refs.len(),
            probabilities: [0, 1].map(|side: usize| children[side].bounds.half_area() / half_area),
        };
        output.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
        interior
    }

    /// The expected cost of the children for a ray that enters the node.
    pub(crate) fn cost_below(&self, [lower, upper]: &[Built; 2]) -> f64 {
        self.probabilities[0] * lower.cost + self.probabilities[1] * upper.cost
    }
}

impl Output {
    /// Appends references and returns a leaf over them.
    pub(crate) fn leaf(
        &mut self,
        refs: impl Iterator<Item = Slot>,
        model: &CostModel,
    ) -> Result<Built, BuildError> {
        let first = self.refs.len();
        self.refs.extend(refs);
        self.leaf_from(first, model)
    }

    /// Stores the children of an interior node and returns the node.
    pub(crate) fn finish(
        &mut self,
        interior: &Interior,
        plane: &Plane,
        [lower, upper]: &[Built; 2],
        cost: f64,
    ) -> Result<Built, BuildError> {
        self.pairs[interior.pair] = Pair([lower.node, upper.node]);
        let first = u32::try_from(2 * interior.pair).ok().map(NodeIndex);
        let node = first.and_then(|first| Node::interior(plane.axis, plane.position, first));
        Ok(Built {
            node: node.ok_or_else(|| self.too_large())?,
            cost,
        })
    }

    /// Retracts an interior node: removes all nodes below it and returns a leaf over their references, once each.
    pub(crate) fn retract(
        &mut self,
        interior: &Interior,
        model: &CostModel,
    ) -> Result<Built, BuildError> {
        let first = interior.first_ref;
        self.pairs.truncate(interior.pair);
        self.refs[first..].sort_unstable();
        let mut kept = first;
        for at in first..self.refs.len() {
            if at == first || self.refs[at] != self.refs[kept - 1] {
                self.refs[kept] = self.refs[at];
                kept += 1;
            }
        }
        self.refs.truncate(kept);
        self.leaf_from(first, model)
    }

    /// The leaf over all references from `first` on.
    fn leaf_from(&self, first: usize, model: &CostModel) -> Result<Built, BuildError> {
        let count = self.refs.len() - first;
        // All empty leaves are equal, independent of their position.
        let first = if count == 0 { 0 } else { first };
        let node = match (u32::try_from(first), u32::try_from(count)) {
            (Ok(first), Ok(count)) => Node::leaf(first, count),
            _ => None,
        };
        Ok(Built {
            node: node.ok_or_else(|| self.too_large())?,
            cost: model.leaf(count),
        })
    }

    /// Appends the output of another task and returns its root with relocated indices.
    pub(crate) fn append(&mut self, other: &Self, root: Built) -> Result<Built, BuildError> {
        let too_large = self.too_large();
        let (Ok(nodes), Ok(refs)) = (
            u32::try_from(2 * self.pairs.len()),
            u32::try_from(self.refs.len()),
        ) else {
            return Err(too_large);
        };
        // An empty leaf has no references, and stays equal to all other empty leaves.
        let relocated = |node: Node| {
            if node == Node::EMPTY_LEAF {
                Some(node)
            } else {
                node.relocated(nodes, refs)
            }
        };
        for pair in &other.pairs {
            let [Some(lower), Some(upper)] = pair.0.map(relocated) else {
                return Err(too_large);
            };
            self.pairs.push(Pair([lower, upper]));
        }
        self.refs.extend_from_slice(&other.refs);
        self.limited_cells += other.limited_cells;
        Ok(Built {
            node: relocated(root.node).ok_or(too_large)?,
            ..root
        })
    }

    fn too_large(&self) -> BuildError {
        BuildError::TooLarge(TreeError::TooLarge {
            nodes: 2 * self.pairs.len(),
            refs: self.refs.len(),
        })
    }
}
