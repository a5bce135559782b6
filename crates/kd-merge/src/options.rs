//! Options of all merge methods.

use kd_sah::BuildOptions;

/// The size above which leaves are divided again, the builder that divides them, and whether merging runs on several
/// threads.
#[derive(Clone, Debug)]
pub struct MergeOptions {
    pub(crate) max_leaf_size: usize,
    pub(crate) builder: BuildOptions,
    pub(crate) is_parallel: bool,
}

impl Default for MergeOptions {
    /// Leaves of more than 16 primitives (two blocks) are divided again with [`BuildOptions::balanced`]. Merging runs on
    /// one thread.
    fn default() -> Self {
        Self::resplitting(16, BuildOptions::balanced())
    }
}

impl MergeOptions {
    /// Leaves of more than `max_leaf_size` primitives are divided again by `builder`, on one thread each.
    #[must_use]
    pub fn resplitting(max_leaf_size: usize, builder: BuildOptions) -> Self {
        Self {
            max_leaf_size,
            builder: builder.with_threads(1),
            is_parallel: false,
        }
    }

    /// Options under which no leaf is divided again.
    #[must_use]
    pub fn never_resplitting() -> Self {
        Self::resplitting(usize::MAX, BuildOptions::default())
    }

    /// Whether merging runs on the threads of rayon's pool in scope, or on the calling thread only. The tree is the same,
    /// bit for bit. Without the feature `parallel`, merging always runs on the calling thread.
    #[must_use]
    pub fn with_parallel(mut self, is_parallel: bool) -> Self {
        self.is_parallel = is_parallel;
        self
    }
}
