//! How many random inputs tests take: some by default, many with the feature `long-tests`, which `.ci/run` turns on.
//!
//! ```text
//! cargo test --workspace --features kd-oracle/long-tests
//! ```

/// Whether the feature `long-tests` is on.
pub const IS_LONG: bool = cfg!(feature = "long-tests");

/// Number of rays, meshes or other random inputs: `long` with the feature `long-tests`, else `short`.
#[must_use]
pub const fn count(short: usize, long: usize) -> usize {
    if IS_LONG { long } else { short }
}

/// [`count`] for the cases of a property.
#[must_use]
pub const fn cases(short: u32, long: u32) -> u32 {
    if IS_LONG { long } else { short }
}
