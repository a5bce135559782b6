//! Nodes with eight children, tested at once: the layout to trace with.
//!
//! ```text
//! kd-tree ──▶ boxes ──▶ choice of nodes and leaves ──▶ wide nodes, blocks
//!         divide     collapse                     emit
//! ```

mod arrays;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
pub(crate) mod batch;
mod binary;
mod box_tree;
mod collapse;
mod decide;
mod divide;
mod emit;
mod forest;
mod join;
mod node;
mod object_split;
pub(crate) mod packet;
pub(crate) mod portable;
mod queue;
mod scattered;
mod sorter;
mod stack;
pub(crate) mod tile;
mod usual;
pub(crate) mod walk;

use kd_core::{Aabb, Hit, Mesh, Ray, RayPacket8, TracedBytes, Tree};
use kd_simd::Level;

use crate::collect::{Any, Closest, Ordered};
use crate::dispatch::{any_of_each, closest_of_each, trace_packet, walk_wide};
use crate::planes::Frame;
use arrays::Arrays;
pub use arrays::Refit;
pub use binary::{BinaryNode, BinaryTree};
use box_tree::{BoxTree, Item, Leaves};
use divide::{Divider, MOST_LEVELS, by_objects, per_area};
pub use forest::WideForest;
pub use join::{Join, Joined};

/// Cells of more triangles may be divided by the planes of the kd-tree, others only as objects: see [`divide`].
const PLANES_ABOVE: usize = 1024;

/// A tree of nodes with eight children and of triangles in blocks of eight: what to trace where speed matters.
///
/// It is made from a kd-tree and its mesh, and holds copies: neither is needed to trace. Every answer equals that of the
/// functions that take the [`Tree`] and its mesh, and so that of [`brute_force`](crate::brute_force), to the bit and at every
/// [`Level`].
///
/// Memory: 256 bytes a node and 320 bytes a block, together about 60 bytes a triangle in most scenes.
#[derive(Clone, Debug)]
pub struct WideTree {
    arrays: Arrays,
    frame: Frame,
    level: Level,
}

impl WideTree {
    /// Makes wide nodes from a tree over `mesh` on the calling thread, for the fastest [`Level`] of this processor.
    ///
    /// Linear in the number of triangles of the tree, apart from its levels above cells of a thousand triangles.
    ///
    /// # Panics
    ///
    /// If `mesh` is not the one that the tree was built from, and has fewer triangles.
    pub fn new(tree: &Tree, mesh: &Mesh) -> Self {
        Self::with(tree, mesh, None, false)
    }

    /// [`new`](Self::new) on the threads of the pool in scope (rayon's). The result is the same.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    #[cfg(feature = "parallel")]
    pub fn new_parallel(tree: &Tree, mesh: &Mesh) -> Self {
        Self::with(tree, mesh, None, true)
    }

    /// [`new`](Self::new) that follows the planes of the kd-tree in all cells of more than `planes_above` triangles, whatever
    /// that costs; 0 follows them to its leaves. For tests and measurements: the default is what was found best.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub fn with_planes_above(tree: &Tree, mesh: &Mesh, planes_above: usize) -> Self {
        Self::with(tree, mesh, Some(planes_above), false)
    }

    /// Above so many triangles only planes count, if that is told.
    fn with(tree: &Tree, mesh: &Mesh, planes_above: Option<usize>, is_parallel: bool) -> Self {
        let items = items_of_tree(tree, mesh);
        let (boxes, _) = boxes_of(tree, mesh, items, planes_above, is_parallel);
        Self::of_boxes(&boxes, mesh, &tree.bounds(), is_parallel)
    }

    /// The better of [`new`](Self::new) and [`from_objects`](Self::from_objects) by SAH cost, on the threads of the pool in
    /// scope or on the calling one. Making both takes about half as long again as the first.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub fn best(tree: &Tree, mesh: &Mesh, is_parallel: bool) -> Self {
        let items = items_of_tree(tree, mesh);
        let by_planes = || boxes_of(tree, mesh, items.clone(), None, is_parallel);
        let by_objects = || boxes_of_objects(items.clone(), &tree.bounds(), is_parallel);
        #[cfg(feature = "parallel")]
        let (planes, objects) = if is_parallel {
            rayon::join(by_planes, by_objects)
        } else {
            (by_planes(), by_objects())
        };
        #[cfg(not(feature = "parallel"))]
        let (planes, objects) = (by_planes(), by_objects());
        let boxes = if objects.1 < planes.1 {
            objects.0
        } else {
            planes.0
        };
        Self::of_boxes(&boxes, mesh, &tree.bounds(), is_parallel)
    }

    /// Makes wide nodes without a kd-tree, by dividing triangles as objects all the way down, on the calling thread.
    ///
    /// For meshes of up to a thousand triangles it is what [`new`](Self::new) makes; larger ones trace somewhat slower. It
    /// takes a fraction of the time of building a kd-tree, which is what pays for a mesh that is another one soon.
    pub fn from_objects(mesh: &Mesh) -> Self {
        Self::with_objects(mesh, false)
    }

    /// [`from_objects`](Self::from_objects) on the threads of the pool in scope (rayon's). The result is the same.
    #[cfg(feature = "parallel")]
    pub fn from_objects_parallel(mesh: &Mesh) -> Self {
        Self::with_objects(mesh, true)
    }

    fn with_objects(mesh: &Mesh, is_parallel: bool) -> Self {
        let triangles = 0..u32::try_from(mesh.len()).expect("30 bits count triangles");
        let items = triangles.map(|triangle| Item::whole(triangle, mesh));
        let (boxes, _) = boxes_of_objects(items.collect(), &mesh.bounds(), is_parallel);
        Self::of_boxes(&boxes, mesh, &mesh.bounds(), is_parallel)
    }

    /// Makes wide nodes from a binary tree of boxes that was made elsewhere, such as a bounding volume hierarchy, on the
    /// calling thread. Linear in the number of triangles.
    ///
    /// Boxes are made anew around the triangles of `mesh`. Which nodes and leaves stay is chosen as for any other tree, so
    /// that leaves of few triangles become larger ones where that costs less.
    ///
    /// # Panics
    ///
    /// If a leaf has no triangles, or one that the mesh lacks; if more than [`MAX_DEPTH`](kd_core::MAX_DEPTH) nodes lie
    /// above a leaf.
    pub fn from_binary(tree: &impl BinaryTree, mesh: &Mesh) -> Self {
        let boxes = binary::boxes_of_binary(tree, mesh);
        Self::of_boxes(&boxes, mesh, &mesh.bounds(), false)
    }

    fn of_boxes(boxes: &BoxTree, mesh: &Mesh, bounds: &Aabb, is_parallel: bool) -> Self {
        let (nodes, blocks, root) = emit::emit(boxes, mesh, is_parallel);
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

    /// The level it is traced at.
    pub fn level(&self) -> Level {
        self.level
    }

    #[inline(always)]
    pub(crate) fn arrays(&self) -> &Arrays {
        &self.arrays
    }

    #[inline(always)]
    pub(crate) fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Bytes of nodes and of blocks.
    pub fn bytes(&self) -> TracedBytes {
        TracedBytes {
            nodes: size_of_val(self.arrays.nodes()),
            blocks: size_of_val(self.arrays.blocks()),
        }
    }

    /// As [`intersect`](crate::intersect).
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = Closest::default();
        walk_wide(self, ray, &mut closest, &mut ());
        closest.0
    }

    /// As [`occluded`](crate::occluded).
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut any = Any::default();
        walk_wide(self, ray, &mut any, &mut ());
        any.0
    }

    /// As [`hits`](crate::hits).
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        out.clear();
        if max > 0 {
            walk_wide(self, ray, &mut Ordered { max, out }, &mut ());
        }
    }

    /// [`intersect`](Self::intersect) for many rays. Runs of 64 of them, from the first one on, are traced together where
    /// they go much the same way, for as long as they stay together; others in turn, sixteen at a time.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        closest_of_each(self, rays, hits);
    }

    /// [`occluded`](Self::occluded) for many rays, together where they go much the same way, as by
    /// [`intersect_batch`](Self::intersect_batch).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        any_of_each(self, rays, occluded);
    }

    /// [`intersect`](Self::intersect) for the ray of each lane: `None` where there is none.
    ///
    /// Rays that move most on the same axis, and go the same way on all of them, go down the tree together.
    pub fn intersect8(&self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        trace_packet(self, packet).map(|closest: Closest| closest.0)
    }

    /// [`occluded`](Self::occluded) for the ray of each lane, as by [`intersect8`](Self::intersect8).
    pub fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        trace_packet(self, packet).map(|any: Any| any.0)
    }
}

/// The same nodes and blocks to the bit, at whatever levels they are traced.
impl PartialEq for WideTree {
    fn eq(&self, other: &Self) -> bool {
        self.arrays == other.arrays
    }
}

/// Which triangles of a mesh are in a tree: in a leaf that its root reaches, since an arena may hold other trees too.
fn triangles_of(tree: &Tree, triangles: usize) -> Vec<bool> {
    let mut is_in_tree = vec![false; triangles];
    let mut is_seen = vec![false; tree.nodes().len()];
    let mut pending = vec![tree.root()];
    while let Some(place) = pending.pop() {
        // Subtrees may be shared.
        if std::mem::replace(&mut is_seen[place.index()], true) {
            continue;
        }
        let node = tree.nodes()[place.index()];
        if node.is_leaf() {
            for slot in tree.leaf_refs(node) {
                is_in_tree[slot.0 as usize] = true;
            }
        } else {
            let first = node.first_child();
            pending.extend([first, first.sibling()]);
        }
    }
    is_in_tree
}

/// Boxes, and their SAH cost.
type Costed = (BoxTree, f32);

/// The boxes of all triangles of a tree, which are the items.
fn boxes_of(
    tree: &Tree,
    mesh: &Mesh,
    items: Vec<Item>,
    planes_above: Option<usize>,
    is_parallel: bool,
) -> Costed {
    let mut boxes = BoxTree::new(Leaves::Triangles);
    let divider = Divider {
        tree,
        mesh,
        per_area: per_area(&tree.bounds()),
        planes_above: planes_above.unwrap_or(PLANES_ABOVE),
        objects_compete: planes_above.is_none(),
        #[cfg(feature = "parallel")]
        is_parallel,
    };
    let _ = is_parallel;
    if items.is_empty() {
        return (boxes, 0.0);
    }
    let root = divider.by_planes(tree.root(), items, 0, &mut boxes);
    (boxes, root.cost())
}

/// The boxes of triangles, all within `bounds`, divided as objects.
fn boxes_of_objects(mut items: Vec<Item>, bounds: &Aabb, is_parallel: bool) -> Costed {
    let mut boxes = BoxTree::new(Leaves::Triangles);
    if items.is_empty() {
        return (boxes, 0.0);
    }
    let root = by_objects(&mut items, 0, per_area(bounds), is_parallel, &mut boxes);
    (boxes, root.cost())
}

/// The triangles of a tree, in their boxes.
fn items_of_tree(tree: &Tree, mesh: &Mesh) -> Vec<Item> {
    let triangles = (0..).zip(triangles_of(tree, mesh.len()));
    let there = triangles.filter(|(_, is_in_tree)| *is_in_tree);
    there
        .map(|(triangle, _)| Item::whole(triangle, mesh))
        .collect()
}
