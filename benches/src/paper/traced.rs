//! The same rays through whatever there is, and what they find.

use std::hint::black_box;
use std::time::Instant;

use kd::{Accel, FrameData, Hit, KdTree, LazyTree, PartId, Ray};

use super::mirrors::{Batch, Mirrors};
#[cfg(feature = "peers")]
use crate::peers;

/// What rays can go through.
pub(super) enum Traced<'a> {
    Tree(&'a KdTree),
    Lazy(&'a LazyTree),
    Accel(&'a Accel),
    Frame(&'a FrameData),
    #[cfg(feature = "peers")]
    Embree(&'a peers::EmbreeMoving),
}

/// What is known of a batch: the distances of hits, or whether there are any.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Answers {
    Closest(Vec<Option<f32>>),
    Any(Vec<bool>),
}

impl Traced<'_> {
    /// What rays hit, one by one.
    pub(super) fn answers(&self, rays: &Mirrors) -> Vec<Answers> {
        let answer = |batch: &Batch| match batch {
            Batch::Closest(rays) => {
                let (mut hits, mut parts) = (vec![None; rays.len()], vec![None; rays.len()]);
                self.closest(false, rays, &mut hits, &mut parts);
                let both = hits.into_iter().zip(parts);
                let found = both.map(|(hit, part)| hit.or(part.map(|(_, hit)| hit)));
                Answers::Closest(found.map(|hit| hit.map(|hit| hit.t)).collect())
            }
            Batch::Any(rays) => {
                let mut flags = vec![false; rays.len()];
                self.any(false, rays, &mut flags);
                Answers::Any(flags)
            }
        };
        rays.batches.iter().map(answer).collect()
    }

    /// Traces everything and tells how long that takes.
    pub(super) fn seconds(&self, rays: &Mirrors, in_batches: bool) -> f64 {
        let (mut hits, mut parts, mut flags) = (vec![], vec![], vec![]);
        let mut seconds = 0.0;
        for (number, batch) in rays.batches.iter().enumerate() {
            let (Batch::Closest(all) | Batch::Any(all)) = batch;
            hits.resize(all.len(), None);
            parts.resize(all.len(), None);
            flags.resize(all.len(), false);
            let in_batches = in_batches && number < self.most_batches();
            let start = Instant::now();
            match batch {
                Batch::Closest(rays) => {
                    self.closest(in_batches, rays, &mut hits, &mut parts);
                }
                Batch::Any(rays) => self.any(in_batches, rays, &mut flags),
            }
            seconds += start.elapsed().as_secs_f64();
            black_box((&hits, &parts, &flags));
        }
        seconds
    }

    /// How many of the first batches are worth tracing as such. Ours find out; Embree's packets are for rays that stay
    /// together, from the camera and to the light.
    fn most_batches(&self) -> usize {
        match self {
            Self::Tree(_) | Self::Lazy(_) | Self::Accel(_) | Self::Frame(_) => usize::MAX,
            #[cfg(feature = "peers")]
            Self::Embree(_) => 2,
        }
    }

    fn closest(
        &self,
        in_batches: bool,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        parts: &mut [Option<(PartId, Hit)>],
    ) {
        match self {
            Self::Tree(tree) if in_batches => tree.intersect_batch(rays, hits),
            Self::Tree(tree) => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = tree.intersect(ray);
                }
            }
            Self::Lazy(tree) => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = tree.intersect(ray);
                }
            }
            Self::Accel(accel) => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = accel.intersect(ray);
                }
            }
            Self::Frame(frame) if in_batches => frame.intersect_batch(rays, parts),
            Self::Frame(frame) => {
                for (ray, hit) in rays.iter().zip(parts) {
                    *hit = frame.intersect(ray);
                }
            }
            #[cfg(feature = "peers")]
            Self::Embree(embree) => embree.closest(in_batches, rays, hits),
        }
    }

    fn any(&self, in_batches: bool, rays: &[Ray], flags: &mut [bool]) {
        match self {
            Self::Tree(tree) if in_batches => tree.occluded_batch(rays, flags),
            Self::Tree(tree) => {
                for (ray, flag) in rays.iter().zip(flags) {
                    *flag = tree.occluded(ray);
                }
            }
            Self::Lazy(tree) => {
                for (ray, flag) in rays.iter().zip(flags) {
                    *flag = tree.occluded(ray);
                }
            }
            Self::Accel(accel) => {
                for (ray, flag) in rays.iter().zip(flags) {
                    *flag = accel.occluded(ray);
                }
            }
            Self::Frame(frame) if in_batches => frame.occluded_batch(rays, flags),
            Self::Frame(frame) => {
                for (ray, flag) in rays.iter().zip(flags) {
                    *flag = frame.occluded(ray);
                }
            }
            #[cfg(feature = "peers")]
            Self::Embree(embree) => embree.any(in_batches, rays, flags),
        }
    }
}

/// Of a million rays, how many hit here and not there, or elsewhere by a thousandth.
#[cfg(feature = "peers")]
pub(super) fn disagreement_ppm(expected: &[Answers], found: &[Answers]) -> f64 {
    let (mut all, mut differ) = (0_usize, 0_usize);
    for pair in expected.iter().zip(found) {
        match pair {
            (Answers::Closest(a), Answers::Closest(b)) => {
                all += a.len();
                let is_other = |(a, b): &(&Option<f32>, &Option<f32>)| match (a, b) {
                    (Some(a), Some(b)) => (a - b).abs() > 1e-3 * a.abs(),
                    (a, b) => a.is_some() != b.is_some(),
                };
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
