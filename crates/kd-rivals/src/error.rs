//! Errors of rivals.

/// A rival cannot be built.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
pub enum RivalError {
    /// The feature of kd-rivals that contains the rival is off.
    #[error("the feature `{0}` of kd-rivals is off")]
    NotCompiled(&'static str),
    /// Embree 3 could not be opened.
    #[error(
        "Embree 3 cannot be opened ({0}); it is a system library: on Debian and Ubuntu, \
         `apt-get install libembree-dev` installs it"
    )]
    NotInstalled(String),
    /// A library failed.
    #[error("{0}")]
    Failed(String),
}
