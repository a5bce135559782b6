//! Several things at once, where threads are there. What comes out never depends on them.
//!
//! Builders do large parts of their work side by side. They ask for it here, and need not know whether there are threads:
//! without the feature `parallel` (rayon, on by default) everything is done on the calling one, in turn.
//!
//! ```
//! let squares = kd_tasks::with_threads(2, || kd_tasks::map(vec![1, 2, 3], true, |x| x * x))?;
//! assert_eq!(squares, [1, 4, 9]);
//!
//! // Each thread has a list of its own, which it uses again.
//! let words = vec!["kd", "tree"];
//! let sorted = kd_tasks::map_in_place(words, true, |letters: &mut Vec<char>, word| {
//!     letters.clear();
//!     letters.extend(word.chars());
//!     letters.sort_unstable();
//!     letters.iter().collect::<String>()
//! });
//! assert_eq!(sorted, ["dk", "eert"]);
//! # Ok::<(), kd_tasks::ThreadsError>(())
//! ```
//!
//! The threads are those of the pool in scope: one that [`with_threads`] has made, or rayon's, of as many as there are cores.
//! A pool that has nothing to do sleeps, and takes about as long to wake as a small build takes. [`in_pool_of`] and [`in_pool`]
//! wait for that once, and are for work that joins often; [`map_in_place`] begins without waiting.
//!
//! Where a function asks whether it `is_parallel`, `false` does the same on the calling thread.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(feature = "parallel"),
    allow(unused_variables, reason = "how many may work matters to rayon alone")
)]

#[cfg(feature = "parallel")]
use std::sync::{Mutex, PoisonError};

#[cfg(feature = "parallel")]
use rayon::prelude::*;
use thiserror::Error;

/// Threads that were asked for and could not be started.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("cannot start {threads} threads: {reason}")]
pub struct ThreadsError {
    /// How many were asked for.
    pub threads: usize,
    /// Why they are not there: mostly what the system said.
    pub reason: String,
}

/// How many threads there are in scope.
pub fn threads() -> usize {
    #[cfg(feature = "parallel")]
    {
        rayon::current_num_threads()
    }
    #[cfg(not(feature = "parallel"))]
    {
        1
    }
}

/// Runs `work` with so many threads in scope; 0 means those that are there, 1 the calling one alone, if the work asks for no others.
/// Without feature `parallel` it is always that.
///
/// # Errors
///
/// If so many cannot be started.
pub fn with_threads<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> Result<R, ThreadsError> {
    // Starting threads takes a good part of a small build, so those that are there are used where the number is right.
    #[cfg(feature = "parallel")]
    if threads > 1 && threads != rayon::current_num_threads() {
        return Ok(pool(threads)?.install(work));
    }
    Ok(work())
}

/// Runs work that joins in a pool of so many threads; 0 means the one in scope, 1 the calling thread.
///
/// # Errors
///
/// As [`with_threads`].
pub fn in_pool_of<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> Result<R, ThreadsError> {
    with_threads(threads, || in_pool(threads != 1, work))
}

/// So many new threads.
#[cfg(feature = "parallel")]
fn pool(threads: usize) -> Result<rayon::ThreadPool, ThreadsError> {
    let refused = |reason| ThreadsError { threads, reason };
    let most = rayon::max_num_threads();
    // Rayon would start the most there can be.
    if threads > most {
        return Err(refused(format!("{most} are the most")));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| refused(error.to_string()))
}

/// Runs work that joins, in the pool of threads if it `is_parallel`: it moves there once, so that joining does not have to.
pub fn in_pool<R: Send>(is_parallel: bool, work: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if is_parallel {
        return rayon::scope(|_| work());
    }
    work()
}

/// Runs both, possibly at the same time. The second is told whether another thread took it.
pub fn join<A: Send, B: Send>(
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce(bool) -> B + Send,
) -> (A, B) {
    #[cfg(feature = "parallel")]
    {
        rayon::join_context(|_| a(), |context| b(context.migrated()))
    }
    #[cfg(not(feature = "parallel"))]
    {
        (a(), b(false))
    }
}

/// Runs both and returns both results; at the same time if `is_parallel`, otherwise `a` before `b`.
pub fn join_if<A: Send, B: Send>(
    is_parallel: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    #[cfg(feature = "parallel")]
    if is_parallel {
        return rayon::join(a, b);
    }
    (a(), b())
}

/// What `work` makes of each item, in order. An item is a task: for few and large ones.
pub fn map<T: Send, R: Send>(
    items: Vec<T>,
    is_parallel: bool,
    work: impl Fn(T) -> R + Send + Sync,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if is_parallel && items.len() > 1 {
        return items.into_par_iter().with_max_len(1).map(work).collect();
    }
    items.into_iter().map(work).collect()
}

/// What `work` makes of each item, in order. The calling thread works too, and begins at once, while others are still being
/// woken; each thread mostly has one scratch, made by `S::default()`, that it uses for all of its items.
///
/// From outside the pool [`map`] waits until that is awake before anything is done. At the end this waits as well, even for a
/// thread that comes when nothing is left to do.
///
/// If `work` panics, so does this, when no other thread works on it any more.
pub fn map_in_place<T: Send, R: Send, S: Default>(
    items: Vec<T>,
    is_parallel: bool,
    work: impl Fn(&mut S, T) -> R + Send + Sync,
) -> Vec<R> {
    #[cfg(feature = "parallel")]
    if is_parallel && items.len() > 1 {
        let helpers = (rayon::current_num_threads() - 1).min(items.len() - 1);
        if helpers > 0 {
            return map_with_helpers(items, helpers, &work);
        }
    }
    let mut scratch = S::default();
    let items = items.into_iter();
    items.map(|item| work(&mut scratch, item)).collect()
}

/// [`map_in_place`] with so many threads beside the calling one.
#[cfg(feature = "parallel")]
fn map_with_helpers<T: Send, R: Send, S: Default>(
    items: Vec<T>,
    helpers: usize,
    work: &(impl Fn(&mut S, T) -> R + Sync),
) -> Vec<R> {
    let done = Mutex::new(Vec::with_capacity(items.len()));
    let queue = Mutex::new(items.into_iter().enumerate());
    // Nobody works while holding a lock, so that what panics leaves none poisoned.
    let next = || {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        queue.next()
    };
    let run = || {
        let mut scratch = S::default();
        let mut own = Vec::new();
        while let Some((place, item)) = next() {
            own.push((place, work(&mut scratch, item)));
        }
        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
        done.append(&mut own);
    };
    // Unlike `scope`, which waits for the pool to take what it is given, if the caller is outside.
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

/// What `make` makes of 0, 1 … `count - 1`, in order. For many small things, of which a thread makes a thousand or more at a time.
pub fn collect<T: Send>(
    count: u32,
    is_parallel: bool,
    make: impl Fn(u32) -> T + Send + Sync,
) -> Vec<T> {
    #[cfg(feature = "parallel")]
    if is_parallel {
        /// Some tens of microseconds, whatever is made.
        const PIECE: usize = 1 << 10;
        let all = (0..count).into_par_iter().with_min_len(PIECE);
        return all.map(make).collect();
    }
    (0..count).map(make).collect()
}

/// Sorts what has no two equals, so that there is one outcome.
pub fn sort<T: Ord + Send>(all: &mut [T], is_parallel: bool) {
    #[cfg(feature = "parallel")]
    if is_parallel {
        all.par_sort_unstable();
        return;
    }
    all.sort_unstable();
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    /// What every function makes, with so many threads.
    fn made(threads: usize, is_parallel: bool) -> Vec<Vec<u32>> {
        let work = || {
            let items: Vec<u32> = (0..100).collect();
            let mapped = map(items.clone(), is_parallel, |x| 3 * x);
            let in_place = map_in_place(items, is_parallel, |scratch: &mut Vec<u32>, x| {
                scratch.clear();
                scratch.extend(0..x);
                scratch.iter().sum()
            });
            let collected = collect(10_000, is_parallel, |x| x ^ 0x2a);
            let mut sorted: Vec<u32> = (0..10_000).rev().collect();
            sort(&mut sorted, is_parallel);
            let (a, b) = join(|| vec![1], |_| vec![2]);
            let (c, d) = join_if(is_parallel, || vec![5], || vec![6]);
            let moved = in_pool(is_parallel, || vec![3]);
            let moved_to = in_pool_of(if is_parallel { 2 } else { 1 }, || vec![4]).expect("two");
            vec![
                mapped, in_place, collected, sorted, a, b, c, d, moved, moved_to,
            ]
        };
        with_threads(threads, work).expect("a few threads")
    }

    #[test]
    fn results_are_in_order_whoever_works() {
        let expected: [Vec<u32>; 10] = [
            (0..100).map(|x| 3 * x).collect(),
            (0..100).map(|x: u32| x * x.saturating_sub(1) / 2).collect(),
            (0..10_000).map(|x| x ^ 0x2a).collect(),
            (0..10_000).collect(),
            vec![1],
            vec![2],
            vec![5],
            vec![6],
            vec![3],
            vec![4],
        ];
        for threads in [0, 1, 2, 3, 8] {
            for is_parallel in [false, true] {
                let made = made(threads, is_parallel);
                assert_eq!(made, expected, "{threads} threads, parallel: {is_parallel}");
            }
        }
    }

    #[test]
    fn nothing_is_made_of_nothing() {
        for count in [0, 1] {
            let items = vec![7; count];
            assert_eq!(map(items.clone(), true, |x| x), items, "map");
            let in_place = map_in_place(items.clone(), true, |_: &mut (), x| x);
            assert_eq!(in_place, items, "in place");
        }
        assert!(collect(0, true, |x| x).is_empty(), "collected");
        sort::<u32>(&mut [], true);
    }

    #[test]
    fn there_are_as_many_threads_as_asked_for() {
        let in_scope = threads();
        let counted = |threads| with_threads(threads, super::threads).expect("a few threads");
        let available = |threads| {
            if cfg!(feature = "parallel") {
                threads
            } else {
                1
            }
        };
        for asked in [2, 3] {
            assert_eq!(counted(asked), available(asked), "{asked} threads");
            let nested = with_threads(asked, || counted(asked + 1)).expect("a few threads");
            assert_eq!(nested, available(asked + 1), "the inner number counts");
        }
        assert_eq!(counted(0), in_scope, "those in scope");
        let here = std::thread::current().id();
        let there = with_threads(1, || std::thread::current().id());
        assert_eq!(there, Ok(here), "one is the calling one");
    }

    #[test]
    fn a_thread_has_one_scratch() {
        static MADE: AtomicUsize = AtomicUsize::new(0);
        struct Scratch(usize);
        impl Default for Scratch {
            fn default() -> Self {
                MADE.fetch_add(1, Ordering::Relaxed);
                Self(0)
            }
        }
        let use_of = |is_parallel| {
            map_in_place(vec![(); 50], is_parallel, |scratch: &mut Scratch, ()| {
                scratch.0 += 1;
                scratch.0
            })
        };
        let alone: Vec<usize> = (1..=50).collect();
        assert_eq!(use_of(false), alone, "one for all items");
        assert_eq!(MADE.swap(0, Ordering::Relaxed), 1, "one thread");

        let shared = with_threads(3, || use_of(true)).expect("three threads");
        let users = shared.iter().filter(|uses| **uses == 1).count();
        let made = MADE.load(Ordering::Relaxed);
        assert!(users <= made && made <= 3, "{users} of {made} are used");
    }

    #[cfg(feature = "parallel")]
    mod parallel {
        use std::panic::catch_unwind;
        use std::sync::Barrier;
        use std::thread;

        use super::*;

        #[test]
        fn wrong_numbers_of_threads_are_refused() {
            for threads in [rayon::max_num_threads() + 1, usize::MAX] {
                let error = with_threads(threads, || ()).expect_err("far too many");
                assert_eq!(error.threads, threads, "the number is told");
                let message = format!("cannot start {threads} threads: {}", error.reason);
                assert_eq!(error.to_string(), message, "the message tells why");
            }
        }

        #[test]
        fn the_second_is_told_who_takes_it() {
            let both = Barrier::new(2);
            let wait = |is_taken| {
                both.wait();
                is_taken
            };
            let (_, is_taken) = with_threads(2, || join(|| wait(false), wait)).expect("two");
            assert!(is_taken, "the first waits for the second");
        }

        #[test]
        fn the_calling_thread_works_too() {
            // From outside the pool. Two items wait for each other, if there are two threads, so that each has one.
            let count = threads().min(2);
            let all = Barrier::new(count);
            let who = map_in_place(vec![(); count], true, |_: &mut (), ()| {
                all.wait();
                thread::current().id()
            });
            let own = who.iter().filter(|id| **id == thread::current().id());
            assert_eq!(own.count(), 1, "one of {count}");
        }

        #[test]
        fn a_panic_is_passed_on_whoever_panics() {
            for is_caller in [false, true] {
                let outcome = catch_unwind(|| {
                    with_threads(2, || {
                        let caller = thread::current().id();
                        let both = Barrier::new(2);
                        map_in_place((0..10).collect(), true, |_: &mut (), item| {
                            // Both threads have one of the first two.
                            if item < 2 {
                                both.wait();
                            }
                            let is_here = thread::current().id() == caller;
                            assert_ne!(is_here, is_caller, "as it should be");
                        })
                    })
                });
                let why = outcome.expect_err("one of two has panicked");
                let why = why.downcast::<String>().expect("of an assertion");
                assert!(why.contains("as it should be"), "{why}");
            }
        }
    }
}
