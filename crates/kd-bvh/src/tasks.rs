//! Several things at once, where threads are there. What comes out never depends on them.

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

/// What `make` makes of 0, 1 … `count - 1`, in order.
#[cfg(feature = "parallel")]
pub(crate) fn collect<T: Send>(
    count: u32,
    is_parallel: bool,
    make: impl Fn(u32) -> T + Send + Sync,
) -> Vec<T> {
    use rayon::prelude::*;
    /// Some tens of microseconds, whatever is made.
    const PIECE: usize = 1 << 10;
    if is_parallel {
        let all = (0..count).into_par_iter().with_min_len(PIECE);
        all.map(make).collect()
    } else {
        (0..count).map(make).collect()
    }
}

/// What `make` makes of 0, 1 … `count - 1`, in order.
#[cfg(not(feature = "parallel"))]
pub(crate) fn collect<T>(count: u32, _: bool, make: impl Fn(u32) -> T) -> Vec<T> {
    (0..count).map(make).collect()
}

/// Sorts what has no two equals, so that there is one outcome.
#[cfg(feature = "parallel")]
pub(crate) fn sort<T: Ord + Send>(all: &mut [T], is_parallel: bool) {
    use rayon::prelude::*;
    if is_parallel {
        all.par_sort_unstable();
    } else {
        all.sort_unstable();
    }
}

/// Sorts what has no two equals, so that there is one outcome.
#[cfg(not(feature = "parallel"))]
pub(crate) fn sort<T: Ord>(all: &mut [T], _: bool) {
    all.sort_unstable();
}

/// Runs `work` with so many threads; 0 means those in scope.
#[cfg(feature = "parallel")]
pub(crate) fn with_threads<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> Result<R, BuildError> {
    // Starting threads takes a good part of a small build, so those that are there are used where the number is right.
    if threads == 1 || threads == 0 || threads == rayon::current_num_threads() {
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
