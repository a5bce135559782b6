//! Layouts: the copies of a tree and its triangles that rays traverse, and the one policy that chooses them.
//!
//! | made by | layout | wide nodes come from |
//! |---|---|---|
//! | [`KdTree::build`], [`LazyTree::finish`] | [`BuildOptions::layout`] | the options' method, see below |
//! | [`KdTree::with_layout`] | the argument | the method that the tree was built or loaded with |
//! | [`KdTree::load_with`] | [`BuildOptions::layout`] | the options' method |
//! | [`KdTree::load`] | as `load_with` and [`BuildOptions::balanced`]: wide | planes |
//! | [`LazyTree`] | always binary: its cells are small kd-trees, each laid out when a ray enters it | |
//! | [`Strategy::Rebuild`] of a [`Scene`] | the layout in the strategy's own options | those options' method |
//! | [`Strategy::Auto`] | the layout in the scene's options; [`Layout::Binary`] merges kd-trees as by [`MergeMethod::PartitionTrees`] | static parts: the scene's method; others: objects |
//! | [`MergeMethod::PartitionTrees`], [`BspMerge`](MergeMethod::BspMerge), [`Insertion`](MergeMethod::Insertion) | always binary: merged kd-trees share subtrees of 8-byte nodes with the frame before, while wide nodes would be rebuilt for every frame | |
//! | [`MergeMethod::Guided`], [`Strategy::Refit`], [`Instances`](Strategy::Instances), [`Dual`](Strategy::Dual) | always wide: only wide nodes are refitted and joined; [`Layout::Binary`] in the scene's options is a [`CommitError::Layout`](crate::scene::CommitError::Layout) | static parts: the scene's method; others: objects |
//!
//! # Where wide nodes come from
//!
//! - *Planes*: the planes of the kd-tree divide cells of more than 1024 triangles; below, triangles are divided as objects,
//!   as in a bounding volume hierarchy. All methods but the exact ones, and so [`BuildOptions::fast`] and
//!   [`BuildOptions::balanced`], take these.
//! - *Objects*: triangles are divided as objects all the way down, without a kd-tree: the fastest to make, for parts that
//!   change.
//! - *The cheaper of both by SAH cost*: [`Method::Exact`], [`Method::Sweep`], [`Method::Resort`] and [`Method::Naive`], and so
//!   [`BuildOptions::best`], make both and keep one. That takes half as long again as planes alone, which is little beside an
//!   exact build.
//!
//! A mesh of at most 1024 triangles therefore has the same wide nodes with every method. To trace the very cells that a builder
//! made, choose [`Layout::Binary`].

use kd_core::{Hit, Mesh, Tree};
use kd_trace::delegate_ray_query;

use crate::{BuildOptions, Layout, MergeMethod, Method, Strategy};
#[cfg(doc)]
use crate::{KdTree, LazyTree, Scene};

pub use kd_core::LayoutBytes;
#[cfg(feature = "counters")]
pub use kd_trace::TraversalCounts;
pub use kd_trace::{Level, PackedTree, WideTree};

/// How trees are laid out: what [`BuildOptions`] say about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LayoutPolicy {
    layout: Layout,
    /// Whether wide nodes are made from planes and from objects, and the cheaper ones kept.
    compares_objects: bool,
    is_parallel: bool,
}

impl LayoutPolicy {
    pub(crate) fn new(options: &BuildOptions) -> Self {
        Self {
            layout: options.layout(),
            compares_objects: matches!(
                options.method(),
                Method::Exact | Method::Sweep | Method::Resort | Method::Naive
            ),
            is_parallel: options.threads() != 1,
        }
    }

    /// The same policy for another layout.
    pub(crate) fn with_layout(self, layout: Layout) -> Self {
        Self { layout, ..self }
    }

    /// Lays out a tree over `mesh`, on the calling thread or on those of the pool in scope.
    pub(crate) fn lay_out(self, tree: &Tree, mesh: &Mesh) -> TreeLayout {
        match self.layout {
            Layout::Binary => TreeLayout::Binary(self.packed_tree(tree, mesh)),
            _ => TreeLayout::Wide(self.wide_tree(tree, mesh)),
        }
    }

    /// Wide nodes for a kd-tree over `mesh`.
    pub(crate) fn wide_tree(self, tree: &Tree, mesh: &Mesh) -> WideTree {
        if self.compares_objects {
            return WideTree::best(tree, mesh, self.is_parallel);
        }
        if self.is_parallel {
            return WideTree::new_parallel(tree, mesh);
        }
        WideTree::new(tree, mesh)
    }

    /// Wide nodes for a mesh that has no kd-tree.
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

impl TreeLayoutRef<'_> {
    pub(crate) fn bytes(self) -> LayoutBytes {
        match self {
            Self::Binary(tree) => tree.bytes(),
            Self::Wide(tree) => tree.bytes(),
        }
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for TreeLayoutRef<'_>: single, batch, packet;
    Self::Binary(tree) => tree,
    Self::Wide(tree) => tree,
}

#[cfg(test)]
mod tests {
    use kd_scene::Spd;

    use super::*;

    fn built(options: &BuildOptions) -> (Mesh, Tree) {
        let mesh = Spd::Sombrero.generate(2).expect("a small size").mesh;
        let tree = kd_sah::build(&mesh, options).expect("valid options");
        (mesh, tree)
    }

    #[track_caller]
    fn wide(layout: TreeLayout) -> WideTree {
        match layout {
            TreeLayout::Wide(tree) => tree,
            TreeLayout::Binary(_) => panic!("expected the wide layout"),
        }
    }

    /// Objects are cheaper than planes in this mesh, so that the policies differ.
    #[test]
    fn exact_methods_keep_the_cheaper_wide_nodes() {
        let options = BuildOptions::best();
        let (mesh, tree) = built(&options);
        let planes = WideTree::new(&tree, &mesh);
        let cheaper = WideTree::best(&tree, &mesh, false);
        assert!(planes != cheaper, "objects are cheaper");
        for method in [Method::Exact, Method::Sweep, Method::Resort, Method::Naive] {
            for threads in [0, 1] {
                let options = options.clone().with_method(method).with_threads(threads);
                let layout = LayoutPolicy::new(&options).lay_out(&tree, &mesh);
                assert!(wide(layout) == cheaper, "{method:?}, {threads} threads");
            }
        }
        for options in [BuildOptions::fast(), BuildOptions::balanced()] {
            let layout = LayoutPolicy::new(&options).lay_out(&tree, &mesh);
            assert!(wide(layout) == planes, "{:?}", options.method());
        }
    }

    #[test]
    fn a_change_of_layout_keeps_the_rest_of_the_policy() {
        let options = BuildOptions::best();
        let binary = LayoutPolicy::new(&options.clone().with_layout(Layout::Binary));
        assert_eq!(
            binary.with_layout(Layout::Wide),
            LayoutPolicy::new(&options),
            "as if built for the wide layout"
        );
        let (mesh, tree) = built(&options);
        let layout = binary.lay_out(&tree, &mesh).layout();
        assert_eq!(layout, Layout::Binary, "as the options say");
    }
}
