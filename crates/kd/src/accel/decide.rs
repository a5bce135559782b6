//! Choosing: steps 1 to 8 of the paper, among more than two.

use std::fmt;
use std::sync::{Arc, OnceLock};
#[cfg(not(target_family = "wasm"))]
use std::time::Instant;

use kd_core::{Mesh, Ray};
use kd_grid::{GridOptions, UniformGrid};
use kd_select::sample::{self, HARDLY_ANY, Run, Tried};
use kd_select::{Calibration, Choice, Estimator, Features, RayScheme, Structure, Times};

use super::{Accel, AccelError, Built, RayBudget};

/// What was chosen, and why. Its text form tells the costs that were compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    structure: Structure,
    why: DecisionReason,
    choice: Option<Choice>,
}

/// What a choice rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum DecisionReason {
    /// It was asked for.
    Asked,
    /// There are fewer rays than it takes to tell: whatever is there first.
    HardlyAnyRays,
    /// There are more rays for each triangle than a grid is best for on most scenes, so that none was tried. Costs were estimated
    /// from the number of triangles alone.
    ManyRays,
    /// Its total is least, by what the grid took and by estimates for the others.
    LeastTotal,
}

impl Decision {
    pub(super) fn asked_for(structure: Structure) -> Self {
        Self {
            structure,
            why: DecisionReason::Asked,
            choice: None,
        }
    }

    /// What was chosen.
    pub fn structure(&self) -> Structure {
        self.structure
    }

    /// What the choice rests on.
    pub fn why(&self) -> DecisionReason {
        self.why
    }

    /// The costs that were compared, if any were. Where a grid was built, building it counts no more, since that is done.
    pub fn choice(&self) -> Option<&Choice> {
        self.choice.as_ref()
    }
}

impl fmt::Display for Decision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let why = match self.why {
            DecisionReason::Asked => "it was asked for",
            DecisionReason::HardlyAnyRays => "there are fewer rays than it takes to tell",
            DecisionReason::ManyRays => "there are more rays than a grid is mostly good for",
            DecisionReason::LeastTotal => "its total is least, the grid being there",
        };
        write!(f, "{}: {why}", self.structure)?;
        if let Some(choice) = &self.choice {
            write!(f, "\n{choice}")?;
        }
        Ok(())
    }
}

/// By the calibration that comes with the library.
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

/// The eight steps, with all structures for the hierarchy.
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
    // On one thread, as what estimates rest on was measured: how much several gain is taken to be alike for all.
    let options = GridOptions::new().with_threads(1);
    let (grid, build_seconds) = timed(|| UniformGrid::build(&mesh, &options));
    let grid = grid?;
    if budget.count() <= HARDLY_ANY || mesh.is_empty() {
        return Ok(Accel {
            mesh,
            built: Built::Grid(grid),
            decision: Decision {
                structure: Structure::Grid,
                why: DecisionReason::HardlyAnyRays,
                choice: None,
            },
        });
    }
    let sample = budget.sample(&mesh.bounds());
    let runs: Vec<&[Ray]> = sample.chunks(sample::RUN).collect();
    let most_rays = sample::most_rays(budget.count());
    let seconds = build_seconds.unwrap_or(f64::INFINITY);
    let tried = Tried::ask(runs.len(), most_rays, seconds, |place| {
        run(&grid, &mesh, runs[place])
    });
    let features = Features::new(&grid.stats(), tried.hit_share());
    let measured = build_seconds.zip(tried.ray_seconds());
    let times = measured.map_or_else(
        // There is no clock: what calibrated grids of this size took.
        || estimator.grid_by_size(triangles),
        |(build, ray)| Times::new(build, ray),
    );
    let mut costs = estimator.estimate(&features, &times);
    // The grid comes first, and is there.
    costs[0].1.build_seconds = 0.0;
    let choice = Choice::among(&costs, rays).expect("the grid at least");
    Accel::decided(mesh, Some(grid), DecisionReason::LeastTotal, choice)
}

impl Accel {
    /// Builds what was chosen, if that is not the grid that is there.
    fn decided(
        mesh: Arc<Mesh>,
        grid: Option<UniformGrid>,
        why: DecisionReason,
        choice: Choice,
    ) -> Result<Self, AccelError> {
        let structure = choice.structure;
        let built = match grid {
            Some(grid) if structure == Structure::Grid => Built::Grid(grid),
            // Before the other one needs memory.
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
                why,
                choice: Some(choice),
            },
        })
    }
}

/// Step 2, a run of it.
fn run(grid: &UniformGrid, mesh: &Mesh, rays: &[Ray]) -> Run {
    let (hits, seconds) = timed(|| {
        let hits = rays
            .iter()
            .filter(|ray| grid.intersect(mesh, ray).is_some());
        hits.count()
    });
    Run {
        rays: rays.len(),
        hits,
        seconds,
    }
}

/// What `work` returns, and the seconds it took.
#[cfg(not(target_family = "wasm"))]
fn timed<R>(work: impl FnOnce() -> R) -> (R, Option<f64>) {
    let start = Instant::now();
    let result = work();
    // A clock may stand still for what takes hardly any time.
    let seconds = start.elapsed().as_secs_f64().max(1e-9);
    (result, Some(seconds))
}

/// What `work` returns; there is no clock in the browser's sandbox.
#[cfg(target_family = "wasm")]
fn timed<R>(work: impl FnOnce() -> R) -> (R, Option<f64>) {
    (work(), None)
}
