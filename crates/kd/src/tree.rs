//! A mesh with its tree.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use kd_core::{FileError, Hit, Layout, Mesh, Node, Ray, RayPacket8, Tree, TreeStats};
use kd_sah::{BuildError, BuildOptions, Watch};
use kd_trace::Level;

use crate::traced::Traced;

/// A kd-tree over a mesh, laid out for rays, ready to trace. Queries take `&self` and may run on any number of threads.
///
/// Every query gives what testing all triangles in turn would give, to the bit: the same hits, equal distances
/// settled by the lower triangle number. The triangle test is watertight (Woop, Benthin, Wald 2013): a ray cannot
/// slip through an edge or a vertex that triangles share.
///
/// A ray that cannot hit anything (see [`Ray`]), and any ray on an empty mesh, is a miss and no error.
#[derive(Clone, Debug)]
pub struct KdTree {
    mesh: Arc<Mesh>,
    tree: Tree,
    pub(crate) traced: Traced,
}

impl KdTree {
    /// Builds a tree over a mesh and lays it out for rays, by default on all cores.
    ///
    /// The same mesh and options give the same tree, bit for bit, whatever the number of threads. An empty mesh gives
    /// a tree that nothing hits. What is traced takes 60 to 110 bytes a triangle; where that is too much,
    /// [`custom::build`](crate::custom::build) gives a tree alone.
    ///
    /// # Errors
    ///
    /// [`BuildError`] names an option that makes no sense, or says that the tree outgrew its 30-bit indices.
    pub fn build(mesh: impl Into<Arc<Mesh>>, options: &BuildOptions) -> Result<Self, BuildError> {
        let mesh = mesh.into();
        let tree = kd_sah::build(&*mesh, options)?;
        Ok(Self::laid_out(mesh, tree, options))
    }

    /// [`build`](Self::build) for long builds: `watch` is called up to 256 times on the way with the part that is done,
    /// from 0 to 1, and can end the build by breaking. What it sees is the tree; laying it out comes after.
    ///
    /// ```
    /// use std::ops::ControlFlow;
    /// use std::sync::atomic::{AtomicBool, Ordering};
    ///
    /// use kd::{BuildError, BuildOptions, KdTree, Mesh};
    ///
    /// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
    /// let stop = AtomicBool::new(false); // set, say, by a button
    /// let watch = |done: f32| {
    ///     eprintln!("{:.0} %", 100.0 * done);
    ///     if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    /// };
    /// let tree = KdTree::build_watched(mesh.clone(), &BuildOptions::best(), &watch)?;
    /// assert_eq!(tree.stats().references, 1);
    ///
    /// stop.store(true, Ordering::Relaxed);
    /// let cancelled = KdTree::build_watched(mesh, &BuildOptions::best(), &watch);
    /// assert_eq!(cancelled.err(), Some(BuildError::Cancelled));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`build`](Self::build), and [`BuildError::Cancelled`] soon after `watch` has broken.
    pub fn build_watched(
        mesh: impl Into<Arc<Mesh>>,
        options: &BuildOptions,
        watch: &Watch<'_>,
    ) -> Result<Self, BuildError> {
        let mesh = mesh.into();
        let tree = kd_sah::build_watched(&*mesh, options, watch)?;
        Ok(Self::laid_out(mesh, tree, options))
    }

    /// Lays out a tree over `mesh`, on one thread if it was built on one.
    fn laid_out(mesh: Arc<Mesh>, tree: Tree, options: &BuildOptions) -> Self {
        let traced = Traced::of_options(&tree, &mesh, options);
        Self { mesh, tree, traced }
    }

    /// The same tree in another layout, for one that was loaded from a file, say. Answers are the same.
    #[must_use]
    pub fn with_layout(self, layout: Layout) -> Self {
        if self.layout() == layout {
            return self;
        }
        let traced = Traced::new(&self.tree, &self.mesh, layout, true);
        Self { traced, ..self }
    }

    /// How it lies in memory.
    pub fn layout(&self) -> Layout {
        self.traced.layout()
    }

    /// The same tree, traced with other instructions than the fastest there are. Answers are the same; for tests and
    /// measurements.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        let traced = self.traced.with_level(level);
        Self { traced, ..self }
    }

    /// Writes the mesh and the tree to a file that [`load`](Self::load) reads, the same bytes on every platform.
    ///
    /// They go to a file beside it first (`….partial`), so that one that is there already is replaced whole or not.
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and what the system said.
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
            // Nothing is left of a failure; that it cannot be removed is not worth more than the failure itself.
            std::fs::remove_file(&partial).ok();
            FileError::Io {
                file: path.display().to_string(),
                source,
            }
        })
    }

    /// Reads a file that [`save`](Self::save) wrote, much faster than building the tree again.
    ///
    /// The file is verified: sizes, checksum, mesh and nodes. Whatever is in it, tracing the result is safe.
    ///
    /// # Errors
    ///
    /// [`FileError`] names the file and what is wrong with it.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let file = path.as_ref().display().to_string();
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(source) => return Err(FileError::Io { file, source }),
        };
        let (mesh, tree) = kd_core::read_tree(&bytes, &file)?;
        let traced = Traced::new(&tree, &mesh, Layout::default(), true);
        Ok(Self {
            mesh: Arc::new(mesh),
            tree,
            traced,
        })
    }

    /// The closest hit with `t_min <= t <= t_max`, both sides of a triangle alike.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.traced.borrowed().intersect(ray)
    }

    /// Whether there is any hit with `t_min <= t <= t_max`: [`intersect`](Self::intersect)`.is_some()`, sooner.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.traced.borrowed().occluded(ray)
    }

    /// The first `max` hits along the ray, in order, each triangle once. `out` is cleared first; reuse it to save
    /// allocations.
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        self.traced.borrowed().hits(ray, max, out);
    }

    /// The closest hit of each ray, equal to single calls.
    ///
    /// Runs of 64 rays, from the first one on, are traced together where they go much the same way: those of a camera,
    /// pixel by pixel in tiles of 8 by 8 or in rows; shadow rays of neighbouring points to one light; parallel rays. Where
    /// such rays part on their way, they go on one by one. What comes back from mirrors is looked through, up to 4096 rays at a
    /// time, for such as go the same way. Where rays have nothing in common, sixteen of them take their steps in turn. Nothing
    /// need be said about it: in the wide layout, batches find out themselves. All work is done on the calling thread.
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
        self.traced.borrowed().intersect_batch(rays, hits);
    }

    /// Whether each ray hits anything, equal to single calls; rays that are alike are traced together, as by
    /// [`intersect_batch`](Self::intersect_batch).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.traced.borrowed().occluded_batch(rays, occluded);
    }

    /// The closest hit of the ray of each lane, equal to single calls; `None` where there is no ray.
    ///
    /// For programs whose rays come eight at a time: in the wide layout, those of them that go much the same way go down the
    /// tree together. Where there are more, [`intersect_batch`](Self::intersect_batch) is faster.
    pub fn intersect8(&self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        self.traced.borrowed().intersect8(packet)
    }

    /// Whether the ray of each lane hits anything, equal to single calls; see [`intersect8`](Self::intersect8).
    pub fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        self.traced.borrowed().occluded8(packet)
    }

    /// Counts, histograms, costs and sizes; linear in the number of nodes.
    pub fn stats(&self) -> TreeStats {
        self.tree
            .stats()
            .with_zero_area(self.mesh.zero_area_count())
            .with_traced_bytes(self.traced.borrowed().bytes())
    }

    /// The nodes, root first; child indices refer to this slice.
    pub fn nodes(&self) -> &[Node] {
        self.tree.nodes()
    }

    /// The mesh it was built over.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// The tree without its mesh, for the functions of the crates below.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_may_run_on_any_thread() {
        fn shared<T: Send + Sync>() {}
        shared::<KdTree>();
        shared::<Arc<Mesh>>();
    }

    #[test]
    #[should_panic(expected = "one hit per ray")]
    fn batches_of_unequal_length_are_refused() {
        let empty = Mesh::new(vec![], vec![]).expect("valid");
        let tree = KdTree::build(empty, &BuildOptions::default()).expect("an empty tree");
        tree.intersect_batch(&[], &mut [None]);
    }
}
