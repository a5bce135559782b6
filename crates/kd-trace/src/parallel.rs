//! Batches on all threads: divided into chunks, which are answered independently.

use kd_core::Ray;

/// Rays that a batch sorts together. A chunk has a multiple of them, so that tiles and windows are those of one batch.
const WINDOW: usize = 4096;
/// Chunks for each thread, so that threads that are slower or start later do less.
const PER_THREAD: usize = 8;
/// The longest chunk, in windows. Longer ones gain nothing.
const MOST_WINDOWS: usize = 16;

/// Rays of a chunk.
fn chunk_len(rays: usize) -> usize {
    let chunks = PER_THREAD * kd_tasks::threads();
    WINDOW * rays.div_ceil(WINDOW * chunks).clamp(1, MOST_WINDOWS)
}

/// Answers rays in chunks, on the threads of the pool in scope. `work` gets the number of its first ray, rays, and answers.
pub(crate) fn answer<A: Send>(
    rays: &[Ray],
    answers: &mut [A],
    work: impl Fn(usize, &[Ray], &mut [A]) + Sync + Send,
) {
    let len = chunk_len(rays.len());
    let chunks = rays.chunks(len).zip(answers.chunks_mut(len));
    let chunks = (0..).step_by(len).zip(chunks).collect();
    kd_tasks::map_in_place(chunks, true, |(): &mut (), (start, (rays, answers))| {
        work(start, rays, answers);
    });
}

/// The results of chunks, in order. `work` gets the number of its first ray, and rays.
pub(crate) fn map<R: Send>(
    rays: &[Ray],
    work: impl Fn(usize, &[Ray]) -> R + Sync + Send,
) -> Vec<R> {
    let len = chunk_len(rays.len());
    let chunks = (0..).step_by(len).zip(rays.chunks(len)).collect();
    kd_tasks::map_in_place(chunks, true, |(): &mut (), (start, rays)| work(start, rays))
}
