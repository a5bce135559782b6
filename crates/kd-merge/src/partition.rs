//! Cutting a tree in two at a plane: Eleftheriades 2010, §3.2 and algorithm 7.
//!
//! The listing never sets the plane of its new nodes, keeps nodes over two empty leaves, and destroys the tree. This
//! implementation sets the planes, removes such nodes, and links subtrees that the plane does not cross.

use kd_core::{Aabb, Axis, PrimSource, Slot};
use smallvec::SmallVec;

use crate::draft::{Draft, Leaf, Subtree, SubtreeView};

/// References of a leaf, or of one side of a plane in a leaf.
pub(crate) type Slots = SmallVec<[Slot; 32]>;

/// Cuts `subtree`, whose cell is `cell`, at a plane into the subtree below the plane and the subtree above it.
pub(crate) fn cut(
    draft: &mut Draft<'_>,
    source: &impl PrimSource,
    subtree: Subtree,
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Subtree; 2] {
    let (across, split, [lower, upper]) = match draft.view(subtree) {
        SubtreeView::Leaf(leaf) => {
            return cut_leaf(draft, source, subtree, leaf, cell, axis, position);
        }
        SubtreeView::Split {
            axis,
            split,
            children,
        } => (axis, split, children),
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

/// Cuts a leaf. A primitive that lies in the plane goes below it.
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
    // An unchanged leaf is linked instead of written again.
    [below, above].map(|side| {
        if side.len() == slots.len() {
            subtree
        } else {
            draft.leaf(&side)
        }
    })
}

/// Sorts primitives of a cell into those that reach below a plane and those that reach above it. A primitive may be in
/// both.
pub(crate) fn sides(
    slots: &[Slot],
    source: &impl PrimSource,
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Slots; 2] {
    let [mut below, mut above] = [Slots::new(), Slots::new()];
    for slot in slots {
        let bounds = bounds_in(source, *slot, cell);
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner[axis.index()]);
        if min < position || max <= position {
            below.push(*slot);
        }
        if max > position {
            above.push(*slot);
        }
    }
    [below, above]
}

/// The box around a primitive clipped to a cell; around the whole primitive if rounding leaves nothing of it.
pub(crate) fn bounds_in(source: &impl PrimSource, slot: Slot, cell: &Aabb) -> Aabb {
    let clipped = source.clipped_bounds(&source.shape(slot.0), cell);
    clipped.unwrap_or_else(|| source.bounds(slot.0))
}
