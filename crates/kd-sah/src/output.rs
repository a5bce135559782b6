//! Nodes and references as they are made, before they are a tree.

use kd_core::{CostModel, Node, NodeIndex, Pair, Slot, TreeError};

use crate::cell::Place;
use crate::options::BuildError;
use crate::plane::Plane;

/// Nodes below some root, indices counting from 0, in depth-first order: a pair, all below its lower node, all below
/// its upper node. The order does not depend on which thread built what.
#[derive(Debug, Default)]
pub(crate) struct Output {
    pub(crate) pairs: Vec<Pair>,
    pub(crate) refs: Vec<Slot>,
    /// Cells that were not divided for lack of references, those in subtrees that were taken back included.
    pub(crate) limited_cells: usize,
}

/// A finished node, not yet put in its place, and its expected cost for a ray that enters it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Built {
    pub(crate) node: Node,
    pub(crate) cost: f64,
}

/// An interior node whose subtrees are being built.
#[derive(Debug)]
pub(crate) struct Interior {
    /// Where its children go, and where the references below it start.
    pair: usize,
    first_ref: usize,
    /// Of entering each child, for a ray that enters the node.
    chances: [f64; 2],
}

impl Interior {
    /// Makes room for the children.
    pub(crate) fn begin(place: &Place, parts: &[Place; 2], output: &mut Output) -> Self {
        let half_area = place.bounds.half_area();
        let interior = Self {
            pair: output.pairs.len(),
            first_ref: output.refs.len(),
            chances: [0, 1].map(|side: usize| parts[side].bounds.half_area() / half_area),
        };
        output.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
        interior
    }

    /// What a ray is expected to pay in the children.
    pub(crate) fn cost_below(&self, [lower, upper]: &[Built; 2]) -> f64 {
        self.chances[0] * lower.cost + self.chances[1] * upper.cost
    }
}

impl Output {
    /// A leaf with these references.
    pub(crate) fn leaf(
        &mut self,
        refs: impl Iterator<Item = Slot>,
        model: &CostModel,
    ) -> Result<Built, BuildError> {
        let first = self.refs.len();
        self.refs.extend(refs);
        self.leaf_from(first, model)
    }

    /// Puts the children of an interior node in their places.
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

    /// Takes back everything below an interior node: its references, once each, become a leaf.
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
        // Empty leaves are all the same, wherever they stand.
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

    /// Appends what another task built, and gives its root as seen from here.
    pub(crate) fn append(&mut self, other: &Self, root: Built) -> Result<Built, BuildError> {
        let too_large = self.too_large();
        let (Ok(nodes), Ok(refs)) = (
            u32::try_from(2 * self.pairs.len()),
            u32::try_from(self.refs.len()),
        ) else {
            return Err(too_large);
        };
        // An empty leaf has nothing to point to, and stays equal to every other.
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
