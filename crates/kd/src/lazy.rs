//! A mesh with a tree that is built where rays go.

use std::sync::Arc;

use kd_core::{Aabb, Hit, Mesh, Ray};
use kd_sah::{BuildError, BuildOptions, LazyNode, Opened};
use kd_trace::PackedTree;
use kd_trace::lazy::{self, Entered, LazyCells};

use crate::KdTree;

/// A kd-tree that is built as rays ask for it: a cell is divided when a ray first enters it (Hunt, Mark, Fussell 2007).
///
/// Every query gives exactly what the same query on a [`KdTree`] gives, and so what testing all triangles would give.
/// Queries take `&self` and may run on any number of threads; where several enter a cell at once, one divides it and
/// the others wait.
///
/// It is good where few rays see little of a large mesh: picking, a handful of lines of sight, a view into one room of
/// a building. It is not for pictures that show most of the scene, where all of the work comes back and is done less
/// well: a ray divides cells on its own thread and waits for that, several threads never divide one cell together, and
/// rays pass through the cells above some size one call and one pointer at a time. Use a [`KdTree`] there, from the
/// start or by [`finish`](Self::finish). How many rays make the difference has not been measured yet.
///
/// Until it is finished there are no nodes, no statistics and no file. Triangles, and parts of them, in cells that
/// nobody has entered take 32 bytes each.
///
/// ```
/// use kd::{BuildOptions, LazyTree, Mesh, Ray};
///
/// // A long row of posts, each a triangle.
/// let post = |i: u16| {
///     let x = f32::from(i);
///     [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 1.0, 0.0]]
/// };
/// let positions = (0..20_000).flat_map(post).collect();
/// let triangles = (0..20_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
/// let tree = LazyTree::new(Mesh::new(positions, triangles)?, &BuildOptions::balanced())?;
/// assert_eq!(tree.opened(), 0);
///
/// let hit = tree.intersect(&Ray::new([500.1, 0.1, 3.0], [0.0, 0.0, -1.0])).expect("a post");
/// assert_eq!(hit.triangle, 500);
/// let after_one = tree.opened();
///
/// // The far end of the row was not looked at, until now.
/// assert!(tree.occluded(&Ray::new([19_000.1, 0.1, 3.0], [0.0, 0.0, -1.0])));
/// assert!(tree.opened() > after_one);
///
/// // All of it, to keep.
/// let tree = tree.finish()?;
/// println!("{}", tree.stats());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct LazyTree {
    cells: Cells,
}

impl LazyTree {
    /// Takes one look at each triangle and divides nothing. The first ray divides the cell of everything.
    ///
    /// Planes are chosen as [`KdTree::build`] would choose them with the same options, of which
    /// [`with_threads`](BuildOptions::with_threads) matters to [`finish`](Self::finish) only.
    ///
    /// # Errors
    ///
    /// [`BuildError`] names an option that makes no sense.
    pub fn new(mesh: impl Into<Arc<Mesh>>, options: &BuildOptions) -> Result<Self, BuildError> {
        let mesh = mesh.into();
        let root = LazyNode::root(&*mesh, options)?;
        let options = options.clone();
        Ok(Self {
            cells: Cells {
                mesh,
                options,
                root,
            },
        })
    }

    /// As [`KdTree::intersect`].
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        lazy::intersect(&self.cells, ray)
    }

    /// As [`KdTree::occluded`]. Enters no cell after the first hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        lazy::occluded(&self.cells, ray)
    }

    /// As [`KdTree::hits`].
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        lazy::hits(&self.cells, ray, max, out);
    }

    /// The closest hit of each ray, equal to single calls. Today it is a loop over them.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.intersect(ray);
        }
    }

    /// Whether each ray hits anything, equal to single calls. Today it is a loop over them.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded(ray);
        }
    }

    /// How many cells have been entered so far, and so divided in two or built to the end. Linear in that number.
    pub fn opened(&self) -> usize {
        opened_below(&self.cells.root)
    }

    /// The mesh it is over.
    pub fn mesh(&self) -> &Mesh {
        &self.cells.mesh
    }

    /// The tree of the whole mesh: [`KdTree::build`] with the same mesh and options, which starts anew and on as many
    /// threads as they say. Nothing of what rays have divided is used, so that the result is the same whatever they
    /// did.
    ///
    /// # Errors
    ///
    /// As [`KdTree::build`].
    pub fn finish(self) -> Result<KdTree, BuildError> {
        let Cells {
            mesh,
            options,
            root,
        } = self.cells;
        drop(root); // before the build needs memory
        KdTree::build(mesh, &options)
    }
}

/// The cells, with what it takes to divide them.
#[derive(Debug)]
struct Cells {
    mesh: Arc<Mesh>,
    options: BuildOptions,
    root: LazyNode<PackedTree>,
}

impl LazyCells for Cells {
    type Cell = LazyNode<PackedTree>;

    fn bounds(&self) -> Aabb {
        self.mesh.bounds()
    }

    fn root(&self) -> &Self::Cell {
        &self.root
    }

    fn enter<'a>(&'a self, cell: &'a Self::Cell) -> Entered<'a, Self::Cell> {
        let pack = |tree| PackedTree::new(&tree, &self.mesh);
        match cell.open(&*self.mesh, &self.options, pack) {
            Opened::Interior {
                axis,
                split,
                children,
            } => Entered::Interior {
                axis: *axis,
                split: *split,
                children,
            },
            Opened::Subtree(tree) => Entered::Subtree(tree),
        }
    }
}

fn opened_below(cell: &LazyNode<PackedTree>) -> usize {
    match cell.opened() {
        None => 0,
        Some(Opened::Interior { children, .. }) => {
            1 + children.iter().map(opened_below).sum::<usize>()
        }
        Some(Opened::Subtree(_)) => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_may_run_on_any_thread() {
        fn shared<T: Send + Sync>() {}
        shared::<LazyTree>();
    }
}
