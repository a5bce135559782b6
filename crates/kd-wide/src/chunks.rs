//! Reductions over many items in chunks, on one thread or several.

use crate::box_tree::Item;

/// Items of a chunk: some tens of microseconds of work.
const CHUNK: usize = 1 << 12;

/// Whether the items are at least two chunks.
pub(crate) fn are_many(items: &[Item]) -> bool {
    items.len() >= 2 * CHUNK
}

/// Reduces each chunk of the items, and combines the results in order. Parallel: on the threads of the pool in scope, where there
/// are at least two chunks. `combine` must be associative, and `of` of two chunks be the combination of both.
#[inline(always)]
pub(crate) fn reduce<R: Send>(
    items: &[Item],
    is_parallel: bool,
    of: impl Fn(&[Item]) -> R + Send + Sync,
    combine: impl Fn(R, R) -> R,
) -> R {
    if !is_parallel || !are_many(items) {
        return of(items);
    }
    let chunks = items.chunks(CHUNK).collect();
    let reduced = kd_tasks::map(chunks, true, of);
    let all = reduced.into_iter().reduce(combine);
    all.expect("at least two chunks")
}
