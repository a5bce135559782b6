//! Two things at once, where threads are there.

use crate::options::BuildError;

/// Runs both, possibly at the same time.
#[cfg(feature = "parallel")]
pub(crate) fn join<A: Send, B: Send>(
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    rayon::join(a, b)
}

/// Runs one, then the other.
#[cfg(not(feature = "parallel"))]
pub(crate) fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

/// Runs `work` with so many threads; 0 means those in scope.
#[cfg(feature = "parallel")]
pub(crate) fn with_threads<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> Result<R, BuildError> {
    if threads <= 1 {
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
