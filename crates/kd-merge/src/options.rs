//! How trees are put together, whatever the method.

use kd_sah::BuildOptions;

/// Which leaves are divided again, how, and on how many threads trees are put together.
#[derive(Clone, Debug)]
pub struct MergeOptions {
    pub(crate) most_in_leaf: usize,
    pub(crate) builder: BuildOptions,
    pub(crate) is_parallel: bool,
}

impl Default for MergeOptions {
    /// Leaves of more than 16 primitives, which is two blocks, are divided again with [`BuildOptions::balanced`]; one thread.
    fn default() -> Self {
        Self::resplitting(16, BuildOptions::balanced())
    }
}

impl MergeOptions {
    /// Leaves of more than so many primitives are divided again with these options, each by one thread.
    #[must_use]
    pub fn resplitting(above: usize, builder: BuildOptions) -> Self {
        Self {
            most_in_leaf: above,
            builder: builder.with_threads(1),
            is_parallel: false,
        }
    }

    /// No leaf is divided again.
    #[must_use]
    pub fn never_resplitting() -> Self {
        Self::resplitting(usize::MAX, BuildOptions::default())
    }

    /// Merges on the threads of the pool in scope (rayon's), or on the calling one. The tree is the same, bit for bit. Without
    /// feature `parallel` it is always the calling thread.
    #[must_use]
    pub fn with_parallel(mut self, is_parallel: bool) -> Self {
        self.is_parallel = is_parallel;
        self
    }
}
