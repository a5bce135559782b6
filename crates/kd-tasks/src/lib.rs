//! Parallel maps, joins and sorts, and the progress of long work. Results never depend on the number of threads.
//!
//! Builders run large parts of their work in parallel through this crate, so that they contain no conditional compilation.
//! Without the feature `parallel` (rayon, on by default) every function runs sequentially on the calling thread.
//!
//! ```
//! let squares = kd_tasks::with_threads(2, || kd_tasks::map(vec![1, 2, 3], true, |x| x * x))?;
//! assert_eq!(squares, [1, 4, 9]);
//!
//! // Each thread has its own scratch list and reuses it for every item.
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
//! Work runs in the pool in scope: the one that [`with_threads`] started, or rayon's global pool with one thread per core.
//! An idle pool sleeps, and waking it takes about as long as a small build. [`in_pool_of`] and [`in_pool`] pay for waking
//! once and suit work that joins often; [`map_in_place`] starts on the calling thread without waiting.
//!
//! Functions with a parameter `is_parallel` do the same work sequentially on the calling thread if it is `false`.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(feature = "parallel"),
    allow(unused_variables, reason = "only rayon needs the number of threads")
)]

mod progress;

#[cfg(feature = "parallel")]
use std::sync::{Mutex, PoisonError};

#[cfg(feature = "parallel")]
use rayon::prelude::*;
use thiserror::Error;

pub use progress::{Cancelled, Progress, Share, Tracker};

/// The requested number of threads could not be started.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("cannot start {threads} threads: {reason}")]
pub struct ThreadsError {
    /// The requested number of threads.
    pub threads: usize,
    /// The cause: usually the error of the operating system.
    pub reason: String,
}

/// The number of threads of the pool in scope; 1 without the feature `parallel`.
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

/// Items of a thread that are worth starting it, and threads that a core can keep busy.
const ITEMS_OF_A_THREAD: usize = 256;
const THREADS_OF_A_CORE: usize = 8;

/// How many of `threads` requested threads work on this number of items can use: at least 2 if 2 and more are requested, so that
/// there is a pool. More would take longer to start than the work takes. A number that cannot be started stays, and is refused by
/// [`with_threads`].
///
/// ```
/// assert_eq!(kd_tasks::useful_threads(1000, 300), 2);
/// assert_eq!(kd_tasks::useful_threads(1, 1_000_000), 1);
/// # #[cfg(feature = "parallel")]
/// assert_eq!(kd_tasks::useful_threads(usize::MAX, 300), usize::MAX, "refused later");
/// ```
pub fn useful_threads(threads: usize, items: usize) -> usize {
    #[cfg(feature = "parallel")]
    let most_started = rayon::max_num_threads();
    #[cfg(not(feature = "parallel"))]
    let most_started = usize::MAX;
    // Asking for the number of cores reads files of the system, which takes longer than a small build.
    if threads <= 2 || threads > most_started {
        return threads;
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let most = (items / ITEMS_OF_A_THREAD).min(THREADS_OF_A_CORE * cores);
    threads.min(most.max(2))
}

/// Runs `work` with a pool of `threads` threads in scope. 0 keeps the pool in scope. 1 runs `work` on the calling thread
/// without starting a pool; functions that it calls must then be given `is_parallel = false`.
///
/// Starts and ends a pool, unless the pool in scope already has `threads` threads. Without the feature `parallel`, `work`
/// runs on the calling thread for any number.
///
/// # Errors
///
/// [`ThreadsError`] if the threads cannot be started, or if `threads` exceeds rayon's maximum.
pub fn with_threads<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> Result<R, ThreadsError> {
    // Starting threads costs a large fraction of a small build, so a pool of the right size is reused.
    #[cfg(feature = "parallel")]
    if threads > 1 && threads != rayon::current_num_threads() {
        return Ok(pool(threads)?.install(work));
    }
    Ok(work())
}

/// Runs `work`, which joins often, inside a pool of `threads` threads. 0 uses the pool in scope, 1 the calling thread.
///
/// # Errors
///
/// Those of [`with_threads`].
pub fn in_pool_of<R: Send>(
    threads: usize,
    work: impl FnOnce() -> R + Send,
) -> Result<R, ThreadsError> {
    with_threads(threads, || in_pool(threads != 1, work))
}

/// A new pool of `threads` threads.
#[cfg(feature = "parallel")]
fn pool(threads: usize) -> Result<rayon::ThreadPool, ThreadsError> {
    let refused = |reason| ThreadsError { threads, reason };
    let most = rayon::max_num_threads();
    // Rayon would silently start its maximum instead.
    if threads > most {
        return Err(refused(format!("the maximum is {most}")));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| refused(error.to_string()))
}

/// Runs `work`, which joins often, inside the pool in scope if `is_parallel`. The work moves into the pool once, so that
/// its joins need not.
pub fn in_pool<R: Send>(is_parallel: bool, work: impl FnOnce() -> R + Send) -> R {
    #[cfg(feature = "parallel")]
    if is_parallel {
        return rayon::scope(|_| work());
    }
    work()
}

/// Runs both closures, possibly at the same time, and returns both results. `b` receives whether another thread runs it.
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

/// Applies `work` to each item; results are in the order of the items. Each item is one task, so items should be few and
/// large.
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

/// Applies `work` to each item; results are in the order of the items. The calling thread takes items too, and starts
/// while the other threads are still waking up.
///
/// In general each thread makes one scratch by `S::default()` and reuses it for all of its items.
///
/// Called from outside the pool, [`map`] starts only when the pool is awake; this function does not wait at the start. At
/// the end it waits for every thread, including one that wakes when no item is left.
///
/// # Panics
///
/// If `work` panics, after all other threads have finished their items.
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

/// [`map_in_place`] on the calling thread and `helpers` others.
#[cfg(feature = "parallel")]
fn map_with_helpers<T: Send, R: Send, S: Default>(
    items: Vec<T>,
    helpers: usize,
    work: &(impl Fn(&mut S, T) -> R + Sync),
) -> Vec<R> {
    let done = Mutex::new(Vec::with_capacity(items.len()));
    let queue = Mutex::new(items.into_iter().enumerate());
    // No thread runs `work` while it holds a lock, so that a panic in `work` poisons none.
    let next = || {
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        queue.next()
    };
    let run = || {
        let mut scratch = S::default();
        let mut own = Vec::new();
        while let Some((index, item)) = next() {
            own.push((index, work(&mut scratch, item)));
        }
        let mut done = done.lock().unwrap_or_else(PoisonError::into_inner);
        done.append(&mut own);
    };
    // `scope` would wait for the pool to start the task if the caller is outside of the pool.
    rayon::in_place_scope(|scope| {
        for _ in 0..helpers {
            scope.spawn(|_| run());
        }
        run();
    });
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_unstable_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}

/// Applies `make` to 0, 1 … `count - 1`; results are in that order. Suits many small items: a task makes 1024 or more.
pub fn collect<T: Send>(
    count: u32,
    is_parallel: bool,
    make: impl Fn(u32) -> T + Send + Sync,
) -> Vec<T> {
    #[cfg(feature = "parallel")]
    if is_parallel {
        /// Smallest number of items of a task, some tens of microseconds of work.
        const ITEMS_PER_TASK: usize = 1 << 10;
        let all = (0..count).into_par_iter().with_min_len(ITEMS_PER_TASK);
        return all.map(make).collect();
    }
    (0..count).map(make).collect()
}

/// Sorts items of which no two are equal, so that the sorted order is unique. The sort is unstable.
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

    /// The results of every function, with `threads` threads in scope.
    fn results(threads: usize, is_parallel: bool) -> Vec<Vec<u32>> {
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
    fn results_do_not_depend_on_threads() {
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
                let results = results(threads, is_parallel);
                assert_eq!(
                    results, expected,
                    "{threads} threads, parallel: {is_parallel}"
                );
            }
        }
    }

    #[test]
    fn empty_and_single_inputs_work() {
        for count in [0, 1] {
            let items = vec![7; count];
            assert_eq!(map(items.clone(), true, |x| x), items, "map");
            let in_place = map_in_place(items.clone(), true, |_: &mut (), x| x);
            assert_eq!(in_place, items, "map_in_place");
        }
        assert!(collect(0, true, |x| x).is_empty(), "collect");
        sort::<u32>(&mut [], true);
    }

    #[test]
    fn the_pool_has_the_requested_number_of_threads() {
        let in_scope = threads();
        let counted = |threads| with_threads(threads, super::threads).expect("a few threads");
        let available = |threads| {
            if cfg!(feature = "parallel") {
                threads
            } else {
                1
            }
        };
        for requested in [2, 3] {
            assert_eq!(
                counted(requested),
                available(requested),
                "{requested} threads"
            );
            let nested = with_threads(requested, || counted(requested + 1)).expect("a few threads");
            assert_eq!(
                nested,
                available(requested + 1),
                "the inner pool is in scope"
            );
        }
        assert_eq!(counted(0), in_scope, "0 keeps the pool in scope");
        let here = std::thread::current().id();
        let there = with_threads(1, || std::thread::current().id());
        assert_eq!(there, Ok(here), "1 uses the calling thread");
    }

    #[test]
    fn each_thread_reuses_one_scratch() {
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
        assert_eq!(use_of(false), alone, "one scratch for all items");
        assert_eq!(
            MADE.swap(0, Ordering::Relaxed),
            1,
            "one thread, one scratch"
        );

        let shared = with_threads(3, || use_of(true)).expect("three threads");
        let users = shared.iter().filter(|uses| **uses == 1).count();
        let made = MADE.load(Ordering::Relaxed);
        assert!(
            users <= made && made <= 3,
            "{users} scratches used, {made} made"
        );
    }

    #[cfg(feature = "parallel")]
    mod parallel {
        use std::panic::catch_unwind;
        use std::sync::Barrier;
        use std::thread;

        use super::*;

        #[test]
        fn too_many_threads_are_refused() {
            for threads in [rayon::max_num_threads() + 1, usize::MAX] {
                let error = with_threads(threads, || ()).expect_err("far too many");
                assert_eq!(error.threads, threads, "the error holds the number");
                let message = format!("cannot start {threads} threads: {}", error.reason);
                assert_eq!(error.to_string(), message, "the message gives the reason");
            }
        }

        #[test]
        fn join_reports_whether_another_thread_runs_the_second() {
            let both = Barrier::new(2);
            let wait = |is_taken| {
                both.wait();
                is_taken
            };
            let (_, is_taken) = with_threads(2, || join(|| wait(false), wait)).expect("two");
            assert!(is_taken, "both closures wait for each other on two threads");
        }

        #[test]
        fn the_calling_thread_takes_items() {
            // Called from outside the pool. With two threads, two items wait for each other, so that each thread has one.
            let count = threads().min(2);
            let all = Barrier::new(count);
            let who = map_in_place(vec![(); count], true, |_: &mut (), ()| {
                all.wait();
                thread::current().id()
            });
            let own = who.iter().filter(|id| **id == thread::current().id());
            assert_eq!(own.count(), 1, "one item of {count} is its own");
        }

        #[test]
        fn a_panic_on_any_thread_reaches_the_caller() {
            for is_caller in [false, true] {
                let outcome = catch_unwind(|| {
                    with_threads(2, || {
                        let caller = thread::current().id();
                        let both = Barrier::new(2);
                        map_in_place((0..10).collect(), true, |_: &mut (), item| {
                            // Each thread has one of the first two items.
                            if item < 2 {
                                both.wait();
                            }
                            let is_here = thread::current().id() == caller;
                            assert_ne!(is_here, is_caller, "intended panic");
                        })
                    })
                });
                let panic = outcome.expect_err("one of two threads has panicked");
                let message = panic
                    .downcast::<String>()
                    .expect("the message of the assertion");
                assert!(message.contains("intended panic"), "{message}");
            }
        }
    }
}
