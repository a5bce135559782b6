//! The progress of long work, and its cancellation.

use std::fmt;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use thiserror::Error;

/// The callback of some [`Progress`] has broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the work was cancelled")]
pub struct Cancelled;

/// Receives the progress of long work: called up to 256 times with the fraction that is done, from 0 to 1. Breaking cancels the
/// work.
///
/// Any working thread may call it, several at the same time, and slightly out of order.
pub type Progress<'a> = dyn Fn(f32) -> ControlFlow<()> + Sync + 'a;

/// A share of the whole work, in units of 2⁻⁴⁸. Shares that a share is divided into add up to it exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share(u64);

/// Calls in all, each after an equal share of the work.
const CALLS: u64 = 256;

impl Share {
    /// The whole work.
    pub const ALL: Self = Self(1 << 48);

    /// Divides the share in proportion to two counts, such as the primitives on either side of a plane.
    pub fn divide(self, [lower, upper]: [usize; 2]) -> [Self; 2] {
        let (part, whole) = (lower as u64, (lower as u64 + upper as u64).max(1));
        let lower = u128::from(self.0) * u128::from(part) / u128::from(whole);
        let lower = u64::try_from(lower).unwrap_or(self.0);
        [Self(lower), Self(self.0 - lower)]
    }
}

/// The finished share of some work, and the callback that receives it.
///
/// ```
/// use std::ops::ControlFlow;
///
/// use kd_tasks::{Cancelled, Share, Tracker};
///
/// let stop_after_half = |done: f32| if done < 0.5 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
/// let tracker = Tracker::new(Some(&stop_after_half));
/// let [first, second] = Share::ALL.divide([2, 3]);
/// assert_eq!(tracker.done(first), Ok(()));
/// assert_eq!(tracker.done(second), Err(Cancelled));
/// ```
pub struct Tracker<'a> {
    progress: Option<&'a Progress<'a>>,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl fmt::Debug for Tracker<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let done = self.done.load(Ordering::Relaxed) as f64 / Share::ALL.0 as f64;
        f.debug_struct("Tracker")
            .field("done", &done)
            .finish_non_exhaustive()
    }
}

impl<'a> Tracker<'a> {
    /// Nothing is done yet. Without a callback, nothing is recorded.
    pub const fn new(progress: Option<&'a Progress<'a>>) -> Self {
        Self {
            progress,
            done: AtomicU64::new(0),
            is_cancelled: AtomicBool::new(false),
        }
    }

    /// Records finished work.
    ///
    /// # Errors
    ///
    /// On every thread once the callback has broken.
    #[inline]
    pub fn done(&self, share: Share) -> Result<(), Cancelled> {
        match self.progress {
            Some(progress) => self.report(progress, share),
            None => Ok(()),
        }
    }

    fn report(&self, progress: &Progress<'_>, share: Share) -> Result<(), Cancelled> {
        const PART: u64 = Share::ALL.0 / CALLS;
        let before = self.done.fetch_add(share.0, Ordering::Relaxed);
        let now = before + share.0;
        if before / PART < now / PART {
            let part = (now / PART) as f32 / CALLS as f32;
            if progress(part).is_break() {
                self.is_cancelled.store(true, Ordering::Relaxed);
            }
        }
        self.check()
    }

    /// Records all that is left as finished.
    ///
    /// # Errors
    ///
    /// As [`done`](Self::done).
    pub fn finish(&self) -> Result<(), Cancelled> {
        let done = self.done.load(Ordering::Relaxed);
        self.done(Share(Share::ALL.0.saturating_sub(done)))
    }

    /// Records nothing.
    ///
    /// # Errors
    ///
    /// As [`done`](Self::done).
    #[inline]
    pub fn check(&self) -> Result<(), Cancelled> {
        if self.is_cancelled.load(Ordering::Relaxed) {
            return Err(Cancelled);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_is_reported_once() {
        for part in [0, 2, 5] {
            let calls = std::sync::Mutex::new(Vec::new());
            let record = |done: f32| {
                calls.lock().expect("no panic").push(done);
                ControlFlow::Continue(())
            };
            let tracker = Tracker::new(Some(&record));
            let [own, _] = Share::ALL.divide([part, 5 - part]);
            assert_eq!(tracker.done(own), Ok(()));
            assert_eq!(tracker.finish(), Ok(()));
            let calls = calls.lock().expect("no panic");
            let ends = calls.iter().filter(|done| **done == 1.0).count();
            assert_eq!(ends, 1, "{part}: {calls:?}");
        }
    }

    #[test]
    fn divided_shares_add_up() {
        let whole = Share(1001);
        for counts in [[0, 0], [3, 0], [1, 2], [usize::MAX / 2, 1]] {
            let [lower, upper] = whole.divide(counts);
            assert_eq!(lower.0 + upper.0, whole.0, "{counts:?}");
        }
    }
}
