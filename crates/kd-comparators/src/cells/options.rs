//! Options of an octree or a BSP tree.

use kd_core::MAX_DEPTH;

use crate::ComparatorError;

/// When an octree or a BSP tree stops dividing cells.
///
/// The build checks options and names the one that is out of range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellOptions {
    pub(crate) small_leaf: u32,
    max_depth: Option<u32>,
    max_refs: Option<u64>,
}

/// Default limit of references per triangle.
const REFS_PER_TRIANGLE: u64 = 16;

impl CellOptions {
    /// Cells of at most this many triangles are not divided. The default is 8. With 0, a cell of one triangle is divided too,
    /// as long as that makes the cell smaller.
    #[must_use]
    pub const fn with_small_leaf(mut self, triangles: u32) -> Self {
        self.small_leaf = triangles;
        self
    }

    /// The largest number of divisions above a leaf, 0 to [`MAX_DEPTH`] (64). The default is 16 in an octree, where each
    /// division halves all sides of a cell, and 64 in a BSP tree.
    #[must_use]
    pub const fn with_max_depth(mut self, max_depth: u32) -> Self {
        self.max_depth = Some(max_depth);
        self
    }

    /// The largest number of references in the structure, clamped to at least one per triangle and at most 2³² - 1. Cells that
    /// would exceed it become leaves; no triangle is lost. The default is 16 per triangle.
    ///
    /// The references that a cell may still add are divided between its children in proportion to their contents, so that no
    /// region of the scene takes all of them.
    #[must_use]
    pub const fn with_max_refs(mut self, max_refs: u64) -> Self {
        self.max_refs = Some(max_refs);
        self
    }

    pub(crate) fn check(&self) -> Result<(), ComparatorError> {
        if self.max_depth.is_some_and(|d| d as usize > MAX_DEPTH) {
            return Err(ComparatorError::InvalidOption {
                name: "max_depth",
                rule: "at most MAX_DEPTH (64)",
            });
        }
        Ok(())
    }

    /// The depth limit, or the default of the structure.
    pub(crate) fn depth_limit(&self, otherwise: u32) -> u32 {
        self.max_depth.unwrap_or(otherwise)
    }

    /// The number of references that may be added to one per triangle.
    pub(crate) fn spare_refs(&self, triangles: usize) -> u64 {
        let triangles = triangles as u64;
        self.max_refs
            .unwrap_or(REFS_PER_TRIANGLE * triangles)
            .min(u64::from(u32::MAX))
            .saturating_sub(triangles)
    }
}

impl Default for CellOptions {
    /// Leaves of up to 8 triangles, and the default limits of each method.
    fn default() -> Self {
        Self {
            small_leaf: 8,
            max_depth: None,
            max_refs: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_depth_out_of_range_is_named() {
        let options = CellOptions::default().with_max_depth(65);
        let error = options.check().expect_err("one too many");
        assert_eq!(
            error.to_string(),
            "option `max_depth` must be at most MAX_DEPTH (64)"
        );
        assert_eq!(options.with_max_depth(64).check(), Ok(()), "the limit");
    }

    #[test]
    fn spare_references_are_those_beyond_one_each() {
        let options = CellOptions::default();
        assert_eq!(options.spare_refs(10), 150, "15 more for each");
        assert_eq!(options.clone().with_max_refs(3).spare_refs(10), 0, "none");
        let many = options.with_max_refs(u64::MAX).spare_refs(10);
        assert_eq!(many, u64::from(u32::MAX) - 10, "all that 32 bits index");
    }
}
