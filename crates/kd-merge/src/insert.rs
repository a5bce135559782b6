//! Inserting primitives into a tree (Eleftheriades 2010, §3.5).

use kd_core::{Aabb, PrimSource, Slot};
use kd_sah::BuildError;

use crate::MergeOptions;
use crate::draft::{Draft, Subtree, SubtreeView};
use crate::partition::{Slots, sides};

/// The smallest number of primitives on each side of a plane for which the two sides run on two threads.
const MIN_TASK: usize = 32;

/// Adds `slots`, which lie in `cell`, to the leaves of `subtree`. Leaves that are divided again stay within `depth` levels
/// below the root of `subtree`.
pub(crate) fn insert(
    draft: &mut Draft<'_>,
    source: &impl PrimSource,
    options: &MergeOptions,
    subtree: Subtree,
    slots: &[Slot],
    cell: &Aabb,
    depth: usize,
) -> Result<Subtree, BuildError> {
    if slots.is_empty() {
        return Ok(subtree);
    }
    match draft.view(subtree) {
        SubtreeView::Leaf(leaf) => {
            let mut all = Slots::from_slice(draft.refs_of(leaf));
            all.extend_from_slice(slots);
            all.sort_unstable();
            all.dedup();
            options.leaf(draft, source, &all, cell, depth)
        }
        SubtreeView::Split {
            axis,
            split,
            children,
        } => {
            let [below, above] = sides(slots, source, cell, axis, split);
            let (lower, upper) = cell.split(axis, split);
            let depth = depth.saturating_sub(1);
            let [a, b] = children;
            let children = draft.both(
                options.is_parallel && below.len().min(above.len()) >= MIN_TASK,
                |draft| insert(draft, source, options, a, &below, &lower, depth),
                |draft| insert(draft, source, options, b, &above, &upper, depth),
            )?;
            Ok(draft.split(axis, split, children))
        }
    }
}
