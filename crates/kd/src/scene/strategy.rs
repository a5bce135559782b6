//! How frames are made of parts.

use kd_sah::BuildOptions;

/// How a commit makes a frame of the parts of a scene. Hits do not depend on it; times and the [layout](crate::layout) of the
/// frame do.
///
/// # Instances that share
///
/// Parts that have the same mesh, the same `Arc` of it, may share one tree: [instances](crate::Scene::add_instance), and meshes that
/// were added several times. Such a part takes less than 1 kB in place of a copy, and its triangles are never transformed before a
/// ray comes near them: rays traverse the tree in its own space. Hits are those of a copy, to the bit. Where a transform flattens
/// the mesh or nearly so, or is in [f64](crate::Scene::set_world_transform), the part has a copy.
///
/// With [`Auto`](Self::Auto), parts share where copies of the mesh take more than 1 GiB, or longer to make than the rays of a frame
/// would lose; with [`Instances`](Self::Instances), always; with other strategies, never. The [`CommitReport`](crate::scene::CommitReport)
/// gives the reason for each part.
#[derive(Clone, Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Strategy {
    /// For each part that has changed, the cheaper of [`Refit`](Self::Refit) and [`Merge`](Self::Merge), by an estimate of the
    /// time to make it and of the time that the rays of a frame lose to boxes that no longer fit
    /// ([`Scene::set_ray_budget`](crate::Scene::set_ray_budget)). With [`Layout::Binary`](crate::Layout::Binary) in the scene's
    /// options: [`MergeMethod::PartitionTrees`].
    #[default]
    Auto,
    /// Rebuilds parts that have changed with a fast builder, and merges them with the static parts.
    Merge(MergeMethod),
    /// Keeps the nodes of parts that have changed, refits their boxes to the triangles, and merges the parts with the static
    /// ones. The fastest to make; slow to trace once triangles that were neighbors have moved apart.
    Refit,
    /// As [`Refit`](Self::Refit), but does not merge: rays traverse each part whose box they meet, one after the other. Known as
    /// a two-level hierarchy elsewhere. Parts of the same mesh [share](Self#instances-that-share) a tree.
    Instances,
    /// Rays traverse the static parts, then the others, which are rebuilt when they change; within each group as with
    /// [`Instances`](Self::Instances).
    Dual,
    /// Builds all triangles as one mesh with these options.
    Rebuild(BuildOptions),
}

/// How parts are merged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum MergeMethod {
    /// Merges wide nodes: opens nodes only where parts overlap, down to the size of what they overlap with, and joins them;
    /// everything below is shared, unchanged.
    #[default]
    Guided,
    /// Sweeps planes over the boxes of kd-trees, and dissolves trees that overlap into their children (Eleftheriades 2010,
    /// §3.4). Like the two methods below it gives a kd-tree in [`Layout::Binary`](crate::Layout::Binary), which traces slower
    /// than wide nodes. The scene keeps two copies of the static trees, so that a merge that fails leaves the frame before
    /// unchanged.
    PartitionTrees,
    /// Cuts the kd-trees of moving parts by the planes of the static tree (§3.3).
    BspMerge,
    /// Sends the triangles of moving parts down the planes of the static tree, and divides leaves that become too large (§3.5).
    Insertion,
}
