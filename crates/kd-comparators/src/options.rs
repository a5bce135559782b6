//! What can be asked of a build, and why there may be no structure.

use kd_core::MAX_DEPTH;
use thiserror::Error;

/// When to stop dividing, for either structure.
///
/// Options are checked by the build, which names the one that is wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    pub(crate) small_leaf: u32,
    max_depth: Option<u32>,
    max_refs: Option<u64>,
}

/// References per triangle where nothing else is asked for.
const REFS_PER_TRIANGLE: u64 = 16;

impl Options {
    /// A cell of at most this many triangles is not divided. 8 by default; with 0, a cell of one triangle is divided as
    /// well, while that makes its cell smaller.
    #[must_use]
    pub const fn with_small_leaf(mut self, triangles: u32) -> Self {
        self.small_leaf = triangles;
        self
    }

    /// The most divisions above a leaf, 0 to [`MAX_DEPTH`] (64). Without it 16 in an octree, which halves each side of the
    /// scene's box as often, and 64 in a BSP tree.
    #[must_use]
    pub const fn with_max_depth(mut self, max_depth: u32) -> Self {
        self.max_depth = Some(max_depth);
        self
    }

    /// The most references in the whole structure, at least one per triangle and at most 2³² - 1 in any case. Where it would
    /// be exceeded, cells become leaves as they are; nothing is lost. Without it, 16 per triangle.
    ///
    /// What a cell may still add is divided between its children in proportion to what they hold, so that no part of the
    /// scene takes it all.
    #[must_use]
    pub const fn with_max_refs(mut self, max_refs: u64) -> Self {
        self.max_refs = Some(max_refs);
        self
    }

    pub(crate) fn check(&self) -> Result<(), BuildError> {
        if self.max_depth.is_some_and(|d| d as usize > MAX_DEPTH) {
            return Err(BuildError::InvalidOption {
                name: "max_depth",
                rule: "at most MAX_DEPTH (64)",
            });
        }
        Ok(())
    }

    /// The depth that was set, or else the structure's own.
    pub(crate) fn depth_limit(&self, otherwise: u32) -> u32 {
        self.max_depth.unwrap_or(otherwise)
    }

    /// How many references may be added to one for each triangle.
    pub(crate) fn spare_refs(&self, triangles: usize) -> u64 {
        let triangles = triangles as u64;
        self.max_refs
            .unwrap_or(REFS_PER_TRIANGLE * triangles)
            .min(u64::from(u32::MAX))
            .saturating_sub(triangles)
    }
}

impl Default for Options {
    /// Leaves of up to 8 triangles, and the limits that each method tells.
    fn default() -> Self {
        Self {
            small_leaf: 8,
            max_depth: None,
            max_refs: None,
        }
    }
}

/// Why there is no structure.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// An option has a value that makes no sense.
    #[error("option `{name}` must be {rule}")]
    InvalidOption {
        /// The option.
        name: &'static str,
        /// What it must be.
        rule: &'static str,
    },
    /// More than 2³² - 1 nodes; ask for fewer references.
    #[error("there are too many nodes for indices of 32 bits")]
    TooManyNodes,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_depth_is_named() {
        let options = Options::default().with_max_depth(65);
        let error = options.check().expect_err("one too many");
        assert_eq!(
            error.to_string(),
            "option `max_depth` must be at most MAX_DEPTH (64)"
        );
        assert_eq!(options.with_max_depth(64).check(), Ok(()), "the most");
    }

    #[test]
    fn spare_references_are_those_beyond_one_each() {
        let options = Options::default();
        assert_eq!(options.spare_refs(10), 150, "15 more for each");
        assert_eq!(options.clone().with_max_refs(3).spare_refs(10), 0, "none");
        let many = options.with_max_refs(u64::MAX).spare_refs(10);
        assert_eq!(many, u64::from(u32::MAX) - 10, "as many as have an index");
    }
}
