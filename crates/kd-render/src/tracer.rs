//! The interface between the renderer and the structure that answers its rays.

use kd::{FrameData, Hit, PartId, Ray};
use kd_trace::RayQuery;

/// A hit on a part of a scene description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartHit {
    /// Index of the part in [`SceneDescription::parts`](kd_scene::SceneDescription::parts).
    pub part: usize,
    /// The hit; its triangle is an index into the mesh of the part.
    pub hit: Hit,
}

/// The two batch queries that a renderer needs.
///
/// Every [`RayQuery`] whose hits are [`PartHit`] is a tracer. The narrower trait exists for structures that cannot list
/// [all hits of a ray](RayQuery::hits), such as the rivals that the benchmarks render with.
///
/// Equal rays must get equal answers, on every thread.
pub trait Tracer: Sync {
    /// The closest hit of each ray, in order.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]);

    /// Whether each ray has any hit, in order.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]);
}

impl<Q: RayQuery<Hit = PartHit> + Sync> Tracer for Q {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        self.intersect_batch(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_batch(rays, occluded);
    }
}

/// A frame of a [`Stage`](crate::Stage), whose hits name parts by their index in the scene description.
#[derive(Clone, Copy, Debug)]
pub struct FrameTracer<'a> {
    pub(crate) frame: &'a FrameData,
    /// The parts of the frame in order of their ids, each with its index in the description.
    pub(crate) part_indices: &'a [(PartId, usize)],
}

impl FrameTracer<'_> {
    fn part_hit(&self, (id, hit): (PartId, Hit)) -> PartHit {
        let found = self.part_indices.binary_search_by_key(&id, |(id, _)| *id);
        let found = found.expect("every part of the frame is in the description");
        PartHit {
            part: self.part_indices[found].1,
            hit,
        }
    }
}

impl RayQuery for FrameTracer<'_> {
    type Hit = PartHit;

    fn intersect(&self, ray: &Ray) -> Option<PartHit> {
        self.frame.intersect(ray).map(|found| self.part_hit(found))
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.frame.occluded(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<PartHit>) {
        let mut found = Vec::new();
        self.frame.hits(ray, max, &mut found);
        out.clear();
        out.extend(found.into_iter().map(|found| self.part_hit(found)));
    }

    fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        let mut found = vec![None; rays.len()];
        self.frame.intersect_batch(rays, &mut found);
        for (hit, found) in hits.iter_mut().zip(found) {
            *hit = found.map(|found| self.part_hit(found));
        }
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.frame.occluded_batch(rays, occluded);
    }
}
