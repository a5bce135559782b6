//! What answers rays.

use kd::{FrameData, Hit, PartId, Ray};

/// Where a ray meets a part of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartHit {
    /// The number of the part in [`SceneDescription::parts`](kd_scene::SceneDescription::parts).
    pub part: usize,
    /// Its triangle is that of the part.
    pub hit: Hit,
}

/// Anything that a renderer can ask where rays end. Answers to the same rays must be the same.
pub trait Tracer: Sync {
    /// The closest hit of each ray.
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]);

    /// Whether each ray has any hit.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);
}

impl<T: Tracer> Tracer for &T {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        T::intersect(self, rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        T::occluded(self, rays, occluded);
    }
}

/// A frame of a scene, asked in batches.
#[derive(Clone, Copy, Debug)]
pub struct FrameTracer<'a> {
    pub(crate) frame: &'a FrameData,
    /// Parts of the frame, in the order of their ids, and their numbers in the description.
    pub(crate) numbers: &'a [(PartId, usize)],
}

impl FrameTracer<'_> {
    fn number_of(&self, id: PartId) -> usize {
        let found = self.numbers.binary_search_by_key(&id, |(id, _)| *id);
        self.numbers[found.expect("every part of the frame is of the description")].1
    }
}

impl Tracer for FrameTracer<'_> {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        let mut found = vec![None; rays.len()];
        self.frame.intersect_batch(rays, &mut found);
        for (hit, found) in hits.iter_mut().zip(found) {
            *hit = found.map(|(id, hit)| PartHit {
                part: self.number_of(id),
                hit,
            });
        }
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.frame.occluded_batch(rays, occluded);
    }
}
