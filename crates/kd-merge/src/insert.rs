//! Sending primitives down a tree (Eleftheriades 2010, §3.5).

use kd_core::{Aabb, PrimSource, Slot};
use kd_sah::BuildError;

use crate::MergeOptions;
use crate::draft::{Draft, Subtree, View};
use crate::partition::{Slots, sides};

/// Primitives below which it does not pay to send those on either side down on a thread of their own.
const TASK: usize = 32;

/// Adds `slots`, which lie in `cell`, to what is below `subtree`; no path becomes longer than `depth`, as far as leaves that
/// are divided again make it so.
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
        View::Leaf(leaf) => {
            let mut all = Slots::from_slice(draft.refs_of(leaf));
            all.extend_from_slice(slots);
            all.sort_unstable();
            all.dedup();
            options.leaf(draft, source, &all, cell, depth)
        }
        View::Split { axis, split, parts } => {
            let [below, above] = sides(slots, source, cell, axis, split);
            let (lower, upper) = cell.split(axis, split);
            let depth = depth.saturating_sub(1);
            let [a, b] = parts;
            let parts = draft.both(
                options.is_parallel && below.len().min(above.len()) >= TASK,
                |draft| insert(draft, source, options, a, &below, &lower, depth),
                |draft| insert(draft, source, options, b, &above, &upper, depth),
            )?;
            Ok(draft.split(axis, split, parts))
        }
    }
}
