//! The threads that work, and work that `Ctrl-C` ends.

use std::collections::HashMap;
use std::mem;
use std::ops::ControlFlow;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use kd::build::BuildProgress;
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::wrong_value;

/// How many threads work: all, or a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Threads(Option<usize>);

/// Rays or points that one thread answers sooner than others wake up.
const FEW: usize = 256;
/// Rows of an array that take longer to read than a thread takes to start.
const LEAST_OF_A_PIECE: usize = 1 << 14;
/// Threads that read arrays as fast as memory lets them.
const MOST_PIECES: usize = 8;
/// Runs of rays whose answers take longer to copy than a thread takes to start.
const LEAST_ITEMS: usize = 16;
/// The time between two looks at signals and progress.
const TICK: Duration = Duration::from_millis(40);

impl Threads {
    pub(crate) fn new(threads: Option<usize>) -> PyResult<Self> {
        match threads {
            Some(0) => Err(wrong_value(
                "threads",
                "expected at least 1, or None for all",
            )),
            Some(number) if number > rayon::max_num_threads() => Err(wrong_value(
                "threads",
                format_args!("expected at most {}", rayon::max_num_threads()),
            )),
            _ => Ok(Self(threads)),
        }
    }

    pub(crate) fn number(self) -> Option<usize> {
        self.0
    }

    /// How many threads there are at most.
    pub(crate) fn most(self) -> usize {
        let cores = || thread::available_parallelism().map_or(1, usize::from);
        self.0.unwrap_or_else(cores)
    }

    /// Those who answer `items` rays or points. Called with the interpreter's lock held.
    pub(crate) fn for_items(self, items: usize) -> PyResult<Workers> {
        if self.0 == Some(1) || items < FEW {
            return Ok(Workers(None));
        }
        let number = self.most();
        if number == 1 {
            return Ok(Workers(None));
        }
        pool(number).map(|pool| Workers(Some(pool)))
    }

    /// Those who build.
    pub(crate) fn for_build(self) -> PyResult<Workers> {
        self.for_items(usize::MAX)
    }
}

/// The calling thread, or a pool.
#[derive(Debug)]
pub(crate) struct Workers(Option<Arc<ThreadPool>>);

impl Workers {
    /// Whether there are several.
    pub(crate) fn are_several(&self) -> bool {
        self.0.is_some()
    }

    pub(crate) fn number(&self) -> usize {
        self.0.as_ref().map_or(1, |pool| pool.current_num_threads())
    }

    /// Runs work with these threads in scope.
    pub(crate) fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.0 {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }
}

/// Pools that were started, by their number of threads, and the process that they are of.
///
/// A process made by `fork` has none of the threads of its parent: it starts its own, and leaves the parent's memory as it is.
struct Pools {
    process: u32,
    by_number: Option<HashMap<usize, Arc<ThreadPool>>>,
}

/// The lock is only taken by threads that hold the interpreter's lock, so no `fork` finds it taken.
static POOLS: Mutex<Pools> = Mutex::new(Pools {
    process: 0,
    by_number: None,
});

fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if pools.process != process::id() {
        mem::forget(pools.by_number.take());
        pools.process = process::id();
    }
    let by_number = pools.by_number.get_or_insert_default();
    if let Some(pool) = by_number.get(&threads) {
        return Ok(Arc::clone(pool));
    }
    let name = |i| format!("kd-{i}");
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(name)
        .build();
    let pool = pool
        .map_err(|error| PyOSError::new_err(format!("cannot start {threads} threads: {error}")))?;
    let pool = Arc::new(pool);
    by_number.insert(threads, Arc::clone(&pool));
    Ok(pool)
}

/// Fills memory in pieces on some threads, the calling one among them. `fill` gets the place of a piece.
///
/// For reading arrays while the interpreter's lock is held: pools may be busy with the work of other threads, for as long as that takes.
pub(crate) fn fill<T: Send>(
    memory: &mut [T],
    threads: usize,
    fill: impl Fn(usize, &mut [T]) + Sync,
) {
    let pieces = threads
        .min(memory.len() / LEAST_OF_A_PIECE)
        .min(MOST_PIECES);
    if pieces <= 1 {
        fill(0, memory);
        return;
    }
    let len = memory.len().div_ceil(pieces);
    thread::scope(|scope| {
        let mut pieces = (0..).step_by(len).zip(memory.chunks_mut(len));
        let own = pieces.next();
        let fill = &fill;
        for (start, piece) in pieces {
            scope.spawn(move || fill(start, piece));
        }
        if let Some((start, piece)) = own {
            fill(start, piece);
        }
    });
}

/// Does small work for each item on some threads, the calling one among them; for a few items on that one only.
pub(crate) fn each_on_threads<T: Send>(
    items: &mut [T],
    threads: usize,
    work: impl Fn(&mut T) + Sync,
) {
    let len = items
        .len()
        .div_ceil(threads.clamp(1, MOST_PIECES))
        .max(LEAST_ITEMS);
    thread::scope(|scope| {
        let mut pieces = items.chunks_mut(len);
        let own = pieces.next();
        let work = &work;
        for piece in pieces {
            scope.spawn(move || piece.iter_mut().for_each(work));
        }
        own.into_iter().flatten().for_each(work);
    });
}

/// Does long work on a thread of its own, without the interpreter's lock, while the calling thread looks at signals and reports
/// progress. An exception of a signal's handler or of `progress` stops the work and is returned.
///
/// Neither the work nor its threads ever wait for the interpreter's lock.
pub(crate) fn interruptible<R: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    work: impl FnOnce(&BuildProgress<'_>) -> R + Send,
) -> PyResult<R> {
    let done = AtomicU32::new(0.0_f32.to_bits());
    let stop = AtomicBool::new(false);
    let report = |fraction: f32| {
        done.store(fraction.to_bits(), Ordering::Relaxed);
        if stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    if let Some(progress) = progress {
        progress.call1(py, (0.0,))?;
    }
    let result = py.detach(|| {
        thread::scope(|scope| {
            let (sender, receiver) = channel();
            let report = &report;
            thread::Builder::new()
                .name("kd-build".to_owned())
                .spawn_scoped(scope, move || {
                    // The receiver only waits.
                    sender.send(work(report)).ok();
                })
                .map_err(|error| PyOSError::new_err(format!("cannot start a thread: {error}")))?;
            let mut stopped_by = None;
            loop {
                match receiver.recv_timeout(TICK) {
                    Ok(result) => return stopped_by.map_or(Ok(result), Err),
                    Err(RecvTimeoutError::Disconnected) => {
                        return Err(PyRuntimeError::new_err("the build failed"));
                    }
                    Err(RecvTimeoutError::Timeout) if stopped_by.is_none() => {
                        let fraction = f32::from_bits(done.load(Ordering::Relaxed));
                        stopped_by = Python::attach(|py| look(py, progress, fraction)).err();
                        stop.store(stopped_by.is_some(), Ordering::Relaxed);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                }
            }
        })
    })?;
    if let Some(progress) = progress {
        progress.call1(py, (1.0,))?;
    }
    Ok(result)
}

fn look(py: Python<'_>, progress: Option<&Py<PyAny>>, fraction: f32) -> PyResult<()> {
    py.check_signals()?;
    match progress {
        Some(progress) => progress.call1(py, (fraction,)).map(drop),
        None => Ok(()),
    }
}
