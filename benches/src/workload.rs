//! The rays of a scene, with the expected answers.

use kd::Ray;

use crate::check::{Answers, BruteForce};
use crate::measure::{self, Pairs, Repeats};
use crate::rays::{self, RayKind, RaySource};
use crate::scenes::Scene;
use crate::structure::{Manner, Structure};

/// The number of rays, and of answers to check.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Amount {
    /// Pixels along the side of the primary image.
    pub(crate) side: u32,
    /// The approximate number of rays of each kind but primary; 0 keeps all.
    pub(crate) ray_limit: usize,
    /// Ray-triangle tests for the check of each kind of ray on each scene. It does not depend on the other cells of a run, so
    /// that a cell is equal in any run.
    pub(crate) brute_force_tests: usize,
    /// The least number of answers of each kind to compare with brute force.
    pub(crate) least_checked: usize,
}

impl Amount {
    /// For a run whose figures count.
    pub(crate) const FULL: Self = Self {
        side: 1024,
        ray_limit: 1 << 16,
        brute_force_tests: 10_000_000,
        least_checked: 0,
    };
}

/// The rays of one kind on one scene, with the expected answers.
#[derive(Debug)]
pub(crate) struct Workload {
    pub(crate) kind: RayKind,
    pub(crate) rays: Vec<Ray>,
    /// The answers of the reference.
    pub(crate) expected: Answers,
    pub(crate) brute_force: BruteForce,
}

/// The rays of the given kinds. `reference` finds the primary hits, from which the others start.
pub(crate) fn all(
    scene: &Scene,
    kinds: &[RayKind],
    amount: Amount,
    reference: &dyn Structure,
) -> Vec<Workload> {
    // Nothing is timed here, so all cores work.
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let answered = |kind: RayKind, rays: &[Ray]| {
        let mut answers = Answers::none(kind, rays.len());
        measure::trace(reference, Manner::Single, rays, &mut answers, cores);
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

/// A structure, and how its rays are traced.
#[derive(Clone, Copy)]
pub(crate) struct Traced<'a> {
    pub(crate) structure: &'a dyn Structure,
    pub(crate) by: Manner,
    pub(crate) threads: usize,
}

impl<'a> Traced<'a> {
    /// One ray at a time, on one thread.
    pub(crate) fn single(structure: &'a dyn Structure) -> Self {
        Self {
            structure,
            by: Manner::Single,
            threads: 1,
        }
    }

    pub(crate) fn by(self, by: Manner) -> Self {
        Self { by, ..self }
    }

    pub(crate) fn on(self, threads: usize) -> Self {
        Self { threads, ..self }
    }
}

impl Workload {
    /// Times a structure, each time after the baseline, and keeps its answers.
    pub(crate) fn time(
        &self,
        repeats: Repeats,
        baseline: Traced<'_>,
        own: Traced<'_>,
        answers: &mut Answers,
    ) -> Pairs {
        let mut others = Answers::none(self.kind, self.rays.len());
        let trace = |traced: Traced<'_>, answers: &mut Answers| {
            measure::trace(
                traced.structure,
                traced.by,
                &self.rays,
                answers,
                traced.threads,
            );
        };
        measure::in_sure_pairs(
            repeats,
            || trace(baseline, &mut others),
            || trace(own, answers),
        )
    }
}
