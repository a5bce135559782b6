//! A tree of wide nodes, and the ways to make one.

use kd_core::{Aabb, LayoutBytes, Mesh, Tree, TreeStats};
use kd_simd::Level;
use kd_tasks::{Cancelled, Progress, Tracker};

use crate::arrays::Arrays;
use crate::binary::{self, BinaryTree};
use crate::block::Block;
use crate::box_tree::{BoxTree, Item};
use crate::cheapest::cheapest;
use crate::divide::{boxes_of_bins, boxes_of_objects, boxes_of_tree};
use crate::emit::{self, Triangles, WriteBlocks};
use crate::frame::Frame;
use crate::items::{Items, items_of_mesh, items_of_tree};
use crate::node::{Child, WideNode};
use crate::stats;
use crate::work::Work;

/// How the triangles of a mesh are divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Division {
    /// By object splits alone. The fastest to make.
    Objects,
    /// By planes in cells of more than [`PLANES_ABOVE`](crate::PLANES_ABOVE) triangles where object splits leave boxes that overlap,
    /// as among the walls of rooms; by object splits elsewhere.
    Planes {
        /// The most references to triangles, at least one to each: a triangle that a plane cuts is referenced on both sides. In any
        /// case there are at most one and a half for each triangle.
        most_references: u64,
    },
    /// The cheapest of several by SAH cost: by planes, by objects, and two optimized trees over the leaves of the latter, one of which is
    /// made bottom-up. Takes twice the time of planes.
    Cheapest {
        /// As in [`Planes`](Self::Planes).
        most_references: u64,
    },
}

/// A tree of nodes with up to eight children, and of triangles in blocks of eight.
///
/// It holds copies: neither the kd-tree nor the mesh that it is made from is needed to trace. Queries are those of the trait
/// `RayQuery` of `kd-trace`. Each answer equals that of a test of every triangle, to the bit and at every [`Level`].
///
/// Memory: 256 bytes a node and 320 bytes a block, together about 60 bytes a triangle in most scenes.
#[derive(Clone, Debug)]
pub struct WideTree {
    pub(crate) arrays: Arrays,
    pub(crate) frame: Frame,
    pub(crate) level: Level,
}

impl WideTree {
    /// Makes wide nodes of a mesh. Their quality, and the time that they take, is that of the [`Division`].
    ///
    /// The same mesh and division give the same tree, bit for bit, on any number of threads. `progress` is called as in
    /// [`Progress`]. O(N log N).
    ///
    /// # Errors
    ///
    /// [`Cancelled`] soon after `progress` has broken.
    pub fn build(
        mesh: &Mesh,
        division: Division,
        is_parallel: bool,
        progress: Option<&Progress<'_>>,
    ) -> Result<Self, Cancelled> {
        let tracker = Tracker::new(progress);
        let tree = Self::built(mesh, division, Work::new(is_parallel, &tracker));
        tracker.finish().map(|()| tree)
    }

    /// A tree that is good for nothing if the work was cancelled.
    fn built(mesh: &Mesh, division: Division, work: Work<'_>) -> Self {
        let [divide, rest] = work.divide([3, 1]);
        let Items { with_area, without } = items_of_mesh(mesh, work.is_parallel);
        // Those without an area may be outside of the box that rays see.
        let bounds = if without.is_empty() {
            mesh.bounds()
        } else {
            Item::around(&with_area)
        };
        let (boxes, _) = match division {
            Division::Objects => boxes_of_objects(with_area, &bounds, divide),
            Division::Planes { most_references } => {
                boxes_of_bins(mesh, with_area, &bounds, most_references, divide)
            }
            Division::Cheapest { most_references } => {
                cheapest(mesh, with_area, &bounds, most_references, divide)
            }
        };
        let triangles = Triangles {
            mesh,
            all_have_area: true,
        };
        Self::emitted(&boxes, &triangles, &without, &mesh.bounds(), rest)
    }

    /// Makes wide nodes from a kd-tree over `mesh` on the calling thread, for the fastest [`Level`] of this processor.
    ///
    /// Follows the planes of the kd-tree in cells of more than [`PLANES_ABOVE`](crate::PLANES_ABOVE) triangles, and divides
    /// smaller ones by object splits. Linear in the number of triangles, apart from the levels of the kd-tree above those
    /// cells.
    ///
    /// # Panics
    ///
    /// If `mesh` is not the one that the tree was built from, and has fewer triangles.
    pub fn new(tree: &Tree, mesh: &Mesh) -> Self {
        Self::of_kd_tree(tree, mesh, false, None).expect("nothing cancels it")
    }

    /// [`new`](Self::new), parallel: on the threads of the pool in scope (rayon's), with the same result. `progress` is called as in
    /// [`Progress`].
    ///
    /// # Errors
    ///
    /// [`Cancelled`] soon after `progress` has broken.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub fn of_kd_tree(
        tree: &Tree,
        mesh: &Mesh,
        is_parallel: bool,
        progress: Option<&Progress<'_>>,
    ) -> Result<Self, Cancelled> {
        Self::with(tree, mesh, None, is_parallel, progress)
    }

    /// [`new`](Self::new) with another limit: follows the planes of the kd-tree in all cells of more than `planes_above`
    /// triangles, whatever they cost. 0 follows them to the leaves of the kd-tree. For tests and measurements.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub fn with_planes_above(tree: &Tree, mesh: &Mesh, planes_above: usize) -> Self {
        let wide = Self::with(tree, mesh, Some(planes_above), false, None);
        wide.expect("nothing cancels it")
    }

    fn with(
        tree: &Tree,
        mesh: &Mesh,
        planes_above: Option<usize>,
        is_parallel: bool,
        progress: Option<&Progress<'_>>,
    ) -> Result<Self, Cancelled> {
        let tracker = Tracker::new(progress);
        let [divide, rest] = Work::new(is_parallel, &tracker).divide([3, 1]);
        let Items { with_area, without } = items_of_tree(tree, mesh);
        let (boxes, _) = boxes_of_tree(tree, mesh, with_area, planes_above, divide);
        let triangles = Triangles {
            mesh,
            all_have_area: true,
        };
        let wide = Self::emitted(&boxes, &triangles, &without, &tree.bounds(), rest);
        tracker.finish().map(|()| wide)
    }

    /// [`build`](Self::build) by objects alone, on the calling thread.
    ///
    /// A mesh of at most [`PLANES_ABOVE`](crate::PLANES_ABOVE) triangles gets the same nodes as from planes.
    pub fn from_objects(mesh: &Mesh) -> Self {
        let tracker = Tracker::new(None);
        Self::built(mesh, Division::Objects, Work::new(false, &tracker))
    }

    /// [`from_objects`](Self::from_objects) on the threads of the pool in scope (rayon's). The result is the same.
    pub fn from_objects_parallel(mesh: &Mesh) -> Self {
        let tracker = Tracker::new(None);
        Self::built(mesh, Division::Objects, Work::new(true, &tracker))
    }

    /// Makes wide nodes from a binary tree that was made elsewhere, such as a bounding volume hierarchy, on the calling
    /// thread. Linear in the number of triangles.
    ///
    /// Boxes are fitted around the triangles of `mesh`. Which nodes and leaves stay is chosen as for a kd-tree: leaves of few
    /// triangles merge where that costs less.
    ///
    /// # Panics
    ///
    /// If a leaf has no triangles, or one that the mesh lacks; if a leaf is more than [`MAX_DEPTH`](kd_core::MAX_DEPTH)
    /// levels below the root.
    pub fn from_binary(tree: &impl BinaryTree, mesh: &Mesh) -> Self {
        let boxes = binary::boxes_of_binary(tree, mesh);
        let tracker = Tracker::new(None);
        let work = Work::new(false, &tracker);
        let triangles = Triangles {
            mesh,
            all_have_area: false,
        };
        Self::emitted(&boxes, &triangles, &[], &mesh.bounds(), work)
    }

    /// A tree of these boxes, traced in the frame of `bounds`. `aside` are items in no leaf of `boxes`, which rays do not meet.
    pub(crate) fn emitted(
        boxes: &BoxTree,
        blocks: &impl WriteBlocks,
        aside: &[u32],
        bounds: &Aabb,
        work: Work<'_>,
    ) -> Self {
        let (nodes, blocks, root) = emit::emit(boxes, blocks, aside, work);
        Self {
            arrays: Arrays::new(nodes, blocks, root),
            frame: Frame::new(bounds),
            level: Level::detect(),
        }
    }

    /// The same tree, traced at another level.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        Self { level, ..self }
    }

    /// The level that rays are traced at.
    #[inline(always)]
    pub fn level(&self) -> Level {
        self.level
    }

    /// Bytes of nodes and of blocks.
    pub fn bytes(&self) -> LayoutBytes {
        LayoutBytes {
            nodes: size_of_val(self.arrays.nodes()),
            blocks: size_of_val(self.arrays.blocks()),
        }
    }

    /// Counts, histograms, costs and sizes of the wide nodes, for the mesh that they were made from. Linear in their number.
    pub fn stats(&self, mesh: &Mesh) -> TreeStats {
        stats::stats(self, mesh)
    }

    /// The box of the tree, for error bounds of rays.
    #[inline(always)]
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// All nodes. A child that is a node is an index of these.
    #[inline(always)]
    pub fn nodes(&self) -> &[WideNode] {
        self.arrays.nodes()
    }

    /// All blocks. A child that is a leaf is a range of these.
    #[inline(always)]
    pub fn blocks(&self) -> &[Block] {
        self.arrays.blocks()
    }

    /// Where rays begin: a node, or a leaf without blocks if the tree is empty.
    #[inline(always)]
    pub fn root(&self) -> Child {
        self.arrays.root()
    }

    /// The node of a child, without a check of its index.
    ///
    /// # Safety
    ///
    /// `child` is not a leaf, and is [`root`](Self::root) of this tree or a child of one of its [`nodes`](Self::nodes).
    #[inline(always)]
    #[allow(unsafe_code, reason = "passes the contract on to the arrays")]
    pub unsafe fn node(&self, child: Child) -> &WideNode {
        // SAFETY: the caller's.
        unsafe { self.arrays.node(child) }
    }

    /// The blocks of a child, without a check of their indices.
    ///
    /// # Safety
    ///
    /// `child` is a leaf, and is [`root`](Self::root) of this tree, a child of one of its [`nodes`](Self::nodes), or
    /// [`Child::NOTHING`].
    #[inline(always)]
    #[allow(unsafe_code, reason = "passes the contract on to the arrays")]
    pub unsafe fn leaf(&self, child: Child) -> &[Block] {
        // SAFETY: the caller's.
        unsafe { self.arrays.leaf(child) }
    }

    /// Asks the processor to load a child into its nearest cache, where it has an instruction for that.
    #[inline(always)]
    pub fn prefetch(&self, child: Child) {
        self.arrays.prefetch(child);
    }
}

/// The same nodes and blocks to the bit, at any level.
impl PartialEq for WideTree {
    fn eq(&self, other: &Self) -> bool {
        self.arrays == other.arrays
    }
}
