//! The paper's two kinds of rays: through two random points of the bounding sphere, and those of a path tracer.

use std::sync::Mutex;

use kd::{BuildOptions, Mesh, Ray, Strategy};
use kd_render::{FrameTracer, PartHit, RenderMethod, RenderOptions, Stage, Tracer, render};
use kd_scene::SceneDescription;
use kd_select::sample::RUN;
use rayon::ThreadPoolBuilder;

use crate::check::Answers;
use crate::paper::batches::Batches;
use crate::rays::{RayKind, RaySource};

/// About `count` of the rays, in runs of neighbors spread evenly over all.
pub(super) fn spread(rays: &Batches, count: usize) -> Batches {
    const NEIGHBORS: usize = 64;
    let stride = rays.len().div_ceil(count.max(1)).max(1);
    let some = |(kind, rays): &(RayKind, Vec<Ray>)| {
        let runs = rays.chunks(NEIGHBORS).step_by(stride);
        (*kind, runs.flatten().copied().collect())
    };
    Batches(rays.0.iter().map(some).collect())
}

/// Runs of a few neighbors.
pub(super) fn runs(rays: &Batches) -> Vec<Batches> {
    let of_kind = |(kind, rays): &(RayKind, Vec<Ray>)| {
        let kind = *kind;
        let run = |rays: &[Ray]| Batches(vec![(kind, rays.to_vec())]);
        rays.chunks(RUN).map(run).collect::<Vec<_>>()
    };
    rays.0.iter().flat_map(of_kind).collect()
}

/// The number of rays that hit.
pub(super) fn hits(answers: &[Answers]) -> usize {
    answers.iter().map(Answers::hits).sum()
}

/// Through two random points of the bounding sphere.
pub(super) fn random(mesh: &Mesh, count: usize) -> Batches {
    let placeholder = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let source = RaySource {
        mesh,
        light: kd::glam::Vec3::ZERO,
        primary: &vec![placeholder; count],
        points: &[],
        limit: 0,
    };
    Batches(vec![(RayKind::Random, source.rays(RayKind::Random))])
}

/// Those of a path tracer over a picture of `side` pixels squared: closest hits of camera rays and of up to three scattered rays
/// after each, and any hit of those to a light.
pub(super) fn path_traced(scene: &SceneDescription, side: u32) -> anyhow::Result<Batches> {
    let stage = Stage::new(scene.clone(), BuildOptions::fast(), Strategy::default())?;
    let options = RenderOptions {
        width: side,
        height: side,
        method: RenderMethod::Diffuse,
        bounces: 3,
        ..RenderOptions::default()
    };
    let recorder = Recorder {
        tracer: stage.tracer(),
        closest: Mutex::default(),
        any: Mutex::default(),
    };
    // On one thread, so that the order of rays is fixed.
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| render(&stage, &recorder, &stage.camera(), &options, &|_| {}));
    let recorded = |rays: Mutex<Vec<Ray>>| rays.into_inner().expect("no thread panicked");
    Ok(Batches(vec![
        (RayKind::Diffuse, recorded(recorder.closest)),
        (RayKind::Shadow, recorded(recorder.any)),
    ]))
}

/// A tracer that records the rays.
struct Recorder<'a> {
    tracer: FrameTracer<'a>,
    closest: Mutex<Vec<Ray>>,
    any: Mutex<Vec<Ray>>,
}

impl Tracer for Recorder<'_> {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        let mut recorded = self.closest.lock().expect("no thread panicked");
        recorded.extend_from_slice(rays);
        self.tracer.intersect(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        let mut recorded = self.any.lock().expect("no thread panicked");
        recorded.extend_from_slice(rays);
        self.tracer.occluded(rays, occluded);
    }
}
