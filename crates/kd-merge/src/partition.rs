//! Cutting a tree in two at a plane: Eleftheriades 2010, §3.2 and algorithm 7.
//!
//! The listing never sets the plane of the nodes it makes, and leaves nodes over two empty leaves standing; here neither is
//! so. And it destroys the tree: here what the plane does not pass through is linked.

use kd_core::{Aabb, Axis, PrimSource, Slot};
use smallvec::SmallVec;

use crate::draft::{Draft, Leaf, Subtree, View};

/// References of a leaf, as they are sorted.
pub(crate) type Slots = SmallVec<[Slot; 32]>;

/// Cuts what is below `subtree`, in `cell`, at a plane: what is below the plane, and what is above.
pub(crate) fn cut(
    draft: &mut Draft<'_>,
    source: &impl PrimSource,
    subtree: Subtree,
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Subtree; 2] {
    let (across, split, [lower, upper]) = match draft.view(subtree) {
        View::Leaf(leaf) => return cut_leaf(draft, source, subtree, leaf, cell, axis, position),
        View::Split { axis, split, parts } => (axis, split, parts),
    };
    let (lower_cell, upper_cell) = cell.split(across, split);
    if across != axis {
        let lower = cut(draft, source, lower, &lower_cell, axis, position);
        let upper = cut(draft, source, upper, &upper_cell, axis, position);
        return [0, 1].map(|side| draft.split(across, split, [lower[side], upper[side]]));
    }
    if position < split {
        let [below, between] = cut(draft, source, lower, &lower_cell, axis, position);
        [below, draft.split(axis, split, [between, upper])]
    } else if position > split {
        let [between, above] = cut(draft, source, upper, &upper_cell, axis, position);
        [draft.split(axis, split, [lower, between]), above]
    } else {
        [lower, upper]
    }
}

/// A primitive that lies in the plane goes below it.
fn cut_leaf(
    draft: &mut Draft<'_>,
    source: &impl PrimSource,
    subtree: Subtree,
    leaf: Leaf,
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Subtree; 2] {
    let slots = Slots::from_slice(draft.refs_of(leaf));
    let [below, above] = sides(&slots, source, cell, axis, position);
    // What is as it was is linked, and not written again.
    [below, above].map(|part| {
        if part.len() == slots.len() {
            subtree
        } else {
            draft.leaf(&part)
        }
    })
}

/// The primitives, of those in a cell, that reach below a plane, and those that reach above it.
pub(crate) fn sides(
    slots: &[Slot],
    source: &impl PrimSource,
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Slots; 2] {
    let [mut below, mut above] = [Slots::new(), Slots::new()];
    for slot in slots {
        let part = part_in(source, *slot, cell);
        let [min, max] = [part.min, part.max].map(|corner| corner[axis.index()]);
        if min < position || max <= position {
            below.push(*slot);
        }
        if max > position {
            above.push(*slot);
        }
    }
    [below, above]
}

/// The box around the part of a primitive in a cell; around all of it where rounding leaves no part.
pub(crate) fn part_in(source: &impl PrimSource, slot: Slot, cell: &Aabb) -> Aabb {
    let part = source.clipped_bounds(&source.shape(slot.0), cell);
    part.unwrap_or_else(|| source.bounds(slot.0))
}
