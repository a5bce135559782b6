//! Options of a build, and its errors.

use kd_core::{CostModel, Layout, MAX_DEPTH, MAX_TRIANGLES, TreeError};
use kd_tasks::{Cancelled, ThreadsError};
use thiserror::Error;

use crate::bins::MOST_BINS;

/// How the plane that divides a cell is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Method {
    /// The middle of the cell, axes in turn, down to [small leaves](BuildOptions::with_small_leaf). Has the most references
    /// and traces slowest; for comparison.
    Median,
    /// The plane of least SAH cost; counts all triangles for each candidate: O(N²), minutes above 10⁴ of them. The
    /// oracle of the other methods.
    Naive,
    /// The plane of least SAH cost by a sweep over events that are sorted in each cell: O(N log² N). A second oracle.
    Resort,
    /// The plane of least SAH cost by a sweep over events that are sorted once: O(N log N). Takes about 50 bytes per primitive
    /// more than [`Exact`](Self::Exact), for the same tree.
    Sweep,
    /// The plane of least SAH cost; sweeps only those of up to 256 bins that may contain it. The fastest of the
    /// exact methods; gives the same tree as [`Naive`](Self::Naive), [`Resort`](Self::Resort) and [`Sweep`](Self::Sweep).
    Exact,
    /// The best boundary between bins along each axis, [adjusted](BuildOptions::with_plane_adjustment) to the geometry
    /// beside it.
    Binned {
        /// Upper limit on the bins along each axis, 2 to 256. Cells of few primitives have fewer, down to 32 or this limit.
        bins: u16,
    },
    /// The minimum of a piecewise quadratic cost through 16 sampled planes per axis; exact for few primitives.
    Sampled {
        /// Samples all axes instead of only the longest.
        all_axes: bool,
    },
    /// [`Binned`](Self::Binned) in cells with more than `exact_below` primitives, [`Exact`](Self::Exact) in others.
    Hybrid {
        /// Upper limit on the bins along each axis, 2 to 256, as in [`Binned`](Self::Binned).
        bins: u16,
        /// Cells of at most this many primitives are divided exactly.
        exact_below: u32,
    },
}

/// Where the wide nodes of a mesh come from, in [`Layout::Wide`].
///
/// All but [`KdTree`](Self::KdTree) are made from the mesh itself, without a kd-tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum WideNodes {
    /// Triangles are divided as objects, by the surface area heuristic. The fastest to make.
    Objects,
    /// Planes divide cells of more than 1024 triangles where a division as objects leaves boxes that overlap, as between the walls of
    /// a room. Elsewhere triangles are divided as objects.
    Planes,
    /// The cheapest of several by SAH cost: [`Objects`](Self::Objects), [`Planes`](Self::Planes), and two trees of objects that are
    /// optimized afterwards. Takes twice the time of planes. Gains most where walls surround much clutter.
    Cheapest,
    /// The planes of the kd-tree that the other options describe divide cells of more than 1024 triangles. Triangles in smaller cells
    /// are divided as objects. Takes the time of the whole kd-tree.
    KdTree,
}

/// Options of a build. Start from a preset ([`balanced`](Self::balanced) is the default) and change single options.
///
/// The build checks its options, and its error names the one that is out of range. The tree depends, bit for bit, on the
/// primitives and on all options but [`with_threads`](Self::with_threads) and [`with_layout`](Self::with_layout).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
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
    pub(crate) layout: Layout,
    pub(crate) wide_nodes: WideNodes,
}

/// The default depth limit, for any number of primitives.
const DEPTH_CAP: u32 = 48;

impl BuildOptions {
    /// For meshes that change often: wide nodes of [`WideNodes::Objects`].
    ///
    /// Its kd-tree has planes across the longest axis of a cell only, and, in cells of more than 64 primitives, fewer bins that are
    /// searched for a better plane ([`with_plane_adjustment`](Self::with_plane_adjustment) 0.95). The kd-tree builds in 1.12 times the
    /// time of Embree's medium-quality build, and its SAH cost is 1.04 times that of [`best`](Self::best).
    /// (`cargo xtask builds --scenes DIR` on six meshes of 39 000 to 203 000 triangles, geometric means, one thread;
    /// `benches/records/2026-11-25-builds.jsonl`, as for the other presets. `cargo xtask first-ray --scenes DIR` has the times of wide
    /// nodes and of rays.)
    pub const fn fast() -> Self {
        Self {
            method: Method::Hybrid {
                bins: 256,
                exact_below: 64,
            },
            longest_axis: true,
            plane_adjustment: 0.95,
            wide_nodes: WideNodes::Objects,
            ..Self::balanced()
        }
    }

    /// The default: wide nodes of [`WideNodes::Planes`].
    ///
    /// Its kd-tree has planes from up to 256 bins in large cells, and exact planes in those of up to 64 primitives. It builds in 0.40
    /// times the time of Embree's high-quality build, and its SAH cost is 1.003 times that of [`best`](Self::best).
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
            wide_nodes: WideNodes::Planes,
        }
    }

    /// For many rays through a mesh that stays: wide nodes of [`WideNodes::Cheapest`].
    ///
    /// Its kd-tree has exact planes everywhere: the least SAH cost that choosing plane by plane gives. It builds in 0.45 times the time
    /// of Embree's high-quality build.
    pub const fn best() -> Self {
        Self {
            method: Method::Exact,
            wide_nodes: WideNodes::Cheapest,
            ..Self::balanced()
        }
    }

    /// Sets how the planes of the kd-tree are chosen. Wide nodes then follow these planes ([`WideNodes::KdTree`]).
    #[must_use]
    pub const fn with_method(mut self, method: Method) -> Self {
        self.method = method;
        self.wide_nodes = WideNodes::KdTree;
        self
    }

    /// Sets where wide nodes come from. The functions of kd-sah ignore it.
    #[must_use]
    pub const fn with_wide_nodes(mut self, wide_nodes: WideNodes) -> Self {
        self.wide_nodes = wide_nodes;
        self
    }

    /// Sets the costs of the steps of a traversal. Costs must be positive and finite, lanes at least 1, and the empty
    /// bonus in (0, 1].
    #[must_use]
    pub const fn with_cost(mut self, cost: CostModel) -> Self {
        self.cost = cost;
        self
    }

    /// Sets the upper limit on interior nodes above a leaf, at most [`MAX_DEPTH`]. The default is 8 + 1.3 log₂ N, at most 48
    /// (Havran and Bittner 2002).
    #[must_use]
    pub const fn with_max_depth(mut self, max_depth: u32) -> Self {
        self.max_depth = Some(max_depth);
        self
    }

    /// Sets the upper limit on references in all leaves together; at least one per primitive counts. Cells become leaves where
    /// the limit is reached, and no primitive is lost. The default is 64 per primitive.
    ///
    /// A cell's share of the limit is divided between its children in proportion to their primitives, so that the tree does not
    /// depend on the order of the build. [`TreeStats::limited_cells`](kd_core::TreeStats::limited_cells) counts the cells that
    /// became leaves by it. Wide nodes that are made without a kd-tree keep to the limit too: cells are divided as objects where it is
    /// reached. Their default is one and a half for each triangle.
    #[must_use]
    pub const fn with_max_refs(mut self, max_refs: u64) -> Self {
        self.max_refs = Some(max_refs);
        self
    }

    /// Makes every cell with at most this many primitives a leaf (the slides' `K_MaxTriangles`). The default is 1.
    #[must_use]
    pub const fn with_small_leaf(mut self, primitives: u32) -> Self {
        self.small_leaf = primitives;
        self
    }

    /// Sets how many splits in a row, on the path to a leaf, may cost more than they save (Havran and Bittner 2002). The default
    /// is 0.
    #[must_use]
    pub const fn with_bad_refines(mut self, bad_refines: u32) -> Self {
        self.bad_refines = bad_refines;
        self
    }

    /// Sets whether a leaf replaces a finished subtree that costs no less. The default is `true`.
    #[must_use]
    pub const fn with_retraction(mut self, retraction: bool) -> Self {
        self.retraction = retraction;
        self
    }

    /// Sets the number of threads: 1 builds on the calling thread, 0 in the thread pool in scope (by default one thread per core).
    /// Without feature `parallel` it is always one. The tree does not depend on it. A build starts no more threads than it can use:
    /// one for every 256 primitives, and eight for each core.
    #[must_use]
    pub const fn with_threads(mut self, threads: usize) -> Self {
        self.threads = threads;
        self
    }

    /// Sets the layout that rays traverse. The kd-tree does not depend on it; the functions of kd-sah ignore it.
    #[must_use]
    pub const fn with_layout(mut self, layout: Layout) -> Self {
        self.layout = layout;
        self
    }

    /// See [`with_method`](Self::with_method).
    pub const fn method(&self) -> Method {
        self.method
    }

    /// See [`with_threads`](Self::with_threads).
    pub const fn threads(&self) -> usize {
        self.threads
    }

    /// See [`with_layout`](Self::with_layout).
    pub const fn layout(&self) -> Layout {
        self.layout
    }

    /// See [`with_wide_nodes`](Self::with_wide_nodes).
    pub const fn wide_nodes(&self) -> WideNodes {
        self.wide_nodes
    }

    /// See [`with_cost`](Self::with_cost).
    pub const fn cost(&self) -> CostModel {
        self.cost
    }

    /// See [`with_max_depth`](Self::with_max_depth); `None` for the default, which [`depth_limit`](Self::depth_limit) computes.
    pub const fn max_depth(&self) -> Option<u32> {
        self.max_depth
    }

    /// See [`with_max_refs`](Self::with_max_refs); `None` for the default.
    pub const fn max_refs(&self) -> Option<u64> {
        self.max_refs
    }

    /// See [`with_small_leaf`](Self::with_small_leaf).
    pub const fn small_leaf(&self) -> u32 {
        self.small_leaf
    }

    /// See [`with_bad_refines`](Self::with_bad_refines).
    pub const fn bad_refines(&self) -> u32 {
        self.bad_refines
    }

    /// See [`with_retraction`](Self::with_retraction).
    pub const fn retraction(&self) -> bool {
        self.retraction
    }

    /// See [`with_longest_axis`](Self::with_longest_axis).
    pub const fn longest_axis(&self) -> bool {
        self.longest_axis
    }

    /// See [`with_plane_adjustment`](Self::with_plane_adjustment).
    pub const fn plane_adjustment(&self) -> f32 {
        self.plane_adjustment
    }

    /// See [`with_median_levels`](Self::with_median_levels).
    pub const fn median_levels(&self) -> u32 {
        self.median_levels
    }

    /// Sets whether planes are searched across the longest axis of each cell only, except planes that cut off empty space. Builds
    /// faster, for a tree of slightly higher cost. The default is `false`.
    #[must_use]
    pub const fn with_longest_axis(mut self, longest_axis: bool) -> Self {
        self.longest_axis = longest_axis;
        self
    }

    /// Sets which bins are searched for a better plane than the best boundary between bins: the most promising of those in which a
    /// plane may cost less than `factor` times that boundary. The search is exact: it evaluates the bounds of the primitives in
    /// the bin. 0 searches no bin, 1 every bin that may improve the plane; lower factors take less time and skip the smallest
    /// gains first. The default is 1. Methods without bins ignore it.
    #[must_use]
    pub const fn with_plane_adjustment(mut self, factor: f32) -> Self {
        self.plane_adjustment = factor;
        self
    }

    /// Divides the first `levels` levels at the middle of each cell, at any cost, and the rest by the method. The default is 0.
    ///
    /// This is the simple way to give each thread a subtree of its own (Shi 2011 §3.1.3): a top of medians with as many
    /// cells as threads. It serves as a comparison; the tree has a higher cost, and depends on the number of levels.
    #[must_use]
    pub const fn with_median_levels(mut self, levels: u32) -> Self {
        self.median_levels = levels;
        self
    }

    /// Checks the options as a build does.
    ///
    /// # Errors
    ///
    /// [`BuildError::InvalidOption`] names the first option that is out of range.
    pub fn check(&self) -> Result<(), BuildError> {
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

    /// The depth limit for N `primitives`: the one that was set, or 8 + 1.3 log₂ N, at most 48. Computed in integers, so that
    /// every platform agrees.
    pub fn depth_limit(&self, primitives: usize) -> u32 {
        self.max_depth
            .unwrap_or_else(|| (8 + 13 * primitives.max(1).ilog2() / 10).min(DEPTH_CAP))
    }

    /// The limit on references for `primitives`, at least one each.
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

/// Why a build failed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum BuildError {
    /// An option is out of range.
    #[error("option `{name}` must be {rule}")]
    InvalidOption {
        /// The option.
        name: &'static str,
        /// Its range.
        rule: &'static str,
    },
    /// A primitive's box is not finite, or is empty. Never the case for a mesh.
    #[error("primitive {primitive} has no finite box")]
    NotFinite {
        /// Its number.
        primitive: u32,
    },
    /// More primitives than [`MAX_TRIANGLES`](kd_core::MAX_TRIANGLES). Never the case for a mesh.
    #[error("{primitives} primitives are too many, at most {MAX_TRIANGLES} fit")]
    TooManyPrimitives {
        /// Their number.
        primitives: u32,
    },
    /// The tree outgrew the 30 bits of a node index; [`BuildOptions::with_max_refs`] limits it.
    #[error("the tree is too large: {0}; lower `max_refs`")]
    TooLarge(#[from] TreeError),
    /// The [`BuildProgress`](crate::BuildProgress) callback cancelled the build.
    #[error("the build was cancelled")]
    Cancelled,
    /// The threads asked for could not be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
}

impl From<Cancelled> for BuildError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
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
    fn getters_return_what_was_set() {
        let cost = CostModel::CLASSIC;
        let options = BuildOptions::fast()
            .with_method(Method::Naive)
            .with_cost(cost)
            .with_max_depth(12)
            .with_max_refs(34)
            .with_small_leaf(5)
            .with_bad_refines(6)
            .with_retraction(false)
            .with_threads(7)
            .with_layout(Layout::Binary)
            .with_longest_axis(true)
            .with_plane_adjustment(0.25)
            .with_median_levels(8);
        assert_eq!(
            (options.method(), options.cost(), options.layout()),
            (Method::Naive, cost, Layout::Binary)
        );
        assert_eq!(
            (options.max_depth(), options.max_refs()),
            (Some(12), Some(34))
        );
        assert_eq!((options.small_leaf(), options.bad_refines()), (5, 6));
        assert_eq!((options.threads(), options.median_levels()), (7, 8));
        assert_eq!(
            (options.retraction(), options.longest_axis()),
            (false, true)
        );
        assert_eq!(options.plane_adjustment(), 0.25);
        let defaults = BuildOptions::default();
        assert_eq!((defaults.max_depth(), defaults.max_refs()), (None, None));
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
