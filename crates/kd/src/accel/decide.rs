//! The decision: steps 1 to 8 of the paper, for more than two structures.

use std::fmt;
use std::sync::{Arc, OnceLock};
#[cfg(not(target_family = "wasm"))]
use std::time::Instant;

use kd_core::{Mesh, Ray};
use kd_grid::{GridOptions, UniformGrid};
use kd_select::sample::{self, HARDLY_ANY, Run, Tried};
use kd_select::{Calibration, Choice, Estimator, Features, RayScheme, Structure, Times};

use super::{Accel, AccelError, Built, RayBudget};

/// The chosen structure and the reason. `Display` shows the compared costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    structure: Structure,
    reason: DecisionReason,
    choice: Option<Choice>,
}

/// The reason for a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DecisionReason {
    /// The caller chose it.
    Requested,
    /// Too few rays to justify measuring: the structure that is built first.
    HardlyAnyRays,
    /// More rays per triangle than a grid is best for on most scenes, so that no grid was tried. Costs are estimated from the number
    /// of triangles alone.
    ManyRays,
    /// The least total, by measured times of the grid and estimates for other structures.
    LeastTotal,
}

impl Decision {
    pub(super) fn requested(structure: Structure) -> Self {
        Self {
            structure,
            reason: DecisionReason::Requested,
            choice: None,
        }
    }

    /// The chosen structure.
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// The reason for the choice.
    pub fn reason(&self) -> DecisionReason {
        self.reason
    }

    /// The compared costs; `None` if no costs were compared. The build of a grid that was tried counts as zero.
    pub fn choice(&self) -> Option<&Choice> {
        self.choice.as_ref()
    }
}

impl fmt::Display for Decision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = match self.reason {
            DecisionReason::Requested => "requested by the caller",
            DecisionReason::HardlyAnyRays => "too few rays to justify measuring",
            DecisionReason::ManyRays => "more rays than a grid suits",
            DecisionReason::LeastTotal => "the least total once the grid is built",
        };
        write!(f, "{}: {reason}", self.structure)?;
        if let Some(choice) = &self.choice {
            write!(f, "\n{choice}")?;
        }
        Ok(())
    }
}

/// The estimator of the calibration that comes with the library.
pub(super) fn built_in(scheme: RayScheme) -> &'static Estimator {
    static ESTIMATORS: OnceLock<[Estimator; 2]> = OnceLock::new();
    let [random, path] = ESTIMATORS.get_or_init(|| {
        let calibration = Calibration::built_in();
        [RayScheme::Random, RayScheme::Path].map(|scheme| Estimator::of(&calibration, scheme))
    });
    match scheme {
        RayScheme::Random => random,
        RayScheme::Path => path,
    }
}

/// The eight steps, with all structures in place of the hierarchy.
pub(super) fn choose(
    mesh: Arc<Mesh>,
    budget: &RayBudget,
    estimator: &Estimator,
) -> Result<Accel, AccelError> {
    let triangles = mesh.len() as u64;
    let rays = budget.count() as f64;
    if budget.count() > HARDLY_ANY && !estimator.may_be_few(triangles, rays) {
        let costs = estimator.by_size(triangles);
        if let Some(choice) = Choice::among(&costs, rays) {
            return Accel::decided(mesh, None, DecisionReason::ManyRays, choice);
        }
    }
    // On one thread, as the calibration was measured: the gain of several threads is assumed equal for all structures.
    let options = GridOptions::new().with_threads(1);
    let (grid, build_seconds) = timed(|| UniformGrid::build(Arc::clone(&mesh), &options));
    let grid = grid?;
    if budget.count() <= HARDLY_ANY || mesh.is_empty() {
        return Ok(Accel {
            mesh,
            built: Built::Grid(grid),
            decision: Decision {
                structure: Structure::Grid,
                reason: DecisionReason::HardlyAnyRays,
                choice: None,
            },
        });
    }
    let sample = budget.sample(&mesh.bounds());
    let runs: Vec<&[Ray]> = sample.chunks(sample::RUN).collect();
    let most_rays = sample::most_rays(budget.count());
    let seconds = build_seconds.unwrap_or(f64::INFINITY);
    let tried = Tried::ask(runs.len(), most_rays, seconds, |place| {
        run(&grid, runs[place])
    });
    let features = Features::new(&grid.stats(), tried.hit_share());
    let measured = build_seconds.zip(tried.ray_seconds());
    let times = measured.map_or_else(
        // Without a clock: the times of calibrated grids of this size.
        || estimator.grid_by_size(triangles),
        |(build, ray)| Times::new(build, ray),
    );
    let mut costs = estimator.estimate(&features, &times);
    // The first structure is the grid, which is built.
    costs[0].1.build_seconds = 0.0;
    let choice = Choice::among(&costs, rays).expect("the grid at least");
    Accel::decided(mesh, Some(grid), DecisionReason::LeastTotal, choice)
}

impl Accel {
    /// Builds the chosen structure unless it is the grid that is built already.
    fn decided(
        mesh: Arc<Mesh>,
        grid: Option<UniformGrid>,
        reason: DecisionReason,
        choice: Choice,
    ) -> Result<Self, AccelError> {
        let structure = choice.structure;
        let built = match grid {
            Some(grid) if structure == Structure::Grid => Built::Grid(grid),
            // Frees the grid before the build of the other structure.
            grid => {
                drop(grid);
                Built::new(&mesh, structure)?
            }
        };
        Ok(Self {
            mesh,
            built,
            decision: Decision {
                structure,
                reason,
                choice: Some(choice),
            },
        })
    }
}

/// One run of step 2.
fn run(grid: &UniformGrid, rays: &[Ray]) -> Run {
    let (hits, seconds) = timed(|| {
        let hits = rays.iter().filter(|ray| grid.intersect(ray).is_some());
        hits.count()
    });
    Run {
        rays: rays.len(),
        hits,
        seconds,
    }
}

/// The result of `work` and its time in seconds.
#[cfg(not(target_family = "wasm"))]
fn timed<R>(work: impl FnOnce() -> R) -> (R, Option<f64>) {
    let start = Instant::now();
    let result = work();
    // The clock may be too coarse for short work.
    let seconds = start.elapsed().as_secs_f64().max(1e-9);
    (result, Some(seconds))
}

/// The result of `work`; the browser's sandbox has no clock.
#[cfg(target_family = "wasm")]
fn timed<R>(work: impl FnOnce() -> R) -> (R, Option<f64>) {
    (work(), None)
}
