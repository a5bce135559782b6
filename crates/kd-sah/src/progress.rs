//! The progress of a build, and its cancellation.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::options::BuildError;

/// Receives the progress of a build: called up to 256 times with the fraction that is done, from 0 to 1. Breaking cancels the
/// build.
///
/// Any building thread may call it, several at the same time, and slightly out of order.
pub type BuildProgress<'a> = dyn Fn(f32) -> ControlFlow<()> + Sync + 'a;

/// A share of the whole work, in units of 2⁻⁴⁸. Shares that a share is divided into add up to it exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Share(u64);

/// Calls in a whole build, each after an equal share of the work.
const CALLS: u64 = 256;

impl Share {
    pub(crate) const ALL: Self = Self(1 << 48);

    /// Divides the share in proportion to the primitives on either side: the work for a leaf is taken as proportional to them.
    pub(crate) fn divide(self, [lower, upper]: [usize; 2]) -> [Self; 2] {
        let (part, whole) = (lower as u64, (lower as u64 + upper as u64).max(1));
        let lower = u128::from(self.0) * u128::from(part) / u128::from(whole);
        let lower = u64::try_from(lower).expect("at most the whole");
        [Self(lower), Self(self.0 - lower)]
    }
}

/// The finished share of a build, and the callback that receives it.
pub(crate) struct Tracker<'a> {
    progress: Option<&'a BuildProgress<'a>>,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl<'a> Tracker<'a> {
    pub(crate) fn new(progress: Option<&'a BuildProgress<'a>>) -> Self {
        Self {
            progress,
            done: AtomicU64::new(0),
            is_cancelled: AtomicBool::new(false),
        }
    }

    /// Records finished work. Fails on every thread once the callback has broken.
    #[inline]
    pub(crate) fn done(&self, share: Share) -> Result<(), BuildError> {
        match self.progress {
            Some(progress) => self.report(progress, share),
            None => Ok(()),
        }
    }

    fn report(&self, progress: &BuildProgress<'_>, share: Share) -> Result<(), BuildError> {
        const PART: u64 = Share::ALL.0 / CALLS;
        let before = self.done.fetch_add(share.0, Ordering::Relaxed);
        let now = before + share.0;
        if before / PART < now / PART {
            let part = (now / PART) as f32 / CALLS as f32;
            if progress(part).is_break() {
                self.is_cancelled.store(true, Ordering::Relaxed);
            }
        }
        if self.is_cancelled.load(Ordering::Relaxed) {
            return Err(BuildError::Cancelled);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divided_shares_add_up() {
        let whole = Share(1001);
        for counts in [[0, 0], [3, 0], [1, 2], [usize::MAX / 2, 1]] {
            let [lower, upper] = whole.divide(counts);
            assert_eq!(lower.0 + upper.0, whole.0, "{counts:?}");
        }
    }
}
