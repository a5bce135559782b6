//! A kd-tree with its mesh.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use kd_core::{FileError, Hit, Layout, Mesh, Node, Ray, RayPacket8, Tree, TreeStats};
use kd_sah::{BuildError, BuildOptions, BuildProgress};
use kd_trace::{Level, RayQuery, delegate_ray_query};

use crate::layout::{LayoutPolicy, TreeLayout};

/// A kd-tree over a mesh with the [layout](crate::layout) that rays traverse. Queries take `&self` and may run on any number of
/// threads.
///
/// Every query returns what a test of all triangles in turn returns, to the bit: the same hits, and the lower triangle number
/// among equal distances. The triangle test is watertight (Woop, Benthin, Wald 2013): no ray passes through an edge or a vertex
/// that triangles share.
///
/// A ray that cannot hit anything (see [`Ray`]), and any ray on an empty mesh, is a miss, not an error.
#[derive(Clone, Debug)]
pub struct KdTree {
    mesh: Arc<Mesh>,
    tree: Tree,
    pub(crate) layout: TreeLayout,
    policy: LayoutPolicy,
}

impl KdTree {
    /// Builds a kd-tree over a mesh and its layout, by default on all cores.
    ///
    /// The same mesh and options give the same tree, bit for bit, at any number of threads. An empty mesh gives a tree that
    /// nothing hits. The layout takes 60 to 110 bytes a triangle, beside the tree; where that is too much,
    /// [`custom::build`](crate::custom::build) returns the tree without a layout.
    ///
    /// # Errors
    ///
    /// [`BuildError`] names the option that is out of range, or says that the tree outgrew its 30-bit indices.
    pub fn build(mesh: impl Into<Arc<Mesh>>, options: &BuildOptions) -> Result<Self, BuildError> {
        let mesh = mesh.into();
        let tree = kd_sah::build(&*mesh, options)?;
        Ok(Self::laid_out(mesh, tree, options))
    }

    /// [`build`](Self::build) for long builds: calls `progress` up to 256 times with the fraction that is done, from 0 to 1;
    /// `progress` can cancel the build by breaking. The fraction covers tree construction only, without layout.
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
        let mesh = mesh.into();
        let tree = kd_sah::build_with_progress(&*mesh, options, progress)?;
        Ok(Self::laid_out(mesh, tree, options))
    }

    fn laid_out(mesh: Arc<Mesh>, tree: Tree, options: &BuildOptions) -> Self {
        let policy = LayoutPolicy::new(options);
        Self {
            layout: policy.lay_out(&tree, &mesh),
            policy,
            mesh,
            tree,
        }
    }

    /// The same tree in another layout: equal to the tree that the same build makes with that layout in its options.
    #[must_use]
    pub fn with_layout(self, layout: Layout) -> Self {
        if self.layout() == layout {
            return self;
        }
        let policy = self.policy.with_layout(layout);
        Self {
            layout: policy.lay_out(&self.tree, &self.mesh),
            policy,
            ..self
        }
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

    /// Writes the mesh and the tree to a file that [`load`](Self::load) reads: the same bytes on every platform. The layout is
    /// not written.
    ///
    /// The data goes to a file beside it first (`….partial`), which then replaces an existing file as a whole.
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and the error of the system.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let path = path.as_ref();
        let mut partial = path.as_os_str().to_owned();
        partial.push(".partial");
        let written = File::create(&partial).and_then(|file| {
            let mut file = BufWriter::new(file);
            kd_core::write_tree(&self.mesh, &self.tree, &mut file)?;
            file.into_inner()?.sync_all()?;
            std::fs::rename(&partial, path)
        });
        written.map_err(|source| {
            // A leftover that cannot be removed matters less than the first error.
            std::fs::remove_file(&partial).ok();
            FileError::Io {
                file: path.display().to_string(),
                source,
            }
        })
    }

    /// Reads a file that [`save`](Self::save) wrote, and lays out its tree as [`BuildOptions::balanced`] does, on all cores. Much
    /// faster than a build.
    ///
    /// The file is verified: sizes, checksum, mesh and nodes. Tracing the result is safe for any content.
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and the problem.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, FileError> {
        Self::load_with(path, &BuildOptions::balanced())
    }

    /// [`load`](Self::load) with the [layout](crate::layout) that a build with `options` makes. A file does not record the
    /// options of its build: those of [`BuildOptions::best`] give the layout of a tree built by `best`.
    ///
    /// Only the layout, the method and the number of threads in `options` count.
    ///
    /// # Errors
    ///
    /// As [`load`](Self::load).
    pub fn load_with(path: impl AsRef<Path>, options: &BuildOptions) -> Result<Self, FileError> {
        let file = path.as_ref().display().to_string();
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(source) => return Err(FileError::Io { file, source }),
        };
        let (mesh, tree) = kd_core::read_tree(&bytes, &file)?;
        Ok(Self::laid_out(Arc::new(mesh), tree, options))
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

    /// Counts, histograms, costs and sizes; linear in the number of nodes.
    pub fn stats(&self) -> TreeStats {
        self.tree
            .stats()
            .with_zero_area(self.mesh.zero_area_count())
            .with_layout_bytes(self.layout.borrowed().bytes())
    }

    /// The nodes, root first; child indices refer to this slice.
    pub fn nodes(&self) -> &[Node] {
        self.tree.nodes()
    }

    /// The mesh that the tree is over.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The tree without its mesh, for the functions of the crates below.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for KdTree: single, batch, packet;
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
