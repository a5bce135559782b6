//! Layouts: the copies of a tree and its triangles that rays traverse, and the one policy that chooses them.
//!
//! | made by | layout | wide nodes come from |
//! |---|---|---|
//! | [`KdTree::build`], [`LazyTree::finish`] | [`BuildOptions::layout`] | the options, see below |
//! | [`KdTree::with_layout`] | the argument | the options that the tree was built with |
//! | [`KdTree::load`], [`KdTree::open`] | that of the saved tree | the saved tree |
//! | [`LazyTree`] | always binary: its cells are small kd-trees, each laid out when a ray enters it | |
//! | [`Strategy::Rebuild`] of a [`Scene`] | the layout in the strategy's own options | those options |
//! | [`Strategy::Auto`] | the layout in the scene's options; [`Layout::Binary`] merges kd-trees as by [`MergeMethod::PartitionTrees`] | static parts: the scene's options; others: objects |
//! | [`MergeMethod::PartitionTrees`], [`BspMerge`](MergeMethod::BspMerge), [`Insertion`](MergeMethod::Insertion) | always binary: merged kd-trees share subtrees of 8-byte nodes with the frame before, while wide nodes would be rebuilt for every frame | |
//! | [`MergeMethod::Guided`], [`Strategy::Refit`], [`Instances`](Strategy::Instances), [`Dual`](Strategy::Dual) | always wide: only wide nodes are refitted and joined; [`Layout::Binary`] in the scene's options is a [`CommitError::Layout`](crate::scene::CommitError::Layout) | static parts: the scene's options; others: objects |
//!
//! # Where wide nodes come from
//!
//! [`BuildOptions::wide_nodes`] says so, for the static parts of a scene too. Presets make wide nodes from the mesh itself:
//!
//! - [`WideNodes::Objects`], by [`BuildOptions::fast`]: triangles are divided as objects all the way down.
//! - [`WideNodes::Planes`], by [`BuildOptions::balanced`]: planes divide cells of more than 1024 triangles where boxes of objects
//!   overlap much; elsewhere triangles are divided as objects.
//! - [`WideNodes::Cheapest`], by [`BuildOptions::best`]: the cheapest by SAH cost of both, and of two trees of objects that are optimized
//!   afterwards.
//! - [`WideNodes::KdTree`], by [`BuildOptions::with_method`]: the planes of the kd-tree divide cells of more than 1024 triangles;
//!   below, triangles are divided as objects. Only these need a kd-tree; it is built first.
//!
//! A mesh of at most 1024 triangles therefore has the same wide nodes with the first three. To trace the very cells that a builder
//! made, choose [`Layout::Binary`].

use std::ops::ControlFlow;

use kd_core::{Hit, Mesh, Ray, Tree};
use kd_points::PointTree;
use kd_sah::{BuildError, BuildProgress};
use kd_tasks::Cancelled;
use kd_trace::kit::{self, Collect};
use kd_trace::{Division, delegate_ray_query};

use crate::{BuildOptions, Layout, MergeMethod, Strategy, WideNodes};
#[cfg(doc)]
use crate::{KdTree, LazyTree, Scene};

pub use kd_core::LayoutBytes;
#[cfg(feature = "counters")]
pub use kd_trace::TraversalCounts;
pub use kd_trace::{Level, PackedTree, WideTree};

/// The share of the work of a build that is the kd-tree, where there is one.
const TREE_SHARE: f32 = 0.75;

/// A layout, and the kd-tree that it was made from, if it was.
pub(crate) type LaidOut = (TreeLayout, Option<Tree>);

/// Builds what rays through a mesh traverse, by the options.
pub(crate) fn build(
    mesh: &Mesh,
    options: &BuildOptions,
    progress: Option<&BuildProgress<'_>>,
) -> Result<LaidOut, BuildError> {
    options.check()?;
    let policy = LayoutPolicy::new(options);
    let threads = kd_tasks::useful_threads(options.threads(), mesh.len());
    kd_tasks::in_pool_of(threads, || {
        if policy.layout == Layout::Wide
            && let Some(wide) = policy.wide_tree_of_mesh(mesh, progress)
        {
            return wide.map(|wide| (TreeLayout::Wide(wide), None));
        }
        let Some(progress) = progress else {
            let tree = build_kd_tree(mesh, options, None)?;
            return Ok((policy.lay_out(&tree, mesh), Some(tree)));
        };
        let tree = build_kd_tree(mesh, options, Some(&|done| progress(TREE_SHARE * done)))?;
        let rest = |done: f32| progress(TREE_SHARE + (1.0 - TREE_SHARE) * done);
        let layout = policy.try_lay_out(&tree, mesh, Some(&rest))?;
        Ok((layout, Some(tree)))
    })?
}

/// Builds wide nodes, whatever layout the options say.
pub(crate) fn build_wide(mesh: &Mesh, options: &BuildOptions) -> Result<WideTree, BuildError> {
    match build(mesh, &options.clone().with_layout(Layout::Wide), None)?.0 {
        TreeLayout::Wide(wide) => Ok(wide),
        TreeLayout::Binary(_) => unreachable!("the options say wide nodes"),
    }
}

/// Builds the kd-tree of the options, whatever rays traverse.
pub(crate) fn build_kd_tree(
    mesh: &Mesh,
    options: &BuildOptions,
    progress: Option<&BuildProgress<'_>>,
) -> Result<Tree, BuildError> {
    match progress {
        Some(progress) => kd_sah::build_with_progress(mesh, options, progress),
        None => kd_sah::build(mesh, options),
    }
}

/// How trees are laid out: what [`BuildOptions`] say about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LayoutPolicy {
    layout: Layout,
    wide_nodes: WideNodes,
    most_references: Option<u64>,
    is_parallel: bool,
}

impl LayoutPolicy {
    pub(crate) fn new(options: &BuildOptions) -> Self {
        Self {
            layout: options.layout(),
            wide_nodes: options.wide_nodes(),
            most_references: options.max_refs(),
            is_parallel: options.threads() != 1,
        }
    }

    /// Whether a layout is made from a kd-tree.
    pub(crate) fn follows_kd_tree(self) -> bool {
        self.layout == Layout::Binary || self.wide_nodes == WideNodes::KdTree
    }

    /// Lays out a tree over `mesh`, on the calling thread or on those of the pool in scope. Wide nodes follow the tree.
    pub(crate) fn lay_out(self, tree: &Tree, mesh: &Mesh) -> TreeLayout {
        self.try_lay_out(tree, mesh, None)
            .expect("nothing cancels it")
    }

    fn try_lay_out(
        self,
        tree: &Tree,
        mesh: &Mesh,
        progress: Option<&BuildProgress<'_>>,
    ) -> Result<TreeLayout, Cancelled> {
        if self.layout == Layout::Wide {
            let wide = WideTree::of_kd_tree(tree, mesh, self.is_parallel, progress);
            return wide.map(TreeLayout::Wide);
        }
        let packed = self.packed_tree(tree, mesh);
        match progress.map(|progress| progress(1.0)) {
            Some(ControlFlow::Break(())) => Err(Cancelled),
            _ => Ok(TreeLayout::Binary(packed)),
        }
    }

    /// Wide nodes that need no kd-tree; `None` if the options want those of one.
    fn wide_tree_of_mesh(
        self,
        mesh: &Mesh,
        progress: Option<&BuildProgress<'_>>,
    ) -> Option<Result<WideTree, BuildError>> {
        let most_references = self.most_references.unwrap_or(u64::MAX);
        let division = match self.wide_nodes {
            WideNodes::Objects => Division::Objects,
            WideNodes::Planes => Division::Planes { most_references },
            WideNodes::Cheapest => Division::Cheapest { most_references },
            _ => return None,
        };
        let wide = WideTree::build(mesh, division, self.is_parallel, progress);
        Some(wide.map_err(BuildError::from))
    }

    /// Wide nodes for a mesh that soon changes.
    pub(crate) fn wide_tree_of_objects(self, mesh: &Mesh) -> WideTree {
        if self.is_parallel {
            return WideTree::from_objects_parallel(mesh);
        }
        WideTree::from_objects(mesh)
    }

    fn packed_tree(self, tree: &Tree, mesh: &Mesh) -> PackedTree {
        if self.is_parallel {
            return PackedTree::new_parallel(tree, mesh);
        }
        PackedTree::new(tree, mesh)
    }

    /// What the frames of a strategy consist of; `None` where the strategy has no frames of the layout that is asked for.
    pub(crate) fn frames_of(self, strategy: &Strategy) -> Option<FrameLayout<'_>> {
        let is_binary = self.layout == Layout::Binary;
        match strategy {
            Strategy::Rebuild(options) => Some(FrameLayout::OneMesh(options)),
            Strategy::Merge(method) if *method != MergeMethod::Guided => {
                Some(FrameLayout::MergedTrees(*method))
            }
            Strategy::Auto if is_binary => {
                Some(FrameLayout::MergedTrees(MergeMethod::PartitionTrees))
            }
            Strategy::Auto
            | Strategy::Merge(_)
            | Strategy::Refit
            | Strategy::Instances
            | Strategy::Dual => (!is_binary).then_some(FrameLayout::WideParts),
        }
    }
}

/// What a frame consists of.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FrameLayout<'a> {
    /// Wide nodes of each part.
    WideParts,
    /// One kd-tree, merged from those of the parts, in the binary layout.
    MergedTrees(MergeMethod),
    /// One kd-tree, built over all triangles and laid out by these options.
    OneMesh(&'a BuildOptions),
}

/// A tree and its triangles in either layout.
#[derive(Clone, Debug)]
pub(crate) enum TreeLayout {
    Binary(PackedTree),
    Wide(WideTree),
}

/// A borrowed [`TreeLayout`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum TreeLayoutRef<'a> {
    Binary(&'a PackedTree),
    Wide(&'a WideTree),
}

impl TreeLayout {
    pub(crate) fn layout(&self) -> Layout {
        match self {
            Self::Binary(_) => Layout::Binary,
            Self::Wide(_) => Layout::Wide,
        }
    }

    pub(crate) fn with_level(self, level: Level) -> Self {
        match self {
            Self::Binary(tree) => Self::Binary(tree.with_level(level)),
            Self::Wide(tree) => Self::Wide(tree.with_level(level)),
        }
    }

    #[inline]
    pub(crate) fn borrowed(&self) -> TreeLayoutRef<'_> {
        match self {
            Self::Binary(tree) => TreeLayoutRef::Binary(tree),
            Self::Wide(tree) => TreeLayoutRef::Wide(tree),
        }
    }
}

impl<'a> From<TreeLayoutRef<'a>> for PointTree<'a> {
    fn from(layout: TreeLayoutRef<'a>) -> Self {
        match layout {
            TreeLayoutRef::Binary(tree) => Self::Packed(tree),
            TreeLayoutRef::Wide(tree) => Self::Wide(tree),
        }
    }
}

impl TreeLayoutRef<'_> {
    pub(crate) fn bytes(self) -> LayoutBytes {
        match self {
            Self::Binary(tree) => tree.bytes(),
            Self::Wide(tree) => tree.bytes(),
        }
    }

    /// Gives the collector every hit of the ray that it may want.
    pub(crate) fn collect<C: Collect>(self, ray: &Ray, collector: &mut C) {
        match self {
            Self::Binary(tree) => kit::collect_packed(tree, ray, collector),
            Self::Wide(tree) => kit::collect_wide(tree, ray, collector),
        }
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for TreeLayoutRef<'_>: single, behind, batch, packet;
    Self::Binary(tree) => tree,
    Self::Wide(tree) => tree,
}
