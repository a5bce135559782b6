//! Progress and cancellation of a build.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::options::BuildError;

/// A callback that receives the finished fraction of a build, from 0 to 1, up to 256 times per build. It returns
/// [`ControlFlow::Break`] to cancel the build.
///
/// Any building thread may call it. Calls may overlap, and fractions may arrive slightly out of order.
pub type Watch<'a> = dyn Fn(f32) -> ControlFlow<()> + Sync + 'a;

/// A share of the work of a build; 2⁴⁸ is the whole work. Dividing a share gives two shares with exactly the same sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Share(u64);

/// The greatest number of calls of a watch: one for each of 256 equal shares of the work.
const CALLS: u64 = 256;

impl Share {
    pub(crate) const ALL: Self = Self(1 << 48);

    /// Divides the share in proportion to the numbers of primitives of both children: the work of a leaf is its number of
    /// primitives.
    pub(crate) fn divide(self, [lower, upper]: [usize; 2]) -> [Self; 2] {
        let (count, total) = (lower as u64, (lower as u64 + upper as u64).max(1));
        let lower = u128::from(self.0) * u128::from(count) / u128::from(total);
        let lower = u64::try_from(lower).expect("at most the whole share");
        [Self(lower), Self(self.0 - lower)]
    }
}

/// The progress of a build, and its watch, if any.
pub(crate) struct Watched<'a> {
    watch: Option<&'a Watch<'a>>,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl<'a> Watched<'a> {
    pub(crate) fn new(watch: Option<&'a Watch<'a>>) -> Self {
        Self {
            watch,
            done: AtomicU64::new(0),
            is_cancelled: AtomicBool::new(false),
        }
    }

    /// Adds finished work. Fails on every thread once the watch has cancelled the build.
    #[inline]
    pub(crate) fn done(&self, share: Share) -> Result<(), BuildError> {
        match self.watch {
            Some(watch) => self.report(watch, share),
            None => Ok(()),
        }
    }

    fn report(&self, watch: &Watch<'_>, share: Share) -> Result<(), BuildError> {
        const STEP: u64 = Share::ALL.0 / CALLS;
        let before = self.done.fetch_add(share.0, Ordering::Relaxed);
        let now = before + share.0;
        if before / STEP < now / STEP {
            let fraction = (now / STEP) as f32 / CALLS as f32;
            if watch(fraction).is_break() {
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
