//! The public functions of the crate, over the modules that implement the methods.

use kd_core::{Aabb, Arena, Axis, MAX_DEPTH, NodeIndex, PrimSource, Slot, TreeError};
use kd_sah::BuildError;
use thiserror::Error;

use crate::clusters::clusters;
use crate::draft::{Draft, Subtree, SubtreeView};
use crate::partition::{Slots, cut};
use crate::partition_trees::{TreeInCell, TreePartition};
use crate::{Census, MergeOptions, insert as inserting};

/// A merged tree and counts of the work. The tree is fresh until its arena is frozen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Merged {
    /// The index of the root node.
    pub root: NodeIndex,
    /// The number of nodes written.
    pub new_nodes: usize,
    /// The number of references written.
    pub new_references: usize,
    /// The number of links to subtrees that other trees of the arena share.
    pub links: usize,
    /// The number of subtrees cut by a plane of another tree, or by a plane chosen between trees.
    pub cut: usize,
    /// The number of dissolved roots: roots replaced by their two children.
    pub dissolved: usize,
    /// The number of subtrees built again, including leaves that were divided again.
    pub rebuilt: usize,
}

/// A tree of an arena and its box.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// The index of the root node.
    pub root: NodeIndex,
    /// The box around the primitives of the tree.
    pub bounds: Aabb,
}

/// The reason why trees could not be merged.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MergeError {
    /// A tree is not frozen, or the arena is full.
    #[error("the merged tree: {0}")]
    Tree(#[from] TreeError),
    /// A subtree could not be built.
    #[error("a subtree of the merged tree: {0}")]
    Build(#[from] BuildError),
}

/// Cuts a tree in two at a plane and returns the tree below the plane, then the tree above it. (Eleftheriades 2010, §3.2,
/// algorithm 7.)
///
/// A primitive that the plane cuts is in both results. A primitive in the plane is in the lower one. `source` holds the
/// primitives by slot. `bounds` is the box around the primitives of the tree. The tree is unchanged, and both results share
/// the subtrees that the plane does not cross. Linear in the number of nodes that the plane crosses.
///
/// # Errors
///
/// [`MergeError::Tree`] if the tree is not frozen or the arena is full. Nodes written by then are fresh and can be truncated.
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
    let halves = cut(
        &mut draft,
        source,
        Subtree::Linked(tree),
        &bounds,
        axis,
        position,
    );
    let (fresh, counts) = draft.finish();
    let [below, above] = halves.map(|half| fresh.write(counts, arena, half));
    Ok([below?, above?])
}

/// Inserts the primitives `slots` into a tree, and divides leaves again that become too large. (Eleftheriades 2010, §3.5.)
///
/// `bounds` is the box around the primitives of the tree and the inserted ones. The result shares the subtrees that no
/// inserted primitive reaches into. The time is proportional to the number of nodes that each inserted primitive reaches
/// into, summed over these primitives, plus the builds of divided leaves.
///
/// # Errors
///
/// [`MergeError`] if the tree is not frozen, the arena is full, or a leaf cannot be divided. Nodes written by then are
/// fresh and can be truncated.
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

/// Merges two trees. The planes of the first cut the second. Where one of them is a leaf, its primitives are inserted into
/// the other. (Eleftheriades 2010, §3.3, algorithm 8.)
///
/// `bounds` is the box around both trees. Where one tree is empty, the result shares the other. Where the planes of both
/// trees together would make a path longer than [`MAX_DEPTH`], the subtree is built again. As the thesis states, the
/// result is correct but of low quality, since the method considers neither the cost of a plane nor what it separates.
/// Each plane of the first tree costs one [`partition`] of the second tree's subtree in its cell.
///
/// # Errors
///
/// [`MergeError`] if a tree is not frozen, the arena is full, or a subtree cannot be built. Nodes written by then are fresh
/// and can be truncated.
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
/// If a plane between trees exists, the cheapest one splits the volume. Otherwise every tree is dissolved into its two
/// children, and the cheapest plane of all then splits the volume, even if it cuts trees. The recursion ends where one tree
/// fills its volume, which the result shares, or where only leaves are left. `census` is that of the arena. O(t log t) for
/// the t trees of a volume, including those from dissolving: cheap where trees are apart, expensive where they overlap.
///
/// # Errors
///
/// [`MergeError`] if a tree is not frozen, the arena is full, or a subtree cannot be built. Nodes written by then are fresh
/// and can be truncated.
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
    let items = trees.iter().map(|tree| TreeInCell {
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

/// Divides primitives into clusters whose boxes overlap little, and builds a tree over each. (Eleftheriades 2010, chapter 5,
/// which names it as future work: cluster, build, merge.)
///
/// A cluster has at most `max_size` primitives, unless more of them have the same center. The trees are appended to the
/// arena and are fresh; the caller freezes them. [`partition_trees`] merges them, alone or with others. It finds planes
/// between most clusters, and so dissolves only the clusters that overlap. O(n log n) for n primitives, plus the builds.
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
/// [`MergeError`] if the arena is full or a cluster cannot be built. Nodes written by then are fresh and can be truncated.
///
/// # Panics
///
/// If the source has no primitive with the number of a slot.
pub fn build_clusters(
    arena: &mut Arena,
    slots: &[Slot],
    source: &impl PrimSource,
    max_size: usize,
    options: &MergeOptions,
) -> Result<Vec<Placed>, MergeError> {
    let clusters = clusters(slots, source, max_size);
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

/// Fails if the root of a tree is not frozen.
fn check_frozen(arena: &Arena, tree: NodeIndex) -> Result<(), TreeError> {
    let height = arena.height(tree);
    height.map(|_| ()).ok_or(TreeError::BadRoot { node: tree })
}

/// The smallest number of levels of each subtree for which the two sides of a plane are merged on two threads.
const MIN_TASK_HEIGHT: usize = 6;

/// The recursion of [`bsp_merge`].
struct BspMerger<'a, S> {
    source: &'a S,
    options: &'a MergeOptions,
}

impl<S: PrimSource> BspMerger<'_, S> {
    /// Merges `a` and `b` in `cell` into a subtree of at most `depth` levels.
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
            (_, SubtreeView::Leaf(leaf)) => {
                let slots = Slots::from_slice(draft.refs_of(leaf));
                inserting::insert(draft, source, options, a, &slots, cell, depth)
            }
            (SubtreeView::Leaf(leaf), _) => {
                let slots = Slots::from_slice(draft.refs_of(leaf));
                inserting::insert(draft, source, options, b, &slots, cell, depth)
            }
            (
                SubtreeView::Split {
                    axis,
                    split,
                    children,
                },
                _,
            ) => {
                draft.counts.cut += 1;
                let [below, above] = cut(draft, source, b, cell, axis, split);
                let (lower, upper) = cell.split(axis, split);
                let [a_below, a_above] = children;
                let is_large = |subtree| draft.height(subtree) >= MIN_TASK_HEIGHT;
                let is_parallel = options.is_parallel
                    && [a_below, a_above, below, above].into_iter().all(is_large);
                let children = draft.both(
                    is_parallel,
                    |draft| self.merge(draft, a_below, below, &lower, depth - 1),
                    |draft| self.merge(draft, a_above, above, &upper, depth - 1),
                )?;
                Ok(draft.split(axis, split, children))
            }
        }
    }
}
