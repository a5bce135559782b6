//! A kd-tree with its mesh.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use kd_core::{Hit, Layout, Mesh, Node, Ray, RayPacket8, Tree, TreeStats};
use kd_file::SavedFile;
use kd_points::WindingNumbers;
use kd_sah::{BuildError, BuildOptions, BuildProgress};
use kd_trace::{Level, RayQuery, delegate_ray_query};

use crate::layout::{self, LayoutPolicy, TreeLayout, TreeLayoutRef};

/// A kd-tree over a mesh with the [layout](crate::layout) that rays traverse. Queries take `&self` and may run on any number of
/// threads.
///
/// Every query returns what a test of all triangles in turn returns, to the bit: the same hits, and the lower triangle number
/// among equal distances. The triangle test is watertight (Woop, Benthin, Wald 2013): no ray passes through an edge or a vertex
/// that triangles share.
///
/// A ray that cannot hit anything (see [`Ray`]), and any ray on an empty mesh, is a miss, not an error.
///
/// # The kd-tree itself
///
/// Rays through wide nodes need no kd-tree, so the presets do not build one ([`WideNodes`](crate::WideNodes)). It is built on
/// demand, by the method of the preset: [`kd_tree`](Self::kd_tree) builds it at its first call, and so does [`nodes`](Self::nodes).
/// [`Layout::Binary`] and [`BuildOptions::with_method`] always build it.
#[derive(Clone, Debug)]
pub struct KdTree {
    pub(crate) mesh: Arc<Mesh>,
    /// Built with the layout, or on demand.
    pub(crate) tree: OnceLock<Tree>,
    pub(crate) layout: TreeLayout,
    pub(crate) options: BuildOptions,
    /// Made on demand, and shared by copies.
    pub(crate) winding: OnceLock<Arc<WindingNumbers>>,
    /// The mapped file of a tree that was not verified, which may have a kd-tree that was not read yet.
    pub(crate) saved: Option<Arc<SavedFile>>,
    /// See [`with_origin`](Self::with_origin).
    pub(crate) origin: DVec3,
}

impl KdTree {
    /// Builds what rays traverse, by default on all cores: wide nodes, or a kd-tree and its layout.
    ///
    /// The same mesh and options give the same tree, bit for bit, at any number of threads. An empty mesh gives a tree that
    /// nothing hits. The layout takes 60 to 110 bytes a triangle; where that is too much,
    /// [`custom::build`](crate::custom::build) returns a kd-tree without a layout.
    ///
    /// # Errors
    ///
    /// [`BuildError`] names the option that is out of range, or says that the tree outgrew its 30-bit indices.
    pub fn build(mesh: impl Into<Arc<Mesh>>, options: &BuildOptions) -> Result<Self, BuildError> {
        Self::built(mesh.into(), options, None)
    }

    /// [`build`](Self::build) for long builds: calls `progress` up to 256 times with the fraction that is done, from 0 to 1;
    /// `progress` can cancel the build by breaking. The fraction covers the kd-tree, if one is built, and the layout.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use std::sync::atomic::{AtomicBool, Ordering};
    ///
    /// use kd::{BuildError, BuildOptions, KdTree, Mesh};
    ///
    /// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// let stop = AtomicBool::new(false); // set by a button, for example
    /// let progress = |done: f32| {
    ///     eprintln!("{:.0} %", 100.0 * done);
    ///     if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    /// };
    /// let tree = KdTree::build_with_progress(mesh.clone(), &BuildOptions::best(), &progress)?;
    /// assert_eq!(tree.stats().references, 1);
    ///
    /// stop.store(true, Ordering::Relaxed);
    /// let cancelled = KdTree::build_with_progress(mesh, &BuildOptions::best(), &progress);
    /// assert_eq!(cancelled.err(), Some(BuildError::Cancelled));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`build`](Self::build), and [`BuildError::Cancelled`] soon after `progress` has broken.
    pub fn build_with_progress(
        mesh: impl Into<Arc<Mesh>>,
        options: &BuildOptions,
        progress: &BuildProgress<'_>,
    ) -> Result<Self, BuildError> {
        Self::built(mesh.into(), options, Some(progress))
    }

    fn built(
        mesh: Arc<Mesh>,
        options: &BuildOptions,
        progress: Option<&BuildProgress<'_>>,
    ) -> Result<Self, BuildError> {
        let (layout, tree) = layout::build(&mesh, options, progress)?;
        Ok(Self {
            mesh,
            tree: tree.map_or_else(OnceLock::new, OnceLock::from),
            layout,
            options: options.clone(),
            winding: OnceLock::new(),
            saved: None,
            origin: DVec3::ZERO,
        })
    }

    /// The same mesh in another layout: equal to the tree that the same build makes with that layout in its options. Builds the
    /// kd-tree for [`Layout::Binary`], if there is none.
    ///
    /// # Errors
    ///
    /// As [`kd_tree`](Self::kd_tree).
    pub fn with_layout(self, layout: Layout) -> Result<Self, BuildError> {
        if self.layout() == layout {
            return Ok(self);
        }
        let options = self.options.clone().with_layout(layout);
        let policy = LayoutPolicy::new(&options);
        let layout = if policy.follows_kd_tree() {
            policy.lay_out(self.kd_tree()?, &self.mesh)
        } else {
            layout::build(&self.mesh, &options, None)?.0
        };
        Ok(Self {
            layout,
            options,
            ..self
        })
    }

    /// The kd-tree that the options describe. Built at the first call, if the layout was made without it; then kept.
    ///
    /// ```
    /// use kd::{BuildOptions, KdTree, Mesh};
    ///
    /// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// let tree = KdTree::build(mesh, &BuildOptions::balanced())?; // wide nodes
    /// let kd_tree = tree.kd_tree()?;
    /// assert_eq!(kd_tree.stats().references, 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`BuildError`] if the tree outgrew its 30-bit indices, or if the threads could not be started.
    pub fn kd_tree(&self) -> Result<&Tree, BuildError> {
        self.kd_tree_on_demand(None)
    }

    /// [`kd_tree`](Self::kd_tree) with progress and cancellation, as in [`build_with_progress`](Self::build_with_progress). A tree
    /// that is there already calls nothing.
    ///
    /// # Errors
    ///
    /// Those of [`kd_tree`](Self::kd_tree), and [`BuildError::Cancelled`] soon after `progress` has broken; a later call starts
    /// again.
    pub fn kd_tree_with_progress(&self, progress: &BuildProgress<'_>) -> Result<&Tree, BuildError> {
        self.kd_tree_on_demand(Some(progress))
    }

    fn kd_tree_on_demand(&self, progress: Option<&BuildProgress<'_>>) -> Result<&Tree, BuildError> {
        if let Some(tree) = self.known_kd_tree() {
            return Ok(tree);
        }
        let tree = layout::build_kd_tree(&self.mesh, &self.options, progress)?;
        // Another thread may have built the same tree meanwhile.
        Ok(self.tree.get_or_init(|| tree))
    }

    /// The same tree, which knows the point of its [world](crate::world) at which the coordinates of the mesh have their zero. Files keep
    /// it; queries do not use it. It is zero unless it is set.
    ///
    /// ```
    /// use kd::world::World;
    /// use kd::{BuildOptions, KdTree, Mesh};
    ///
    /// let corners = [[5e5, 5.2e6, 0.0], [5e5 + 9.0, 5.2e6, 0.0], [5e5, 5.2e6 + 9.0, 0.0]];
    /// let mesh = Mesh::from_f64(&corners, vec![[0, 1, 2]])?;
    /// let folder = tempfile::tempdir()?;
    /// let path = folder.path().join("tile.kd");
    /// let tree = KdTree::build(mesh.mesh, &BuildOptions::balanced())?;
    /// tree.with_origin(mesh.origin).save(&path)?;
    ///
    /// let tree = KdTree::load(&path)?;
    /// let origin = tree.origin();
    /// assert_eq!(World::new(tree, origin).origin, mesh.origin);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_origin(self, origin: impl Into<DVec3>) -> Self {
        let origin = origin.into();
        Self { origin, ..self }
    }

    /// The point of the world at which the coordinates of the mesh have their zero.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// The options of the build, without the number of threads if the tree is from a file.
    pub fn options(&self) -> &BuildOptions {
        &self.options
    }

    /// Which layout rays traverse.
    pub fn layout(&self) -> Layout {
        self.layout.layout()
    }

    /// The same tree, traced at another level than the fastest of this processor. Answers are the same; for tests and
    /// measurements.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        let layout = self.layout.with_level(level);
        Self { layout, ..self }
    }

    /// The closest hit with `t_min <= t <= t_max`; both sides of a triangle count.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.layout.borrowed().intersect(ray)
    }

    /// Whether there is any hit with `t_min <= t <= t_max`: equal to [`intersect`](Self::intersect)`.is_some()`, and faster.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.layout.borrowed().occluded(ray)
    }

    /// The first `max` hits along the ray, in order, each triangle once. Clears `out` first; reuse it to save allocations.
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        self.layout.borrowed().hits(ray, max, out);
    }

    /// The first `max` hits behind a hit of the ray, in the order of [`hits`](Self::hits). Clears `out` first.
    ///
    /// `last` need not be a hit of the ray: it stands for its place in the order.
    pub fn hits_behind(&self, ray: &Ray, last: &Hit, max: usize, out: &mut Vec<Hit>) {
        self.layout.borrowed().hits_behind(ray, last, max, out);
    }

    /// The closest hit of each ray, equal to single calls.
    ///
    /// Batches detect coherent rays; the caller declares nothing. In the wide layout, every 64 rays in a row form a tile that
    /// descends together where its rays are coherent: camera rays in tiles of 8 by 8 pixels or in rows, shadow rays from
    /// neighboring points to one light, parallel rays. Rays that diverge on the way continue alone. Mirrored rays are sorted, up
    /// to 4096 at a time, into coherent groups. Incoherent rays are traced as streams, up to 1024 at a time, which each node
    /// divides, or sixteen at a time in turns. Each of these ways is timed on the way against single rays, and used where it is
    /// faster. So batches of a few thousand rays or more suit best; incoherent rays gain little below 1000. The binary layout
    /// traces one ray after the other. All work runs on the calling thread.
    ///
    /// The thread keeps the memory of a batch, a few MB at most, and what it has learned of the tree, for its next batch.
    ///
    /// ```
    /// use kd::glam::Vec3;
    /// use kd::{BuildOptions, KdTree, Mesh, Ray};
    ///
    /// let corners = vec![[-9.0, -9.0, 5.0], [9.0, -9.0, 5.0], [0.0, 9.0, 5.0]];
    /// let tree = KdTree::build(Mesh::new(corners, vec![[0, 1, 2]])?, &BuildOptions::default())?;
    /// // A tile of pixels, row by row.
    /// let pixels = (0..64_u8).map(|i| Vec3::new(f32::from(i % 8) - 3.5, f32::from(i / 8) - 3.5, 20.0));
    /// let rays: Vec<Ray> = pixels.map(|pixel| Ray::new(Vec3::ZERO, pixel)).collect();
    /// let mut hits = vec![None; rays.len()];
    /// tree.intersect_batch(&rays, &mut hits);
    /// assert_eq!(hits[27], tree.intersect(&rays[27]));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.layout.borrowed().intersect_batch(rays, hits);
    }

    /// Whether each ray hits anything, equal to single calls; coherent rays share work as in
    /// [`intersect_batch`](Self::intersect_batch).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.layout.borrowed().occluded_batch(rays, occluded);
    }

    /// The closest hit of the ray of each lane, equal to single calls; `None` in a lane without a ray.
    ///
    /// For programs that make their rays eight at a time: in the wide layout, coherent rays of a packet descend together. For more
    /// than eight rays, [`intersect_batch`](Self::intersect_batch) is faster.
    pub fn intersect8(&self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        self.layout.borrowed().intersect8(packet)
    }

    /// Whether the ray of each lane hits anything, equal to single calls; see [`intersect8`](Self::intersect8).
    pub fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        self.layout.borrowed().occluded8(packet)
    }

    /// Counts, histograms, costs and sizes of what rays traverse; linear in the number of nodes. Of the kd-tree, or of wide nodes
    /// that were made without one: [`TreeStats::of`] says which. `kd_tree()?.stats()` are those of the kd-tree in any case.
    pub fn stats(&self) -> TreeStats {
        let follows = LayoutPolicy::new(&self.options).follows_kd_tree();
        let tree = follows.then(|| self.known_kd_tree()).flatten();
        match (self.layout.borrowed(), tree) {
            (layout, Some(tree)) => tree
                .stats()
                .with_zero_area(self.mesh.zero_area_count())
                .with_layout_bytes(layout.bytes()),
            (TreeLayoutRef::Wide(wide), None) => wide.stats(&self.mesh),
            (TreeLayoutRef::Binary(_), None) => unreachable!("a binary layout follows a kd-tree"),
        }
    }

    /// The nodes of the kd-tree, root first; child indices refer to this slice. Builds the kd-tree if there is none.
    ///
    /// # Panics
    ///
    /// If the build fails: [`kd_tree`](Self::kd_tree) returns the error instead.
    pub fn nodes(&self) -> &[Node] {
        self.kd_tree().expect("a kd-tree within its limits").nodes()
    }

    /// The mesh that the tree is over.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for KdTree: single, behind, batch, packet;
    tree => tree,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "one hit per ray")]
    fn batches_of_unequal_length_are_refused() {
        let empty = Mesh::new(vec![], vec![]).expect("valid");
        let tree = KdTree::build(empty, &BuildOptions::default()).expect("an empty tree");
        tree.intersect_batch(&[], &mut [None]);
    }
}
