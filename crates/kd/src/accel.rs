//! A structure that is chosen by how many rays will be asked.

mod budget;
mod decide;

use std::fmt;
use std::sync::Arc;

use kd_core::{Hit, Mesh, Ray};
use kd_grid::{GridOptions, UniformGrid};
use kd_sah::BuildOptions;
use kd_select::{Calibration, CalibrationError, Estimator, Structure};
use kd_trace::WideTree;
use thiserror::Error;

use crate::{KdTree, LazyTree};

pub use budget::RayBudget;
pub use decide::{Decision, DecisionReason};

/// A mesh with whichever structure answers so many rays soonest, building included.
///
/// A grid is there at once and slow for each ray; a kd-tree takes long to build and is fast. Which one pays is a matter of how
/// many rays there will be (Hapala, Karlík and Havran 2011), and of the mesh. Unless there are many rays for each triangle,
/// [`auto`](Self::auto) builds a grid, tries it on a few rays, estimates what others would take, and keeps it or builds another:
/// wide nodes of objects, a kd-tree of one of the presets, or one that is built where rays go. [`decision`](Self::decision) tells what, and why.
///
/// Every query gives what testing all triangles in turn would give, to the bit, whatever was chosen. Which one that is depends
/// on times that are taken, and so may differ from run to run: where that must not be, [`with`](Self::with) takes the one that
/// is asked for.
///
/// ```
/// use kd::{Accel, Mesh, Ray, RayBudget};
///
/// // A row of posts, each a triangle.
/// let post = |i: u16| {
///     let x = f32::from(i);
///     [[x, 0.0, 0.0], [x + 0.5, 0.0, 0.0], [x, 1.0, 0.0]]
/// };
/// let positions = (0..5_000).flat_map(post).collect();
/// let triangles = (0..5_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
/// let accel = Accel::auto(Mesh::new(positions, triangles)?, RayBudget::new(10))?;
///
/// let hit = accel.intersect(&Ray::new([500.1, 0.1, 3.0], [0.0, 0.0, -1.0]));
/// assert_eq!(hit.map(|hit| hit.triangle), Some(500));
/// println!("{}", accel.decision());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Accel {
    mesh: Arc<Mesh>,
    built: Built,
    decision: Decision,
}

#[derive(Debug)]
enum Built {
    Grid(UniformGrid),
    Bvh(WideTree),
    Tree(KdTree),
    Lazy(LazyTree),
}

/// Why there is no structure.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum AccelError {
    /// A kd-tree could not be built.
    #[error(transparent)]
    Tree(#[from] kd_sah::BuildError),
    /// A grid could not be built.
    #[error(transparent)]
    Grid(#[from] kd_grid::BuildError),
    /// A calibration holds what cannot be.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

impl Accel {
    /// The structure that answers so many rays soonest, by the [calibration](Calibration::built_in) that comes with the
    /// library: measured on another machine, of which ratios to the grid's times are used; and times, as far as they tell other
    /// structures apart, where no grid is tried.
    ///
    /// Builds what it chooses on all cores. A grid that is tried and not kept takes the time of building it on one thread, and
    /// a quarter more for a sample of rays (or what 40 rays take, if that is more), beside what is chosen; none is tried where
    /// there are many rays for each triangle.
    ///
    /// # Errors
    ///
    /// [`AccelError`], if threads cannot be started, or a tree outgrows its indices.
    pub fn auto(mesh: impl Into<Arc<Mesh>>, budget: RayBudget) -> Result<Self, AccelError> {
        let estimator = decide::built_in(budget.scheme());
        decide::choose(mesh.into(), &budget, estimator)
    }

    /// [`auto`](Self::auto) by the calibration of this machine, which `cargo xtask paper grid-table --calibration FILE` writes
    /// and [`Calibration::read`] reads.
    ///
    /// # Errors
    ///
    /// As [`auto`](Self::auto), and [`AccelError::Calibration`] if it holds what cannot be.
    pub fn auto_by(
        mesh: impl Into<Arc<Mesh>>,
        budget: RayBudget,
        calibration: &Calibration,
    ) -> Result<Self, AccelError> {
        calibration.check()?;
        let estimator = Estimator::of(calibration, budget.scheme());
        decide::choose(mesh.into(), &budget, &estimator)
    }

    /// A structure of one's own choice.
    ///
    /// # Errors
    ///
    /// As [`auto`](Self::auto).
    pub fn with(mesh: impl Into<Arc<Mesh>>, structure: Structure) -> Result<Self, AccelError> {
        let mesh = mesh.into();
        Ok(Self {
            built: Built::new(&mesh, structure)?,
            decision: Decision::asked_for(structure),
            mesh,
        })
    }

    /// What was chosen, and why.
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// The mesh it is over.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// As [`KdTree::intersect`].
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        match &self.built {
            Built::Grid(grid) => grid.intersect(&self.mesh, ray),
            Built::Bvh(bvh) => bvh.intersect(ray),
            Built::Tree(tree) => tree.intersect(ray),
            Built::Lazy(tree) => tree.intersect(ray),
        }
    }

    /// As [`KdTree::occluded`].
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        match &self.built {
            Built::Grid(grid) => grid.occluded(&self.mesh, ray),
            Built::Bvh(bvh) => bvh.occluded(ray),
            Built::Tree(tree) => tree.occluded(ray),
            Built::Lazy(tree) => tree.occluded(ray),
        }
    }

    /// As [`KdTree::hits`].
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        match &self.built {
            Built::Grid(grid) => grid.hits(&self.mesh, ray, max, out),
            Built::Bvh(bvh) => bvh.hits(ray, max, out),
            Built::Tree(tree) => tree.hits(ray, max, out),
            Built::Lazy(tree) => tree.hits(ray, max, out),
        }
    }

    /// As [`KdTree::intersect_batch`]; of a grid or a lazy tree, ray by ray.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        match &self.built {
            Built::Grid(_) => {
                assert_eq!(rays.len(), hits.len(), "one hit per ray");
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = self.intersect(ray);
                }
            }
            Built::Bvh(bvh) => bvh.intersect_batch(rays, hits),
            Built::Tree(tree) => tree.intersect_batch(rays, hits),
            Built::Lazy(tree) => tree.intersect_batch(rays, hits),
        }
    }

    /// As [`KdTree::occluded_batch`]; of a grid or a lazy tree, ray by ray.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        match &self.built {
            Built::Grid(_) => {
                assert_eq!(rays.len(), occluded.len(), "one answer per ray");
                for (ray, occluded) in rays.iter().zip(occluded) {
                    *occluded = self.occluded(ray);
                }
            }
            Built::Bvh(bvh) => bvh.occluded_batch(rays, occluded),
            Built::Tree(tree) => tree.occluded_batch(rays, occluded),
            Built::Lazy(tree) => tree.occluded_batch(rays, occluded),
        }
    }
}

impl Built {
    fn new(mesh: &Arc<Mesh>, structure: Structure) -> Result<Self, AccelError> {
        let mesh = Arc::clone(mesh);
        let options = match structure {
            Structure::Grid => {
                return Ok(Self::Grid(UniformGrid::build(&mesh, &GridOptions::new())?));
            }
            Structure::Bvh => return Ok(Self::Bvh(wide_nodes_of(&mesh))),
            Structure::Lazy => {
                let tree = LazyTree::new(mesh, &BuildOptions::balanced())?;
                return Ok(Self::Lazy(tree));
            }
            Structure::Fast => BuildOptions::fast(),
            Structure::Best => BuildOptions::best(),
            _ => BuildOptions::balanced(),
        };
        Ok(Self::Tree(KdTree::build(mesh, &options)?))
    }
}

fn wide_nodes_of(mesh: &Mesh) -> WideTree {
    #[cfg(feature = "parallel")]
    return WideTree::from_objects_parallel(mesh);
    #[cfg(not(feature = "parallel"))]
    WideTree::from_objects(mesh)
}

impl fmt::Display for Accel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.decision.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_may_run_on_any_thread() {
        fn shared<T: Send + Sync>() {}
        shared::<Accel>();
    }
}
