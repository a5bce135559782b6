//! Errors of rivals.

/// A rival cannot be built.
#[derive(Clone, Debug, Eq, PartialEq, thiserror::Error)]
pub enum RivalError {
    /// The feature of kd-rivals that contains the rival is off.
    #[error("the feature `{0}` of kd-rivals is off")]
    NotCompiled(&'static str),
    /// Embree could not be opened.
    #[error(
        "Embree cannot be opened ({0}); versions 3 and 4 are system libraries: on Debian and Ubuntu, \
         `apt-get install libembree-dev` installs one; the environment variable KD_EMBREE names the file of another"
    )]
    NotInstalled(String),
    /// A library failed.
    #[error("{0}")]
    Failed(String),
}
