//! A kd-tree that is built where rays enter it.

use std::sync::Arc;

use kd_core::{Aabb, Hit, Mesh, Ray};
use kd_sah::{BuildError, BuildOptions, LazyNode, Opened};
use kd_trace::lazy::{self, Entered, LazyCells};
use kd_trace::{PackedTree, RayQuery, delegate_ray_query};

use crate::KdTree;

/// A kd-tree that is built as rays enter it: a cell is divided when a ray first enters it (Hunt, Mark, Fussell 2007).
///
/// Every query returns exactly what the same query of a [`KdTree`] returns, and so what a test of all triangles returns. Queries
/// take `&self` and may run on any number of threads; where several enter a cell at once, one divides it and the others wait.
///
/// It pays where few rays see little of a large mesh: picking, a few lines of sight, a view into one room of a building. It does
/// not pay where rays see most of the mesh: a ray divides cells on its own thread and waits for that, threads never divide one
/// cell together, and above some size each cell costs a ray a call and a pointer. Use a [`KdTree`] there, from the start or by
/// [`finish`](Self::finish). [`Accel::auto`](crate::Accel::auto) compares both by the expected number of rays.
///
/// Cells are always in [`Layout::Binary`](crate::Layout::Binary); the layout in the options applies to
/// [`finish`](Self::finish). Until then there are no nodes, no statistics and no file. References in cells that no ray has entered
/// take 32 bytes each.
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
/// // The far end of the row is divided only now.
/// assert!(tree.occluded(&Ray::new([19_000.1, 0.1, 3.0], [0.0, 0.0, -1.0])));
/// assert!(tree.opened() > after_one);
///
/// // The tree of the whole mesh.
/// let tree = tree.finish()?;
/// println!("{}", tree.stats());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct LazyTree {
    cells: Cells,
}

impl LazyTree {
    /// Computes the box of each triangle and divides nothing. The first ray divides the root cell.
    ///
    /// Planes are chosen as by [`KdTree::build`] with the same options;
    /// [`with_threads`](BuildOptions::with_threads) and [`with_layout`](BuildOptions::with_layout) apply to
    /// [`finish`](Self::finish) only.
    ///
    /// # Errors
    ///
    /// [`BuildError`] names the option that is out of range.
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

    /// The closest hit of each ray: a loop over single calls.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        RayQuery::intersect_batch(self, rays, hits);
    }

    /// Whether each ray hits anything: a loop over single calls.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        RayQuery::occluded_batch(self, rays, occluded);
    }

    /// How many cells rays have entered, each divided in two or built to its leaves. Linear in that number.
    pub fn opened(&self) -> usize {
        opened_below(&self.cells.root)
    }

    /// The mesh that the tree is over.
    pub fn mesh(&self) -> &Mesh {
        &self.cells.mesh
    }

    /// The tree of the whole mesh: [`KdTree::build`] with the same mesh and options. The build starts from the mesh, uses nothing
    /// that rays have divided, and so gives the same tree after any rays.
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

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for LazyTree: single;
    tree => tree,
}

/// The cells, with the mesh and the options to divide them.
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
