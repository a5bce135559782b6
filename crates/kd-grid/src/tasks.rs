//! Several things at once, where threads are there. What comes out never depends on them.

use crate::options::BuildError;

/// What `work` makes of each item, in order. The calling thread works too, and begins at once, while others are still being
/// woken; each thread has one scratch that it uses for all of its items.
#[cfg(feature = "parallel")]
pub(crate) fn map_in_place<T: Send, R: Send, S: Default>(
    items: Vec<T>,
    is_parallel: bool,
    work: impl Fn(&mut S, T) -> R + Send + Sync,
) -> Vec<R> {
    use std::sync::{Mutex, PoisonError};
    let count = items.len();
    let helpers = (threads() - 1).min(count.saturating_sub(1));
    if !is_parallel || helpers == 0 {
        let mut scratch = S::default();
        return items
            .into_iter()
            .map(|item| work(&mut scratch, item))
            .collect();
    }
    let queue = Mutex::new(items.into_iter().enumerate());
    let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
    let done = Mutex::new(Vec::with_capacity(count));
    let run = || {
        let mut scratch = S::default();
        while let Some((place, item)) = next() {
            let result = work(&mut scratch, item);
            let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
            done.push((place, result));
        }
    };
    rayon::in_place_scope(|scope| {
        for _ in 0..helpers {
            scope.spawn(|_| run());
        }
        run();
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_unstable_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, result)| result).collect()
}

/// How many threads there are in scope.
#[cfg(feature = "parallel")]
pub(crate) fn threads() -> usize {
    rayon::current_num_threads()
}

/// How many threads there are in scope.
#[cfg(not(feature = "parallel"))]
pub(crate) fn threads() -> usize {
    1
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
        return Ok(work());
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
