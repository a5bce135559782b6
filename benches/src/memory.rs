//! The peak memory of a piece of work.
//!
//! Every thread has its own count. So the number is the same in every run, independent of other threads (those of a dropped
//! thread pool end at any time), and counting costs a parallel build no shared cache line. Threads share a count only during
//! [`peak_of_all_threads_during`]. The counting allocators of registries always share one.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with it; every call is passed on unchanged"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicIsize, Ordering};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// The system's allocator, with a count of bytes that are in use.
struct CountingAllocator;

#[derive(Clone, Copy)]
struct Bytes {
    /// Allocated less freed by this thread; below 0 where it frees what others allocated.
    in_use: isize,
    /// The peak of `in_use` since [`bytes_during`] set it to 0.
    peak: isize,
}

const NONE: Bytes = Bytes { in_use: 0, peak: 0 };

thread_local! {
    static BYTES: Cell<Bytes> = const { Cell::new(NONE) };
}

/// Bytes that a piece of work allocated, above those before it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken {
    /// The peak of allocated bytes.
    pub(crate) peak: usize,
    /// Bytes still allocated at the end.
    pub(crate) kept: usize,
}

/// Runs `work` and counts the bytes that this thread allocates during it. A reallocation counts as the bytes it grows by.
pub(crate) fn bytes_during<T>(work: impl FnOnce() -> T) -> (T, Taken) {
    BYTES.set(NONE);
    let result = work();
    let Bytes { in_use, peak } = BYTES.get();
    let taken = Taken {
        peak: peak.unsigned_abs(),
        kept: in_use.max(0).unsigned_abs(),
    };
    (result, taken)
}

/// Whether all threads count together, and their counts since then.
static TOGETHER: AtomicBool = AtomicBool::new(false);
static IN_USE: AtomicIsize = AtomicIsize::new(0);
static PEAK: AtomicIsize = AtomicIsize::new(0);

/// Runs `work` and returns the peak of bytes that all threads together allocate during it, above those before it. Only one
/// such piece of work runs at a time; other work of the program at that time counts too.
pub(crate) fn peak_of_all_threads_during<T>(work: impl FnOnce() -> T) -> (T, usize) {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let turn = ONE_AT_A_TIME.lock();
    IN_USE.store(0, Ordering::Relaxed);
    PEAK.store(0, Ordering::Relaxed);
    TOGETHER.store(true, Ordering::SeqCst);
    let result = work();
    TOGETHER.store(false, Ordering::SeqCst);
    let peak = PEAK.load(Ordering::Relaxed).unsigned_abs();
    drop(turn);
    (result, peak)
}

/// Adds a change of the number of bytes. Neither allocates nor panics.
fn count(change: isize) {
    if TOGETHER.load(Ordering::Relaxed) {
        let in_use = IN_USE.fetch_add(change, Ordering::Relaxed) + change;
        PEAK.fetch_max(in_use, Ordering::Relaxed);
    }
    // A thread that ends may have lost its count, which is not needed any more.
    let _ = BYTES.try_with(|bytes| {
        let Bytes { in_use, peak } = bytes.get();
        let in_use = in_use.wrapping_add(change);
        bytes.set(Bytes {
            in_use,
            peak: peak.max(in_use),
        });
    });
}

/// The size of a layout never exceeds `isize::MAX`.
fn signed_size(layout: Layout) -> isize {
    layout.size().cast_signed()
}

// SAFETY: each method hands its arguments to the system's allocator unchanged and returns what that returns, so the
// contract between it and the caller is the same; counting touches no memory that was allocated here.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(signed_size(layout));
        // SAFETY: the caller keeps the contract of `alloc`, which is that of the system's.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(signed_size(layout));
        // SAFETY: the caller keeps the contract of `alloc_zeroed`, which is that of the system's.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count(-signed_size(layout));
        // SAFETY: `place` came from the system's allocator with this layout, since every allocation here does.
        unsafe { System.dealloc(place, layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count(new_size.cast_signed().wrapping_sub(signed_size(layout)));
        // SAFETY: as for `dealloc`, and the caller keeps the contract of `realloc` for the new size.
        unsafe { System.realloc(place, layout, new_size) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_that_of_what_lives_together() {
        let before = vec![0_u8; 1 << 20];
        let (kept, taken) = bytes_during(|| {
            drop(vec![0_u8; 500]);
            let mut first = Vec::<u8>::with_capacity(1000);
            first.reserve_exact(1500);
            let second = vec![0_u8; 700];
            std::thread::scope(|scope| {
                let elsewhere = scope.spawn(|| vec![0_u8; 1 << 16].len());
                elsewhere.join().expect("no panic")
            });
            drop(second);
            first
        });
        let peak = taken.peak;
        assert_eq!(kept.capacity(), 1500, "the work's result comes back");
        // Starting a thread takes some bytes here, too.
        assert!(
            (2200..2200 + 2048).contains(&peak),
            "1500 and 700 lived together: {peak}"
        );
        assert!(
            (1500..1500 + 2048).contains(&taken.kept),
            "the 1500 are still there: {taken:?}"
        );
        drop(before);
        let ((), taken) = bytes_during(|| drop(kept));
        assert_eq!((taken.peak, taken.kept), (0, 0), "freeing needs nothing");
    }

    #[test]
    fn threads_can_be_counted_together() {
        const EACH: usize = 1 << 26;
        let both_hold = std::sync::Barrier::new(2);
        let hold = || {
            let held = vec![1_u8; EACH];
            both_hold.wait();
            held.len()
        };
        let ((), peak) = peak_of_all_threads_during(|| {
            std::thread::scope(|scope| {
                scope.spawn(hold);
                scope.spawn(hold);
            });
        });
        // Other tests run meanwhile, and need or give back a little.
        assert!(
            (2 * EACH - EACH / 8..3 * EACH).contains(&peak),
            "two at a time: {peak}"
        );
    }
}
