//! How a tree is made: on which threads, and who hears of it.

use kd_tasks::{Share, Tracker};

/// A share of the work of making a tree.
#[derive(Clone, Copy)]
pub(crate) struct Work<'a> {
    /// Whether on the threads of the pool in scope. The result is the same.
    pub(crate) is_parallel: bool,
    /// Once it is cancelled, work ends early, and its result is good for nothing.
    pub(crate) tracker: &'a Tracker<'a>,
    pub(crate) share: Share,
}

impl<'a> Work<'a> {
    /// All of it.
    pub(crate) fn new(is_parallel: bool, tracker: &'a Tracker<'a>) -> Self {
        Self {
            is_parallel,
            tracker,
            share: Share::ALL,
        }
    }

    /// Divides the share in these proportions.
    pub(crate) fn divide(self, parts: [usize; 2]) -> [Self; 2] {
        self.share.divide(parts).map(|share| Self { share, ..self })
    }
}
