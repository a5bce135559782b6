//! The paper's two kinds of rays: through two random points of the bounding sphere, and those of a path tracer.

use std::sync::Mutex;

use kd::{BuildOptions, Hit, Mesh, Ray, Strategy};
use kd_render::{FrameTracer, PartHit, RenderMethod, RenderOptions, Stage, Tracer, render};
use kd_scene::SceneDescription;
use kd_select::sample::RUN;
use rayon::ThreadPoolBuilder;

use crate::rays::{RayKind, RaySource};
use crate::structure::{Manner, Structure};

/// Rays by kind of query.
#[derive(Clone, Debug, Default)]
pub(super) struct Rays {
    closest: Vec<Ray>,
    any: Vec<Ray>,
}

/// The answers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Answered {
    closest: Vec<Option<Hit>>,
    any: Vec<bool>,
}

impl Rays {
    pub(super) fn len(&self) -> usize {
        self.closest.len() + self.any.len()
    }

    pub(super) fn answer(&self, structure: &dyn Structure, by: Manner, answered: &mut Answered) {
        answered.closest.resize(self.closest.len(), None);
        answered.any.resize(self.any.len(), false);
        structure.closest(by, &self.closest, &mut answered.closest);
        structure.any(by, &self.any, &mut answered.any);
    }

    /// About `count` rays, in runs of neighbors spread evenly over all.
    pub(super) fn spread(&self, count: usize) -> Self {
        const NEIGHBORS: usize = 64;
        let stride = self.len().div_ceil(count.max(1)).max(1);
        let some = |rays: &[Ray]| {
            let runs = rays.chunks(NEIGHBORS).step_by(stride);
            runs.flatten().copied().collect()
        };
        Self {
            closest: some(&self.closest),
            any: some(&self.any),
        }
    }

    /// Runs of a few neighbors.
    pub(super) fn runs(&self) -> Vec<Self> {
        let closest = self.closest.chunks(RUN).map(|rays| (rays.to_vec(), vec![]));
        let any = self.any.chunks(RUN).map(|rays| (vec![], rays.to_vec()));
        let runs = closest.chain(any);
        runs.map(|(closest, any)| Self { closest, any }).collect()
    }
}

impl Answered {
    /// The number of rays that hit.
    pub(super) fn hits(&self) -> usize {
        self.closest.iter().flatten().count() + self.any.iter().filter(|any| **any).count()
    }

    /// The share of rays that hit.
    pub(super) fn hit_share(&self) -> f64 {
        self.hits() as f64 / (self.closest.len() + self.any.len()).max(1) as f64
    }
}

/// Through two random points of the bounding sphere.
pub(super) fn random(mesh: &Mesh, count: usize) -> Rays {
    let placeholder = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    let source = RaySource {
        mesh,
        light: kd::glam::Vec3::ZERO,
        primary: &vec![placeholder; count],
        points: &[],
        limit: 0,
    };
    Rays {
        closest: source.rays(RayKind::Random),
        any: Vec::new(),
    }
}

/// Those of a path tracer over a picture of `side` pixels squared: closest hits of camera rays and of up to three scattered rays
/// after each, and any hit of those to a light.
pub(super) fn path_traced(scene: &SceneDescription, side: u32) -> anyhow::Result<Rays> {
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
        rays: Mutex::default(),
    };
    // On one thread, so that the order of rays is fixed.
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| render(&stage, &recorder, &stage.camera(), &options, &|_| {}));
    Ok(recorder.rays.into_inner().expect("no thread panicked"))
}

/// A tracer that records the rays.
struct Recorder<'a> {
    tracer: FrameTracer<'a>,
    rays: Mutex<Rays>,
}

impl Tracer for Recorder<'_> {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        let mut recorded = self.rays.lock().expect("no thread panicked");
        recorded.closest.extend_from_slice(rays);
        self.tracer.intersect(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        let mut recorded = self.rays.lock().expect("no thread panicked");
        recorded.any.extend_from_slice(rays);
        self.tracer.occluded(rays, occluded);
    }
}
