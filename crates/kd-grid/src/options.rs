//! What a user can ask of a grid.

use kd_tasks::ThreadsError;
use thiserror::Error;

/// Which cells a triangle is entered in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Overlap {
    /// All that its box meets: quickest to find, and right for triangles that are smaller than a cell.
    Box,
    /// Those among them that the triangle itself meets. Triangles whose boxes meet fewer than 16 cells, or a row of them, are
    /// entered as by [`Box`](Self::Box), since little is to be won there.
    Exact,
}

/// Options of a grid.
///
/// The grid depends on the mesh and on the options except [`with_threads`](Self::with_threads), bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct GridOptions {
    pub(crate) density: f32,
    pub(crate) overlap: Overlap,
    pub(crate) max_cells: u64,
    pub(crate) max_refs: Option<u64>,
    pub(crate) threads: usize,
}

/// No grid has more cells, and none more references: both are counted with 32 bits.
pub(crate) const MOST: u64 = u32::MAX as u64;

/// References that there may be for each triangle, unless [`GridOptions::with_max_refs`] says otherwise.
const REFS_EACH: u64 = 32;
/// And so many besides, so that few large triangles may fill their grid.
const REFS_BESIDES: u64 = 1 << 16;

impl GridOptions {
    /// Two cells for each triangle.
    pub const fn new() -> Self {
        Self {
            // From 1 to 16, rays take about as long on a scan and in a room, within noise, and each doubling takes 1.2 to 1.4 times
            // as long to build. (From a throw-away program, 2026-11-28.)
            density: 2.0,
            overlap: Overlap::Exact,
            max_cells: 1 << 28,
            max_refs: None,
            threads: 0,
        }
    }

    /// How many cells there are for each triangle, positive and finite: the number of cells is proportional to that of
    /// triangles (Cleary and Wyvill 1988). Cells are as near to cubes as whole numbers of them allow, so there are a little
    /// fewer.
    #[must_use]
    pub const fn with_density(mut self, cells_per_triangle: f32) -> Self {
        self.density = cells_per_triangle;
        self
    }

    /// Which cells a triangle is entered in.
    #[must_use]
    pub const fn with_overlap(mut self, overlap: Overlap) -> Self {
        self.overlap = overlap;
        self
    }

    /// The most cells, from 1 to 2³² − 1. A cell takes 4 bytes. Without it, 2²⁸.
    #[must_use]
    pub const fn with_max_cells(mut self, max_cells: u64) -> Self {
        self.max_cells = max_cells;
        self
    }

    /// The most references, from one per triangle to 2³² − 1: a triangle has one in each cell that its box meets. A grid
    /// that would have more is made of cells twice as long, until it has not, so that time and memory are bounded whatever
    /// the triangles; [`GridStats::halvings`](crate::GridStats::halvings) tells. Without it, 32 per triangle and 65 536
    /// besides. A reference takes 4 bytes, 8 while the grid is built, and for each thread those of a thousand triangles up to
    /// 24.
    #[must_use]
    pub const fn with_max_refs(mut self, max_refs: u64) -> Self {
        self.max_refs = Some(max_refs);
        self
    }

    /// How many threads build: 1 builds on the calling thread, 0 uses the thread pool in scope (by default as many as there
    /// are cores). Without feature `parallel` it is always one, and for up to 32 768 triangles, which are done before another one is
    /// awake. The grid does not depend on it.
    #[must_use]
    pub const fn with_threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    pub(crate) fn check(&self, triangles: usize) -> Result<(), BuildError> {
        let invalid = |name, rule| Err(BuildError::InvalidOption { name, rule });
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

    /// The limit of references for so many triangles.
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

/// Why there is no grid.
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
    /// The threads asked for could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_options_are_named() {
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
            "32 each and some"
        );
        assert_eq!(
            GridOptions::new().refs_limit(1 << 29),
            MOST,
            "as far as 32 bits count"
        );
        assert_eq!(
            GridOptions::new().with_max_refs(77).refs_limit(10),
            77,
            "as asked for"
        );
    }
}
