//! Several things at once, where threads are there. What comes out never depends on them.

use crate::options::BuildError;

/// What `work` makes of each item, in order.
#[cfg(feature = "parallel")]
pub(crate) fn map<T: Send, R: Send>(
    items: Vec<T>,
    parallel: bool,
    work: impl Fn(T) -> R + Send + Sync,
) -> Vec<R> {
    use rayon::prelude::*;
    if parallel && items.len() > 1 {
        items.into_par_iter().with_max_len(1).map(work).collect()
    } else {
        items.into_iter().map(work).collect()
    }
}

/// What `work` makes of each item, in order.
#[cfg(not(feature = "parallel"))]
pub(crate) fn map<T, R>(items: Vec<T>, _: bool, work: impl Fn(T) -> R) -> Vec<R> {
    items.into_iter().map(work).collect()
}

/// Runs `work` with so many threads; 0 means those in scope.
#[cfg(feature = "parallel")]
pub(crate) fn with_threads<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> Result<R, BuildError> {
    if threads == 1 {
        return Ok(work());
    }
    // Starting threads takes longer than a small grid, so those that are there are used where the number is right.
    if threads == 0 || threads == rayon::current_num_threads() {
        // Moves the work into the pool, which is woken up once, and not for each part of it.
        return Ok(rayon::scope(|_| work()));
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|error| BuildError::Threads {
            threads,
            reason: error.to_string(),
        })?;
    Ok(pool.install(work))
}

/// Runs `work` on this thread.
#[cfg(not(feature = "parallel"))]
pub(crate) fn with_threads<R>(_: usize, work: impl FnOnce() -> R) -> Result<R, BuildError> {
    Ok(work())
}
