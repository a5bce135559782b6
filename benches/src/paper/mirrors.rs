//! The rays of a small ray tracer in a world of mirrors: a picture, two reflections of it, and from every visible point a ray to
//! the light. (The workload of Table 4.1 of *kd-tree merging*: one light, two bounces.)

use std::sync::Mutex;

use kd::glam::Vec3;
use kd::{FrameData, Hit, KdTree, PartId, Ray};
use kd_scene::Camera;

use super::batches::Batches;
use crate::check::{Answers, are_close};
use crate::rays::{self, RayKind, SurfacePoint};
use crate::structure::{Manner, Shape, Structure, any, closest};

/// The picture, in pixels.
const WIDTH: u32 = 800;
const HEIGHT: u32 = 600;
const BOUNCES: usize = 2;

/// The rays of a frame.
#[derive(Debug)]
pub(super) struct Mirrors {
    batches: Batches,
    /// Rays of the whole picture for each of these.
    scale: f64,
}

/// Which batches are traced together.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Together {
    None,
    All,
    /// Rays from the camera and their shadow rays, which are coherent: what packets are for.
    Coherent,
}

impl Mirrors {
    /// The rays of about `limit` pixels, or of all for 0.
    pub(super) fn new(tree: &KdTree, camera: &Camera, light: Vec3, limit: usize) -> Self {
        let all = (WIDTH * HEIGHT) as usize;
        let stride = if limit == 0 { 1 } else { all.div_ceil(limit) };
        let mut closest = rays::picture(camera, [WIDTH, HEIGHT], stride);
        let scale = all as f64 / closest.len() as f64;
        let mut batches = Vec::new();
        for _ in 0..=BOUNCES {
            let (mut shadow, mut mirrored) = (Vec::new(), Vec::new());
            for ray in &closest {
                let hit = tree.intersect(ray);
                let point = hit.and_then(|hit| SurfacePoint::new(tree.mesh(), ray, &hit));
                let Some(SurfacePoint { origin, normal }) = point else {
                    continue;
                };
                shadow.push(Ray::between(origin, light));
                mirrored.push(Ray::new(origin, ray.direction.reflect(normal)));
            }
            let seen = std::mem::replace(&mut closest, mirrored);
            batches.extend([(RayKind::Primary, seen), (RayKind::Shadow, shadow)]);
        }
        Self {
            batches: Batches(batches),
            scale,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.batches.len()
    }

    /// The approximate number of rays of the whole picture.
    pub(super) fn of_whole_picture(&self) -> usize {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few million"
        )]
        let all = (self.len() as f64 * self.scale) as usize;
        all
    }

    /// The answers, one ray at a time.
    pub(super) fn answers(&self, structure: &dyn Structure) -> Vec<Answers> {
        self.batches.trace(structure, |_| Manner::Single).1
    }

    /// Seconds to trace everything.
    pub(super) fn seconds(&self, structure: &dyn Structure, together: Together) -> f64 {
        let by = |number| match together {
            Together::All => Manner::Batch,
            Together::Coherent if number < 2 => Manner::Packets,
            _ => Manner::Single,
        };
        self.batches.trace(structure, by).0
    }
}

/// Of a million rays, those that hit in one and not in the other, or at distances that differ by more than `tolerance`; triangles
/// may have other numbers.
pub(super) fn disagreement_ppm(expected: &[Answers], found: &[Answers], tolerance: bool) -> f64 {
    let (mut all, mut differ) = (0_usize, 0_usize);
    let is_other = |(a, b): &(&Option<Hit>, &Option<Hit>)| match (a, b) {
        (Some(a), Some(b)) if tolerance => !are_close(a.t, b.t),
        (a, b) => a.map(|hit| hit.t) != b.map(|hit| hit.t),
    };
    for pair in expected.iter().zip(found) {
        match pair {
            (Answers::Closest(a), Answers::Closest(b)) => {
                all += a.len();
                differ += a.iter().zip(b).filter(is_other).count();
            }
            (Answers::Any(a), Answers::Any(b)) => {
                all += a.len();
                differ += a.iter().zip(b).filter(|(a, b)| a != b).count();
            }
            _ => unreachable!("the same batches"),
        }
    }
    1e6 * differ as f64 / all.max(1) as f64
}

/// A frame as a structure. Triangles have the numbers of their parts.
#[derive(Debug)]
pub(super) struct OfFrame<'a> {
    frame: &'a FrameData,
    /// Hits with their parts, kept so that no query allocates.
    found: Mutex<Vec<Option<(PartId, Hit)>>>,
}

impl<'a> OfFrame<'a> {
    pub(super) fn new(frame: &'a FrameData) -> Self {
        let found = Mutex::default();
        Self { frame, found }
    }
}

impl Structure for OfFrame<'_> {
    fn closest(&self, by: Manner, rays: &[Ray], hits: &mut [Option<Hit>]) {
        let mut found = self.found.lock().expect("no query panics");
        found.resize(rays.len(), None);
        closest(self.frame, by, rays, &mut found);
        for (hit, found) in hits.iter_mut().zip(&*found) {
            *hit = found.map(|(_, hit)| hit);
        }
    }

    fn any(&self, by: Manner, rays: &[Ray], occluded: &mut [bool]) {
        any(self.frame, by, rays, occluded);
    }

    fn shape(&self) -> Shape {
        Shape::default()
    }
}
