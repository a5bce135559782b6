//! How far a build is, and whether it should go on.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::options::BuildError;

/// Called now and then during a build with the part of it that is done, from 0 to 1; breaks to end the build.
///
/// It may be called from any of the building threads, from several at once, and out of order by a little.
pub type Watch<'a> = dyn Fn(f32) -> ControlFlow<()> + Sync + 'a;

/// A part of the whole work: 2⁴⁸ is all of it. Parts of a part add up to it exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Share(u64);

/// The watch is called once for each of so many equal parts.
const CALLS: u64 = 256;

impl Share {
    pub(crate) const ALL: Self = Self(1 << 48);

    /// In proportion to how many primitives each part has: a leaf is as much work as its primitives.
    pub(crate) fn divide(self, [lower, upper]: [usize; 2]) -> [Self; 2] {
        let (part, whole) = (lower as u64, (lower as u64 + upper as u64).max(1));
        let lower = u128::from(self.0) * u128::from(part) / u128::from(whole);
        let lower = u64::try_from(lower).expect("no more than the whole");
        [Self(lower), Self(self.0 - lower)]
    }
}

/// A watch, if there is one, and how far the build has come.
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

    /// Takes note of finished work. Fails once the watch has broken, on every thread.
    #[inline]
    pub(crate) fn done(&self, share: Share) -> Result<(), BuildError> {
        match self.watch {
            Some(watch) => self.tell(watch, share),
            None => Ok(()),
        }
    }

    fn tell(&self, watch: &Watch<'_>, share: Share) -> Result<(), BuildError> {
        const PART: u64 = Share::ALL.0 / CALLS;
        let before = self.done.fetch_add(share.0, Ordering::Relaxed);
        let now = before + share.0;
        if before / PART < now / PART {
            let part = (now / PART) as f32 / CALLS as f32;
            if watch(part).is_break() {
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
    fn parts_add_up() {
        let whole = Share(1001);
        for counts in [[0, 0], [3, 0], [1, 2], [usize::MAX / 2, 1]] {
            let [lower, upper] = whole.divide(counts);
            assert_eq!(lower.0 + upper.0, whole.0, "{counts:?}");
        }
    }
}
