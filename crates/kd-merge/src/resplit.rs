//! Leaves that have become too full are divided again.

use kd_core::{Aabb, Axis, NodeIndex, NodeView, PrimSource, Slot, Tree};
use kd_sah::{BuildError, build};

use crate::MergeOptions;
use crate::draft::{Draft, Subtree};
use crate::partition::part_in;

impl MergeOptions {
    /// A leaf of `slots`, in `cell`, or what it is divided into, no deeper than `depth`.
    pub(crate) fn leaf(
        &self,
        draft: &mut Draft<'_>,
        source: &impl PrimSource,
        slots: &[Slot],
        cell: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        if slots.len() <= self.most_in_leaf {
            return Ok(draft.leaf(slots));
        }
        self.rebuild(draft, source, slots, cell, depth)
    }

    /// What `slots`, in `cell`, are divided into, no deeper than `depth`, however few there are.
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

    /// The tree of `slots`, in `cell`, no deeper than `depth`, whose primitives are numbered in their order.
    pub(crate) fn build(
        &self,
        source: &impl PrimSource,
        slots: &[Slot],
        cell: &Aabb,
        depth: usize,
    ) -> Result<Tree, BuildError> {
        let parts = slots.iter().map(|slot| part_in(source, *slot, cell));
        let some = Chosen {
            source,
            slots,
            parts: parts.collect(),
        };
        let usual = self.builder.depth_limit(slots.len());
        let depth = u32::try_from(depth).map_or(usual, |depth| depth.min(usual));
        build(&some, &self.builder.clone().with_max_depth(depth))
    }
}

/// Copies a subtree over some primitives, numbered in their order.
fn copy(draft: &mut Draft<'_>, tree: &Tree, place: NodeIndex, slots: &[Slot]) -> Subtree {
    let node = tree.nodes()[place.index()];
    match node.view() {
        NodeView::Leaf { .. } => {
            let refs = tree.leaf_refs(node).iter();
            let refs: Vec<Slot> = refs.map(|number| slots[number.index()]).collect();
            draft.leaf(&refs)
        }
        NodeView::Interior { axis, split, first } => {
            let parts = [first, first.sibling()].map(|child| copy(draft, tree, child, slots));
            draft.split(axis, split, parts)
        }
    }
}

/// Some of the primitives of a source, as they lie in a cell.
struct Chosen<'a, S> {
    source: &'a S,
    slots: &'a [Slot],
    parts: Vec<Aabb>,
}

impl<S: PrimSource> PrimSource for Chosen<'_, S> {
    type Shape = S::Shape;

    fn count(&self) -> u32 {
        u32::try_from(self.slots.len()).expect("no more than there are slots")
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        self.parts[primitive as usize]
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
