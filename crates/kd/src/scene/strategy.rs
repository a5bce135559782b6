//! How frames are made of parts.

use kd_sah::BuildOptions;

/// How a commit makes a frame of what moves and what stands still. Hits do not depend on it; times do.
#[derive(Clone, Debug, PartialEq, Default)]
#[non_exhaustive]
pub enum Strategy {
    /// For each part that has changed, the cheaper of [`Refit`](Self::Refit) and [`Merge`](Self::Merge), by what they cost to
    /// make and by what the rays of a frame lose to boxes that no longer fit
    /// ([`Scene::set_ray_budget`](crate::Scene::set_ray_budget)).
    #[default]
    Auto,
    /// Parts that have changed are built anew, by a fast builder, and merged with what stands still.
    Merge(MergeMethod),
    /// Parts that have changed keep their nodes, with boxes around where their triangles are now, and are merged with what
    /// stands still. The fastest to make; slow to trace once triangles that were neighbours have parted.
    Refit,
    /// As [`Refit`](Self::Refit), but parts stay whole: rays go through those whose boxes they meet one after the other.
    /// What is called two-level elsewhere.
    Instances,
    /// What stands still and what moves (built anew) are traced one after the other, each part whole as with
    /// [`Instances`](Self::Instances).
    Dual,
    /// Everything is built anew as one mesh.
    Rebuild(BuildOptions),
}

/// How parts are merged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum MergeMethod {
    /// Nodes are opened only where parts overlap, down to the size of what they overlap with, and joined anew; everything
    /// below is shared as it is.
    #[default]
    Guided,
    /// Planes are swept over the boxes of kd-trees, and trees that overlap are dissolved into their children (Eleftheriades
    /// 2010, §3.4). As the two below it gives a kd-tree, which is traced as [`Layout::Binary`](kd_core::Layout::Binary):
    /// slower than wide nodes, by whatever method it is merged. What stands still is kept twice, so that a merge that fails
    /// leaves the frame before as it is.
    PartitionTrees,
    /// The kd-trees of what moves are cut by the planes of the one that stands still (§3.3).
    BspMerge,
    /// The triangles of what moves are sent down the planes of what stands still, and leaves that become too large are
    /// divided again (§3.5).
    Insertion,
}
