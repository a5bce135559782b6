//! Merging trees of an arena: what is public, around the parts that do it.

use kd_core::{Aabb, Arena, Axis, MAX_DEPTH, NodeIndex, PrimSource, Slot, TreeError};
use kd_sah::BuildError;
use thiserror::Error;

use crate::clusters::clusters;
use crate::draft::{Draft, Subtree, View};
use crate::partition::{Slots, cut};
use crate::partition_trees::{Item, TreePartition};
use crate::{Census, MergeOptions, insert as inserting};

/// A tree that was put together: fresh in its arena, until that is frozen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Merged {
    /// Where it starts.
    pub root: NodeIndex,
    /// Nodes that were written.
    pub new_nodes: usize,
    /// References that were written.
    pub new_references: usize,
    /// Subtrees that it shares with other trees of the arena.
    pub links: usize,
    /// Trees that were cut by a plane of another, or between others.
    pub cut: usize,
    /// Roots that were taken away so that their children could be sorted.
    pub dissolved: usize,
    /// Parts that were built anew, leaves that were divided again among them.
    pub rebuilt: usize,
}

/// A tree of an arena.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Where it starts.
    pub root: NodeIndex,
    /// The box around its primitives.
    pub bounds: Aabb,
}

/// Why trees could not be put together.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MergeError {
    /// The arena is full.
    #[error("the merged tree: {0}")]
    Tree(#[from] TreeError),
    /// A leaf could not be divided again.
    #[error("a part of the merged tree: {0}")]
    Build(#[from] BuildError),
}

/// Cuts a tree in two at a plane: what is below it, and what is above. (Eleftheriades 2010, §3.2, algorithm 7.)
///
/// A primitive that the plane cuts is in both, one that lies in it in the lower part. Nodes and references are numbers of the
/// arena, and `source` tells primitives by them; `bounds` is the box around the tree's. The tree stays what it is, and what
/// the plane does not pass through is shared with it. Linear in the nodes that the plane passes through.
///
/// # Errors
///
/// If a tree is not frozen, or the arena is full. What has been written is fresh, and can be truncated.
pub fn partition(
    arena: &mut Arena,
    tree: NodeIndex,
    source: &impl PrimSource,
    bounds: Aabb,
    axis: Axis,
    position: f32,
) -> Result<[Merged; 2], MergeError> {
    check_frozen(arena, tree)?;
    let mut draft = Draft::new(arena);
    let parts = cut(
        &mut draft,
        source,
        Subtree::Linked(tree),
        &bounds,
        axis,
        position,
    );
    let (fresh, counts) = draft.finish();
    let [below, above] = parts.map(|part| fresh.write(counts, arena, part));
    Ok([below?, above?])
}

/// Sends primitives down a tree, and divides again what becomes too full. (Eleftheriades 2010, §3.5.)
///
/// `bounds` is the box around the tree's primitives and the new ones, `slots`. What none of them reaches into is shared.
///
/// # Errors
///
/// If a tree is not frozen, the arena is full, or a leaf cannot be divided. What has been written is fresh, and can be truncated.
pub fn insert(
    arena: &mut Arena,
    tree: NodeIndex,
    slots: &[Slot],
    source: &impl PrimSource,
    bounds: Aabb,
    options: &MergeOptions,
) -> Result<Merged, MergeError> {
    check_frozen(arena, tree)?;
    let mut draft = Draft::new(arena);
    let tree = Subtree::Linked(tree);
    let root = kd_tasks::in_pool(options.is_parallel, || {
        inserting::insert(&mut draft, source, options, tree, slots, &bounds, MAX_DEPTH)
    })?;
    let (fresh, counts) = draft.finish();
    Ok(fresh.write(counts, arena, root)?)
}

/// Merges two trees: the second is cut by the planes of the first, and where one has come to a leaf, its primitives are sent
/// down the other. (Eleftheriades 2010, §3.3, algorithm 8.)
///
/// `bounds` is the box around both. Where one tree is empty, the other is shared as it is. Where the planes of one below
/// those of the other would make a path too long, that part is built anew. As the thesis says: it is correct, and not good,
/// because it asks neither what a plane costs nor what it separates.
///
/// # Errors
///
/// If a tree is not frozen, the arena is full, or a part cannot be built. What has been written is fresh, and can be truncated.
pub fn bsp_merge(
    arena: &mut Arena,
    trees: [NodeIndex; 2],
    source: &impl PrimSource,
    bounds: Aabb,
    options: &MergeOptions,
) -> Result<Merged, MergeError> {
    for tree in trees {
        check_frozen(arena, tree)?;
    }
    let merger = BspMerger { source, options };
    let mut draft = Draft::new(arena);
    let [a, b] = trees.map(Subtree::Linked);
    let root = kd_tasks::in_pool(options.is_parallel, || {
        merger.merge(&mut draft, a, b, &bounds, MAX_DEPTH)
    })?;
    let (fresh, counts) = draft.finish();
    Ok(fresh.write(counts, arena, root)?)
}

/// Merges any number of trees by the surface area heuristic over their boxes. (Eleftheriades 2010, §3.4, algorithm 9.)
///
/// A plane between trees is taken where there is one; where there is none, every tree is dissolved into its two children, and
/// the best plane is taken then, whatever it cuts. It ends where one tree fills its volume, which is shared, or where there are
/// only leaves left. The census is that of the arena. O(t log t) for t trees in a volume, those that dissolving makes included:
/// little where trees are apart, and much where they overlap.
///
/// # Errors
///
/// If a tree is not frozen, the arena is full, or a part cannot be built. What has been written is fresh, and can be truncated.
///
/// # Panics
///
/// If the census does not count all nodes of the trees.
pub fn partition_trees(
    arena: &mut Arena,
    census: &Census,
    trees: &[Placed],
    source: &impl PrimSource,
    options: &MergeOptions,
) -> Result<Merged, MergeError> {
    for tree in trees {
        check_frozen(arena, tree.root)?;
    }
    let bounds = trees.iter().map(|tree| tree.bounds);
    let bounds = bounds.fold(Aabb::EMPTY, |all, one| all.union(&one));
    let items = trees.iter().map(|tree| Item {
        tree: Subtree::Linked(tree.root),
        cell: tree.bounds,
    });
    let mut draft = Draft::with_census(arena, census);
    let mut partition = TreePartition {
        draft: &mut draft,
        source,
        options,
    };
    let items = items.collect();
    let root = kd_tasks::in_pool(options.is_parallel, || {
        partition.partition(items, &bounds, false, MAX_DEPTH)
    })?;
    let (fresh, counts) = draft.finish();
    Ok(fresh.write(counts, arena, root)?)
}

/// Builds a tree over each of some clusters of primitives, of at most `most` each (unless more have the same centre), whose
/// boxes overlap little. (Eleftheriades 2010, chapter 5, where it is future work: cluster, build, merge.)
///
/// The trees are appended, are fresh, and are to be frozen. [`partition_trees`] merges them, with others or alone, and finds
/// planes between most of them: so what overlaps is dissolved only as far as its clusters do. O(n log n) for n primitives to find
/// clusters, and what the options' builder takes.
///
/// ```
/// use kd_core::{Arena, CostModel, Mesh, Slot, Tree};
/// use kd_merge::{Census, MergeOptions, build_clusters, partition_trees};
///
/// let triangle = |x: f32| [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0]];
/// let positions: Vec<[f32; 3]> = (0..30_u8).flat_map(|i| triangle(f32::from(i))).collect();
/// let triangles = (0..30).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
/// let mesh = Mesh::new(positions, triangles)?;
/// let slots: Vec<Slot> = (0..30).map(Slot).collect();
///
/// let options = MergeOptions::default();
/// let mut arena = Arena::new();
/// let clusters = build_clusters(&mut arena, &slots, &mesh, 10, &options)?;
/// arena.freeze(30)?;
/// assert_eq!(clusters.len(), 4);
///
/// let mut census = Census::new();
/// census.extend(arena.nodes());
/// let merged = partition_trees(&mut arena, &census, &clusters, &mesh, &options)?;
/// arena.freeze(30)?;
/// let tree = Tree::from_arena(arena, merged.root, mesh.bounds(), CostModel::PACKED)?;
/// tree.check_coverage(&mesh)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// If the arena is full, or a cluster cannot be built. What has been written is fresh, and can be truncated.
///
/// # Panics
///
/// If the source has no primitive of that number.
pub fn build_clusters(
    arena: &mut Arena,
    slots: &[Slot],
    source: &impl PrimSource,
    most: usize,
    options: &MergeOptions,
) -> Result<Vec<Placed>, MergeError> {
    let clusters = clusters(slots, source, most);
    let items: Vec<_> = clusters.iter().collect();
    let trees = kd_tasks::map(items, options.is_parallel, |cluster| {
        options.build(source, &cluster.slots, &cluster.bounds, MAX_DEPTH)
    });
    let placed = clusters.iter().zip(trees).map(|(cluster, tree)| {
        let root = arena.append_renumbered(&tree?, &cluster.slots)?;
        Ok(Placed {
            root,
            bounds: cluster.bounds,
        })
    });
    placed.collect()
}

/// Trees that are put together have been frozen.
fn check_frozen(arena: &Arena, tree: NodeIndex) -> Result<(), TreeError> {
    let height = arena.height(tree);
    height.map(|_| ()).ok_or(TreeError::BadRoot { node: tree })
}

/// Levels of a tree below which it does not pay to merge what lies on either side on a thread of its own.
const TASK_HEIGHT: usize = 6;

struct BspMerger<'a, S> {
    source: &'a S,
    options: &'a MergeOptions,
}

impl<S: PrimSource> BspMerger<'_, S> {
    /// `depth` is how many levels there may be.
    fn merge(
        &self,
        draft: &mut Draft<'_>,
        a: Subtree,
        b: Subtree,
        cell: &Aabb,
        depth: usize,
    ) -> Result<Subtree, BuildError> {
        if draft.is_empty(a) {
            return Ok(b);
        }
        if draft.is_empty(b) {
            return Ok(a);
        }
        let Self { source, options } = *self;
        if draft.height(a) + draft.height(b) > depth {
            let slots = draft.slots([a, b]);
            return options.rebuild(draft, source, &slots, cell, depth);
        }
        match (draft.view(a), draft.view(b)) {
            (_, View::Leaf(leaf)) => {
                let slots = Slots::from_slice(draft.refs_of(leaf));
                inserting::insert(draft, source, options, a, &slots, cell, depth)
            }
            (View::Leaf(leaf), _) => {
                let slots = Slots::from_slice(draft.refs_of(leaf));
                inserting::insert(draft, source, options, b, &slots, cell, depth)
            }
            (View::Split { axis, split, parts }, _) => {
                draft.counts.cut += 1;
                let [below, above] = cut(draft, source, b, cell, axis, split);
                let (lower, upper) = cell.split(axis, split);
                let [a_below, a_above] = parts;
                let is_large = |part| draft.height(part) >= TASK_HEIGHT;
                let is_parallel = options.is_parallel
                    && [a_below, a_above, below, above].into_iter().all(is_large);
                let parts = draft.both(
                    is_parallel,
                    |draft| self.merge(draft, a_below, below, &lower, depth - 1),
                    |draft| self.merge(draft, a_above, above, &upper, depth - 1),
                )?;
                Ok(draft.split(axis, split, parts))
            }
        }
    }
}
