//! Dividing leaves that have too many references after a merge.

use kd_core::{Aabb, Axis, NodeIndex, NodeView, PrimSource, Slot, Tree};
use kd_sah::{BuildError, build};

use crate::MergeOptions;
use crate::draft::{Draft, Subtree};
use crate::partition::bounds_in;

impl MergeOptions {
    /// A leaf of `slots` in `cell`, or a subtree of at most `depth` levels if the leaf would be too large.
    pub(crate) fn leaf(
        &self,
        draft: &mut Draft<'_>,
        source: &impl PrimSource,
        slots: &[Slot],
        cell: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        if slots.len() <= self.max_leaf_size {
            return Ok(draft.leaf(slots));
        }
        self.rebuild(draft, source, slots, cell, depth)
    }

    /// A subtree of at most `depth` levels over `slots` in `cell`, for any number of slots.
    pub(crate) fn rebuild(
        &self,
        draft: &mut Draft<'_>,
        source: &impl PrimSource,
        slots: &[Slot],
        cell: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        if depth == 0 || slots.is_empty() {
            return Ok(draft.leaf(slots));
        }
        draft.counts.rebuilt += 1;
        let tree = self.build(source, slots, cell, depth)?;
        Ok(copy(draft, &tree, tree.root(), slots))
    }

    /// Builds a tree of at most `depth` levels over `slots` in `cell`. Its references are indices into `slots`.
    pub(crate) fn build(
        &self,
        source: &impl PrimSource,
        slots: &[Slot],
        cell: &Aabb,
        depth: usize,
    ) -> Result<Tree, BuildError> {
        let boxes = slots.iter().map(|slot| bounds_in(source, *slot, cell));
        let subset = ClippedSubset {
            source,
            slots,
            boxes: boxes.collect(),
        };
        let limit = self.builder.depth_limit(slots.len());
        let depth = u32::try_from(depth).map_or(limit, |depth| depth.min(limit));
        build(&subset, &self.builder.clone().with_max_depth(depth))
    }
}

/// Copies a subtree of `tree` into the draft. References of `tree` are indices into `slots`.
fn copy(draft: &mut Draft<'_>, tree: &Tree, index: NodeIndex, slots: &[Slot]) -> Subtree {
    let node = tree.nodes()[index.index()];
    match node.view() {
        NodeView::Leaf { .. } => {
            let refs = tree.leaf_refs(node).iter();
            let refs: Vec<Slot> = refs.map(|number| slots[number.index()]).collect();
            draft.leaf(&refs)
        }
        NodeView::Interior { axis, split, first } => {
            let children = [first, first.sibling()].map(|child| copy(draft, tree, child, slots));
            draft.split(axis, split, children)
        }
    }
}

/// Some primitives of a source, with their boxes clipped to a cell.
struct ClippedSubset<'a, S> {
    source: &'a S,
    slots: &'a [Slot],
    boxes: Vec<Aabb>,
}

impl<S: PrimSource> PrimSource for ClippedSubset<'_, S> {
    type Shape = S::Shape;

    fn count(&self) -> u32 {
        u32::try_from(self.slots.len()).expect("fewer than 2^32 slots")
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        self.boxes[primitive as usize]
    }

    fn shape(&self, primitive: u32) -> S::Shape {
        self.source.shape(self.slots[primitive as usize].0)
    }

    fn clipped_bounds(&self, shape: &S::Shape, cell: &Aabb) -> Option<Aabb> {
        self.source.clipped_bounds(shape, cell)
    }

    fn clipped_halves(
        &self,
        shape: &S::Shape,
        cell: &Aabb,
        axis: Axis,
        position: f32,
    ) -> [Option<Aabb>; 2] {
        self.source.clipped_halves(shape, cell, axis, position)
    }
}
