//! Options of a grid.

use kd_tasks::ThreadsError;
use thiserror::Error;

/// The cells that a triangle is entered in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Overlap {
    /// All cells that its box overlaps: the fastest test, suitable for triangles smaller than a cell.
    Box,
    /// The cells among them that the triangle itself overlaps. Triangles whose boxes overlap fewer than 16 cells, or one row of
    /// cells, are entered as by [`Box`](Self::Box): an exact test would not pay.
    Exact,
}

/// Options of a grid.
///
/// The build checks options and names the one that is out of range. The grid depends on the mesh and on all options but
/// [`with_threads`](Self::with_threads), bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct GridOptions {
    pub(crate) density: f32,
    pub(crate) overlap: Overlap,
    pub(crate) max_cells: u64,
    pub(crate) max_refs: Option<u64>,
    pub(crate) threads: usize,
}

/// Upper limit of cells and of references: both are counted in 32 bits.
pub(crate) const MOST: u64 = u32::MAX as u64;

/// Default limit of references per triangle.
const REFS_EACH: u64 = 32;
/// References in addition to that limit, so that a few large triangles may fill their grid.
const REFS_BESIDES: u64 = 1 << 16;

impl GridOptions {
    /// Two cells per triangle, exact overlap, and the thread pool in scope.
    pub const fn new() -> Self {
        Self {
            // From 1 to 16, the time of rays is the same within noise, on a scan and in a room, and each doubling makes the build
            // 1.2 to 1.4 times slower. (From a throw-away program, 2026-11-28.)
            density: 2.0,
            overlap: Overlap::Exact,
            max_cells: 1 << 28,
            max_refs: None,
            threads: 0,
        }
    }

    /// The number of cells per triangle, positive and finite: the number of cells is proportional to that of triangles (Cleary
    /// and Wyvill 1988). Cells are as close to cubes as whole numbers of them allow, so that the grid has slightly fewer.
    #[must_use]
    pub const fn with_density(mut self, cells_per_triangle: f32) -> Self {
        self.density = cells_per_triangle;
        self
    }

    /// The cells that a triangle is entered in.
    #[must_use]
    pub const fn with_overlap(mut self, overlap: Overlap) -> Self {
        self.overlap = overlap;
        self
    }

    /// The largest number of cells, from 1 to 2³² − 1. A cell takes 4 bytes. The default is 2²⁸.
    #[must_use]
    pub const fn with_max_cells(mut self, max_cells: u64) -> Self {
        self.max_cells = max_cells;
        self
    }

    /// The largest number of references, from one per triangle to 2³² − 1. A triangle has one reference in each cell that its box
    /// overlaps. The build doubles the length of cells until the limit holds, so that time and memory are bounded for every mesh;
    /// [`GridStats::halvings`](crate::GridStats::halvings) counts the doublings. The default is 32 per triangle plus 65 536. A
    /// reference takes 4 bytes, 8 during the build, and, for a thousand triangles per thread, up to 24.
    #[must_use]
    pub const fn with_max_refs(mut self, max_refs: u64) -> Self {
        self.max_refs = Some(max_refs);
        self
    }

    /// The number of threads that build: 1 builds on the calling thread, 0 uses the thread pool in scope (by default, one thread
    /// per core). Without the feature `parallel`, and for up to 32 768 triangles, which take less time than waking a thread, one
    /// thread builds. The grid does not depend on it.
    #[must_use]
    pub const fn with_threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// See [`with_density`](Self::with_density).
    pub const fn density(&self) -> f32 {
        self.density
    }

    /// See [`with_overlap`](Self::with_overlap).
    pub const fn overlap(&self) -> Overlap {
        self.overlap
    }

    /// See [`with_max_cells`](Self::with_max_cells).
    pub const fn max_cells(&self) -> u64 {
        self.max_cells
    }

    /// See [`with_max_refs`](Self::with_max_refs); `None` for the default.
    pub const fn max_refs(&self) -> Option<u64> {
        self.max_refs
    }

    /// See [`with_threads`](Self::with_threads).
    pub const fn threads(&self) -> usize {
        self.threads
    }

    pub(crate) fn check(&self, triangles: usize) -> Result<(), GridError> {
        let invalid = |name, rule| Err(GridError::InvalidOption { name, rule });
        if !(self.density > 0.0 && self.density.is_finite()) {
            return invalid("density", "positive and finite");
        }
        if !(1..=MOST).contains(&self.max_cells) {
            return invalid("max_cells", "from 1 to 2^32 - 1");
        }
        let max_refs = self.max_refs.unwrap_or(MOST);
        if !(triangles as u64..=MOST).contains(&max_refs) {
            return invalid("max_refs", "from one per triangle to 2^32 - 1");
        }
        Ok(())
    }

    /// The limit of references for a number of triangles.
    pub(crate) fn refs_limit(&self, triangles: usize) -> u64 {
        let usual = REFS_EACH * triangles as u64 + REFS_BESIDES;
        self.max_refs.unwrap_or(usual.min(MOST))
    }
}

impl Default for GridOptions {
    /// [`new`](Self::new).
    fn default() -> Self {
        Self::new()
    }
}

/// Why a grid was not built.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GridError {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_out_of_range_are_named() {
        let options = GridOptions::new;
        let rows = [
            (
                options().with_density(0.0),
                "option `density` must be positive and finite",
            ),
            (
                options().with_density(f32::NAN),
                "option `density` must be positive and finite",
            ),
            (
                options().with_density(f32::INFINITY),
                "option `density` must be positive and finite",
            ),
            (
                options().with_max_cells(0),
                "option `max_cells` must be from 1 to 2^32 - 1",
            ),
            (
                options().with_max_cells(1 << 32),
                "option `max_cells` must be from 1 to 2^32 - 1",
            ),
            (
                options().with_max_refs(9),
                "option `max_refs` must be from one per triangle to 2^32 - 1",
            ),
            (
                options().with_max_refs(1 << 32),
                "option `max_refs` must be from one per triangle to 2^32 - 1",
            ),
        ];
        for (options, message) in rows {
            let error = options.check(10).expect_err(message);
            assert_eq!(error.to_string(), message, "the message names the option");
        }
        assert_eq!(options().check(usize::MAX >> 40), Ok(()), "the usual ones");
    }

    #[test]
    fn references_are_limited_by_the_number_of_triangles() {
        assert_eq!(
            GridOptions::new().refs_limit(10),
            320 + (1 << 16),
            "32 each and 65 536"
        );
        assert_eq!(
            GridOptions::new().refs_limit(1 << 29),
            MOST,
            "the limit of 32 bits"
        );
        assert_eq!(
            GridOptions::new().with_max_refs(77).refs_limit(10),
            77,
            "the option"
        );
    }
}
