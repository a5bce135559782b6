//! What a user can ask of a build.

use kd_core::{CostModel, Layout, MAX_DEPTH, TreeError};
use kd_tasks::ThreadsError;
use thiserror::Error;

use crate::bins::MOST_BINS;

/// How to choose the plane that divides a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// The middle of the cell, axes in turn, down to [small leaves](BuildOptions::with_small_leaf). Duplicates the most
    /// and traces slowest; for comparison.
    Median,
    /// The plane of least SAH cost, each candidate counted over all triangles: O(N²), minutes above 10⁴ of them. The
    /// oracle of the others.
    Naive,
    /// The plane of least SAH cost by a sweep over events sorted anew in each cell: O(N log² N). An oracle too.
    Resort,
    /// The plane of least SAH cost by a sweep over events sorted once: O(N log N). Gives the same tree, in more memory
    /// than [`Exact`](Self::Exact): about 50 bytes more for each primitive.
    Sweep,
    /// The plane of least SAH cost, looked for only in those of up to 256 bins that may hold it. The fastest of the
    /// exact ones; gives the same tree as [`Naive`](Self::Naive), [`Resort`](Self::Resort) and [`Sweep`](Self::Sweep).
    Exact,
    /// The best boundary between bins along each axis, [adjusted](BuildOptions::with_plane_adjustment) to the geometry
    /// beside it.
    Binned {
        /// Most bins along each axis, 2 to 256. Cells of few primitives have fewer, but at least 32 if that many are
        /// allowed.
        bins: u16,
    },
    /// The least of a piecewise quadratic cost through 16 sampled planes an axis; exact for few primitives.
    Sampled {
        /// Samples all axes instead of only the longest.
        all_axes: bool,
    },
    /// [`Binned`](Self::Binned) in cells with more than `exact_below` primitives, [`Exact`](Self::Exact) in others.
    Hybrid {
        /// Most bins along each axis, 2 to 256, as in [`Binned`](Self::Binned).
        bins: u16,
        /// The most primitives of a cell that is divided exactly.
        exact_below: u32,
    },
}

/// Options of a build. Start from a preset ([`balanced`](Self::balanced) is the default) and change what you need.
///
/// Options are checked by the build, which names the one that is wrong. The tree depends on the primitives and on
/// the options except [`with_threads`](Self::with_threads) and [`with_layout`](Self::with_layout), bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct BuildOptions {
    pub(crate) method: Method,
    pub(crate) cost: CostModel,
    pub(crate) max_depth: Option<u32>,
    pub(crate) max_refs: Option<u64>,
    pub(crate) small_leaf: u32,
    pub(crate) bad_refines: u32,
    pub(crate) retraction: bool,
    pub(crate) threads: usize,
    pub(crate) median_levels: u32,
    pub(crate) longest_axis: bool,
    pub(crate) plane_adjustment: f32,
    layout: Layout,
}

/// The depth that no builder exceeds, whatever the number of primitives.
const DEPTH_CAP: u32 = 48;

impl BuildOptions {
    /// For meshes that change often: planes across the longest axis of a cell only, between bins as they are in cells of
    /// more than 64 primitives.
    ///
    /// Builds in 1.12 times the time of Embree's medium-quality build, traces in 1.00 times the time of
    /// [`best`](Self::best), and its SAH cost is 1.04 times that of `best`.
    /// (`cargo xtask builds --scenes DIR` on six meshes of 39 000 to 203 000 triangles, geometric means, one thread;
    /// `benches/records/2026-11-25-builds.jsonl`, as for the other presets.)
    pub const fn fast() -> Self {
        Self {
            method: Method::Hybrid {
                bins: 256,
                exact_below: 64,
            },
            longest_axis: true,
            plane_adjustment: 0.95,
            ..Self::balanced()
        }
    }

    /// The default: up to 256 bins in large cells, exact planes in those of up to 64 primitives.
    ///
    /// Builds in 0.40 times the time of Embree's high-quality build, traces in 1.00 times the time of
    /// [`best`](Self::best), and its SAH cost is 1.003 times that of `best`.
    pub const fn balanced() -> Self {
        Self {
            method: Method::Hybrid {
                bins: 256,
                exact_below: 64,
            },
            cost: CostModel::PACKED,
            max_depth: None,
            max_refs: None,
            small_leaf: 1,
            bad_refines: 0,
            retraction: true,
            threads: 0,
            median_levels: 0,
            longest_axis: false,
            plane_adjustment: 1.0,
            layout: Layout::Wide,
        }
    }

    /// Exact planes everywhere: the least SAH cost that choosing plane by plane gives.
    ///
    /// Builds in 0.45 times the time of Embree's high-quality build.
    pub const fn best() -> Self {
        Self {
            method: Method::Exact,
            ..Self::balanced()
        }
    }

    /// How to choose planes.
    #[must_use]
    pub const fn with_method(mut self, method: Method) -> Self {
        self.method = method;
        self
    }

    /// What the steps of a traversal cost. The costs must be positive and finite, lanes at least 1, and the empty
    /// bonus in (0, 1].
    #[must_use]
    pub const fn with_cost(mut self, cost: CostModel) -> Self {
        self.cost = cost;
        self
    }

    /// The most interior nodes above a leaf, at most [`MAX_DEPTH`]. Without it, 8 + 1.3 log₂ N and at most 48
    /// (Havran and Bittner 2002).
    #[must_use]
    pub const fn with_max_depth(mut self, max_depth: u32) -> Self {
        self.max_depth = Some(max_depth);
        self
    }

    /// The most references in all leaves together, at least one per primitive. Where refinement reaches it, cells
    /// become leaves as they are; nothing is lost. Without it, 64 per primitive.
    ///
    /// A cell's share is divided between its children in proportion to what they hold, so the outcome does not
    /// depend on the order of the build. [`TreeStats::limited_cells`](kd_core::TreeStats::limited_cells) counts the cells
    /// that were not divided for it, and the text form of the statistics says so if there are any.
    #[must_use]
    pub const fn with_max_refs(mut self, max_refs: u64) -> Self {
        self.max_refs = Some(max_refs);
        self
    }

    /// A cell with at most this many primitives becomes a leaf at once (the slides' `K_MaxTriangles`).
    #[must_use]
    pub const fn with_small_leaf(mut self, primitives: u32) -> Self {
        self.small_leaf = primitives;
        self
    }

    /// How many splits in a row from the root to a leaf may cost more than they save, in the hope that further ones
    /// pay (Havran and Bittner 2002).
    #[must_use]
    pub const fn with_bad_refines(mut self, bad_refines: u32) -> Self {
        self.bad_refines = bad_refines;
        self
    }

    /// Whether a finished subtree that costs no less than a leaf in its place is replaced by that leaf.
    #[must_use]
    pub const fn with_retraction(mut self, retraction: bool) -> Self {
        self.retraction = retraction;
        self
    }

    /// How many threads build: 1 builds on the calling thread, 0 uses the thread pool in scope (by default as many
    /// as there are cores). Without feature `parallel` it is always one. The tree does not depend on it.
    #[must_use]
    pub const fn with_threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// How the finished tree lies in memory to be traced. The tree does not depend on it.
    #[must_use]
    pub const fn with_layout(mut self, layout: Layout) -> Self {
        self.layout = layout;
        self
    }

    /// How planes are chosen: see [`with_method`](Self::with_method).
    pub const fn method(&self) -> Method {
        self.method
    }

    /// How many threads build: see [`with_threads`](Self::with_threads).
    pub const fn threads(&self) -> usize {
        self.threads
    }

    /// How the finished tree lies in memory: see [`with_layout`](Self::with_layout).
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// Whether planes are looked for across the longest axis of each cell only, those that cut off empty space
    /// excepted. Takes less time, for a tree that is a little worse.
    #[must_use]
    pub const fn with_longest_axis(mut self, longest_axis: bool) -> Self {
        self.longest_axis = longest_axis;
        self
    }

    /// When planes found by bins are adjusted: bins in which a plane may cost less than `factor` times what the best
    /// boundary between bins costs are looked into, the most promising ones, and where primitives start and end there is
    /// judged exactly. From 0, never, to 1, whenever it may help. Less of it takes less time; what it saves first is
    /// what brings little. Methods without bins take no notice.
    #[must_use]
    pub const fn with_plane_adjustment(mut self, factor: f32) -> Self {
        self.plane_adjustment = factor;
        self
    }

    /// Divides the first `levels` levels at the middle of each cell, whatever that costs, and the rest by the method.
    ///
    /// This is the simple way to give each thread a subtree of its own (Shi 2011 §3.1.3): a top of medians with as many
    /// cells as there are threads. It is here to compare with; the tree is worse, and depends on the levels.
    #[must_use]
    pub const fn with_median_levels(mut self, levels: u32) -> Self {
        self.median_levels = levels;
        self
    }

    pub(crate) fn check(&self) -> Result<(), BuildError> {
        let invalid = |name, rule| Err(BuildError::InvalidOption { name, rule });
        if let Some((name, rule)) = self.cost.problem() {
            return invalid(name, rule);
        }
        if self.max_depth.is_some_and(|d| d as usize > MAX_DEPTH) {
            return invalid("max_depth", "at most MAX_DEPTH (64)");
        }
        if let Method::Binned { bins } | Method::Hybrid { bins, .. } = self.method
            && !(2..=MOST_BINS).contains(&usize::from(bins))
        {
            return invalid("bins", "from 2 to 256");
        }
        if !(0.0..=1.0).contains(&self.plane_adjustment) {
            return invalid("plane_adjustment", "from 0 to 1");
        }
        Ok(())
    }

    /// The depth limit for so many primitives: the one that was set, or 8 + 1.3 log₂ N and at most 48. In whole numbers, so
    /// that every platform agrees.
    pub fn depth_limit(&self, primitives: usize) -> u32 {
        self.max_depth
            .unwrap_or_else(|| (8 + 13 * primitives.max(1).ilog2() / 10).min(DEPTH_CAP))
    }

    /// The limit of references for so many primitives, never less than one each.
    pub(crate) fn refs_limit(&self, primitives: usize) -> u64 {
        let primitives = primitives as u64;
        self.max_refs.unwrap_or(64 * primitives).max(primitives)
    }
}

impl Default for BuildOptions {
    /// [`balanced`](Self::balanced).
    fn default() -> Self {
        Self::balanced()
    }
}

/// Why there is no tree.
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
    /// A primitive's box is not finite, or is empty. Never the case for a mesh.
    #[error("primitive {primitive} has no finite box")]
    NotFinite {
        /// Its number.
        primitive: u32,
    },
    /// More primitives than [`MAX_TRIANGLES`](kd_core::MAX_TRIANGLES). Never the case for a mesh.
    #[error("{primitives} primitives are too many")]
    TooManyPrimitives {
        /// How many there are.
        primitives: u32,
    },
    /// The tree outgrew the 30 bits of a node index; ask for fewer references.
    #[error("the tree is too large: {0}")]
    TooLarge(#[from] TreeError),
    /// The build was watched, and the watch ended it.
    #[error("the build was cancelled")]
    Cancelled,
    /// The threads asked for could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_options_are_named() {
        let with = |change: fn(&mut CostModel)| {
            let mut cost = CostModel::CLASSIC;
            change(&mut cost);
            BuildOptions::balanced().with_cost(cost)
        };
        let rows = [
            (
                with(|c| c.traverse = 0.0),
                "option `cost.traverse` must be positive and finite",
            ),
            (
                with(|c| c.intersect = f32::NAN),
                "option `cost.intersect` must be positive and finite",
            ),
            (
                with(|c| c.intersect = f32::INFINITY),
                "option `cost.intersect` must be positive and finite",
            ),
            (
                with(|c| c.empty_bonus = 1.5),
                "option `cost.empty_bonus` must be in (0, 1]",
            ),
            (
                with(|c| c.empty_bonus = f32::NAN),
                "option `cost.empty_bonus` must be in (0, 1]",
            ),
            (
                with(|c| c.lanes = 0),
                "option `cost.lanes` must be at least 1",
            ),
            (
                BuildOptions::balanced().with_max_depth(65),
                "option `max_depth` must be at most MAX_DEPTH (64)",
            ),
        ];
        for (options, message) in rows {
            let error = options.check().expect_err(message);
            assert_eq!(error.to_string(), message, "the message names the option");
        }
    }

    #[test]
    fn limits_follow_the_number_of_primitives() {
        let options = BuildOptions::balanced();
        let depths = [0, 1, 2, 1 << 10, 1 << 20, (1 << 30) - 1].map(|n| options.depth_limit(n));
        assert_eq!(
            depths,
            [8, 8, 9, 21, 34, 45],
            "8 + 1.3 log2 N, rounded down"
        );
        assert_eq!(options.refs_limit(10), 640, "64 each");
        assert_eq!(
            options.clone().with_max_refs(3).refs_limit(10),
            10,
            "at least one each"
        );
    }
}
