//! A structure chosen by the number of rays.

mod budget;
mod decide;

use std::fmt;
use std::sync::Arc;

use kd_core::{Hit, Mesh, Ray};
use kd_grid::{GridOptions, UniformGrid};
use kd_sah::BuildOptions;
use kd_select::{Calibration, CalibrationError, Estimator, Structure};
use kd_trace::{RayQuery, WideTree, delegate_ray_query};
use thiserror::Error;

use crate::{KdTree, LazyTree};

pub use budget::RayBudget;
pub use decide::{Decision, DecisionReason};

/// A mesh with the structure that finishes first for a budget of rays, build included.
///
/// A grid is quick to build and slow for each ray; a kd-tree is slow to build and fast for rays. The better one depends on the
/// number of rays (Hapala, Karlík and Havran 2011) and on the mesh. Unless rays are many for each triangle, [`auto`](Self::auto)
/// builds a grid, tries it on a few rays, estimates the times of other structures, and keeps the grid or builds another structure:
/// wide nodes of objects, a kd-tree of one of the presets, or a kd-tree that is built where rays go. [`decision`](Self::decision)
/// returns the choice and its reason.
///
/// Every query equals a test of every triangle, to the bit, with every structure. The choice depends on measured times, and so may
/// differ from run to run. [`with`](Self::with) builds a structure of the caller's choice.
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
    Objects(WideTree),
    Tree(KdTree),
    Lazy(LazyTree),
}

/// Why a structure was not built.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum AccelError {
    /// A kd-tree could not be built.
    #[error(transparent)]
    Tree(#[from] kd_sah::BuildError),
    /// A grid could not be built.
    #[error(transparent)]
    Grid(#[from] kd_grid::GridError),
    /// A calibration has impossible figures.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

impl Accel {
    /// Chooses a structure for a budget of rays by the [calibration](Calibration::built_in) that comes with the library. It was
    /// measured on another machine: the choice uses its ratios to the grid's times, and its absolute times only to compare other
    /// structures when no grid is tried.
    ///
    /// Builds the chosen structure on all cores. A grid that is tried and not kept costs its build on one thread, and a quarter more
    /// for a sample of rays (or the time of 40 rays, if that is longer). No grid is tried if rays are many for each triangle.
    ///
    /// # Errors
    ///
    /// [`AccelError`] if threads cannot be started, or a tree outgrows its indices.
    pub fn auto(mesh: impl Into<Arc<Mesh>>, budget: RayBudget) -> Result<Self, AccelError> {
        let estimator = decide::built_in(budget.scheme());
        decide::choose(mesh.into(), &budget, estimator)
    }

    /// [`auto`](Self::auto) with the calibration of this machine, which `cargo xtask paper grid-table --calibration FILE` writes
    /// and `Calibration::read` reads (feature `io`).
    ///
    /// # Errors
    ///
    /// As [`auto`](Self::auto), and [`AccelError::Calibration`] if the calibration has impossible figures.
    pub fn auto_by(
        mesh: impl Into<Arc<Mesh>>,
        budget: RayBudget,
        calibration: &Calibration,
    ) -> Result<Self, AccelError> {
        calibration.check()?;
        let estimator = Estimator::of(calibration, budget.scheme());
        decide::choose(mesh.into(), &budget, &estimator)
    }

    /// Builds a structure of the caller's choice.
    ///
    /// # Errors
    ///
    /// As [`auto`](Self::auto).
    pub fn with(mesh: impl Into<Arc<Mesh>>, structure: Structure) -> Result<Self, AccelError> {
        let mesh = mesh.into();
        Ok(Self {
            built: Built::new(&mesh, structure)?,
            decision: Decision::requested(structure),
            mesh,
        })
    }

    /// The choice and its reason.
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// The mesh.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// As [`KdTree::intersect`].
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        RayQuery::intersect(self, ray)
    }

    /// As [`KdTree::occluded`].
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        RayQuery::occluded(self, ray)
    }

    /// As [`KdTree::hits`].
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        RayQuery::hits(self, ray, max, out);
    }

    /// As [`KdTree::intersect_batch`]; ray by ray through a grid or a lazy tree.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        RayQuery::intersect_batch(self, rays, hits);
    }

    /// As [`KdTree::occluded_batch`]; ray by ray through a grid or a lazy tree.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        RayQuery::occluded_batch(self, rays, occluded);
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for Accel: single, behind, batch, packet;
    Self { built: Built::Grid(grid), .. } => grid,
    Self { built: Built::Objects(wide), .. } => wide,
    Self { built: Built::Tree(tree), .. } => tree,
    Self { built: Built::Lazy(tree), .. } => tree,
}

impl Built {
    fn new(mesh: &Arc<Mesh>, structure: Structure) -> Result<Self, AccelError> {
        let mesh = Arc::clone(mesh);
        let options = match structure {
            Structure::Grid => {
                return Ok(Self::Grid(UniformGrid::build(mesh, &GridOptions::new())?));
            }
            Structure::Objects => return Ok(Self::Objects(WideTree::from_objects_parallel(&mesh))),
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

impl fmt::Display for Accel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.decision.fmt(f)
    }
}
