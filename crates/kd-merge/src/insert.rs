//! Sending primitives down a tree (Eleftheriades 2010, §3.5).

use kd_core::{Aabb, PrimSource, Slot};
use kd_sah::BuildError;

use crate::Resplit;
use crate::draft::{Draft, Subtree, View};
use crate::partition::{Slots, sides};

/// Adds `slots`, which lie in `cell`, to what is below `subtree`; no path becomes longer than `depth`, as far as leaves that
/// are divided again make it so.
pub(crate) fn insert(
    draft: &mut Draft<'_>,
    source: &impl PrimSource,
    resplit: &Resplit,
    subtree: Subtree,
    slots: &[Slot],
    cell: &Aabb,
    depth: usize,
) -> Result<Subtree, BuildError> {
    if slots.is_empty() {
        return Ok(subtree);
    }
    match draft.view(subtree) {
        View::Leaf(leaf) => {
            let mut all = Slots::from_slice(draft.refs_of(leaf));
            all.extend_from_slice(slots);
            all.sort_unstable();
            all.dedup();
            resplit.leaf(draft, source, &all, cell, depth)
        }
        View::Split { axis, split, parts } => {
            let [below, above] = sides(slots, source, cell, axis, split);
            let (lower, upper) = cell.split(axis, split);
            let depth = depth.saturating_sub(1);
            let [a, b] = parts;
            let a = insert(draft, source, resplit, a, &below, &lower, depth)?;
            let b = insert(draft, source, resplit, b, &above, &upper, depth)?;
            Ok(draft.split(axis, split, [a, b]))
        }
    }
}
