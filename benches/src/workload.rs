//! The rays of a scene, with the answers they must get.

use kd::Ray;

use crate::check::{Answers, BruteForce};
use crate::measure;
use crate::rays::{self, RayKind, RaySource};
use crate::scenes::Scene;
use crate::structure::Structure;

/// How many rays, and how many of the answers to check.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Amount {
    /// Pixels along the side of the primary image.
    pub(crate) side: u32,
    /// Of each kind but primary, keep about so many; 0 keeps all.
    pub(crate) ray_limit: usize,
    /// Ray-triangle tests to spend on checking each kind of ray on each scene, whatever else is in the run, so that
    /// a cell is the same in any run.
    pub(crate) brute_force_tests: usize,
    /// Answers of each kind to compare with brute force, whatever it takes.
    pub(crate) least_checked: usize,
}

impl Amount {
    /// That of a run from which figures are taken.
    pub(crate) const FULL: Self = Self {
        side: 1024,
        ray_limit: 1 << 16,
        brute_force_tests: 10_000_000,
        least_checked: 0,
    };
}

/// The rays of one kind on one scene, with the answers they must get.
#[derive(Debug)]
pub(crate) struct Workload {
    pub(crate) kind: RayKind,
    pub(crate) rays: Vec<Ray>,
    /// What the reference answers.
    pub(crate) expected: Answers,
    pub(crate) brute_force: BruteForce,
}

/// The rays of all these kinds. `reference` finds the primary hits from which others start.
pub(crate) fn all(
    scene: &Scene,
    kinds: &[RayKind],
    amount: Amount,
    reference: &dyn Structure,
) -> Vec<Workload> {
    // Nothing is timed here, so all cores may work.
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let answered = |kind: RayKind, rays: &[Ray]| {
        let mut answers = Answers::none(kind, rays.len());
        measure::trace(reference, rays, &mut answers, cores);
        answers
    };
    let primary = rays::primary(&scene.camera, amount.side);
    let points = match answered(RayKind::Primary, &primary) {
        Answers::Closest(hits) => rays::surface_points(&scene.mesh, &primary, &hits),
        Answers::Any(_) => Vec::new(),
    };
    let source = RaySource {
        mesh: &scene.mesh,
        light: scene.light,
        primary: &primary,
        points: &points,
        limit: amount.ray_limit,
    };
    let workload = |kind: &RayKind| {
        let (kind, rays) = (*kind, source.rays(*kind));
        let expected = answered(kind, &rays);
        let Amount {
            brute_force_tests: tests,
            least_checked: least,
            ..
        } = amount;
        let brute_force = BruteForce::sample(&scene.mesh, kind, &rays, tests, least);
        Workload {
            kind,
            rays,
            expected,
            brute_force,
        }
    };
    kinds.iter().map(workload).collect()
}

impl Workload {
    /// Times a structure, each time after the baseline, and keeps its answers.
    pub(crate) fn time(
        &self,
        repeats: measure::Repeats,
        threads: usize,
        baseline: &dyn Structure,
        structure: &dyn Structure,
        answers: &mut Answers,
    ) -> measure::Pairs {
        let mut others = Answers::none(self.kind, self.rays.len());
        let traced = |structure, answers: &mut Answers| {
            measure::trace(structure, &self.rays, answers, threads);
            Ok::<(), std::convert::Infallible>(())
        };
        let Ok(pairs) = measure::in_pairs(
            repeats,
            || traced(baseline, &mut others),
            || traced(structure, answers),
        );
        pairs
    }
}
