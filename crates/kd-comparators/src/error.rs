//! Errors of builds.

use kd_tasks::ThreadsError;
use thiserror::Error;

/// Why a comparator was not built.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ComparatorError {
    /// An option is out of range.
    #[error("option `{name}` must be {rule}")]
    InvalidOption {
        /// The option.
        name: &'static str,
        /// The range.
        rule: &'static str,
    },
    /// The threads could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// The octree has more than 2³² - 1 nodes. Ask for fewer references.
    #[error("more nodes than 32 bits can index; ask for fewer references")]
    TooManyNodes,
}
