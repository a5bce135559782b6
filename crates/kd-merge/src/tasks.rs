//! Several things at once, where threads are there. What comes out never depends on them.

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

/// What `work` makes of each item, in order.
#[cfg(feature = "parallel")]
pub(crate) fn map<T: Sync, R: Send>(
    items: &[T],
    is_parallel: bool,
    work: impl Fn(&T) -> R + Send + Sync,
) -> Vec<R> {
    use rayon::prelude::*;
    if is_parallel {
        items.par_iter().map(work).collect()
    } else {
        items.iter().map(work).collect()
    }
}

/// What `work` makes of each item, in order.
#[cfg(not(feature = "parallel"))]
pub(crate) fn map<T, R>(items: &[T], _: bool, work: impl Fn(&T) -> R) -> Vec<R> {
    items.iter().map(work).collect()
}

/// Runs work that joins, in the pool of threads if it `is_parallel`.
#[cfg(feature = "parallel")]
pub(crate) fn in_pool<R: Send>(is_parallel: bool, work: impl FnOnce() -> R + Send) -> R {
    if is_parallel {
        rayon::scope(|_| work())
    } else {
        work()
    }
}

/// Runs work on this thread.
#[cfg(not(feature = "parallel"))]
pub(crate) fn in_pool<R>(_: bool, work: impl FnOnce() -> R) -> R {
    work()
}
