//! The interface between the renderer and the structure that answers its rays.

use kd::query::RayHit;
use kd::{FrameData, Hit, PartId, Ray, Verdict};
use kd_trace::RayQuery;

use crate::placed::{PlacedPart, SeenInstance};

/// A hit on a part of a scene description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartHit {
    /// Index of the part in [`SceneDescription::parts`](kd_scene::SceneDescription::parts).
    pub part: usize,
    /// Index of the instance in [`Part::instances`](kd_scene::Part::instances); 0 for a part without any.
    pub instance: u32,
    /// The hit; its triangle is an index into the mesh of the part.
    pub hit: Hit,
}

impl RayHit for PartHit {
    #[inline]
    fn t(&self) -> f32 {
        self.hit.t
    }

    #[inline]
    fn triangle(&self) -> u32 {
        self.hit.triangle
    }

    #[inline]
    fn is_before(&self, other: &Self) -> bool {
        let of_instance = |hit: &Self| ((hit.part, hit.instance), hit.hit);
        of_instance(self).is_before(&of_instance(other))
    }
}

/// A [filter](RayQuery#filters) of the hits of a batch, which gets the number of the ray, too.
pub type HitFilter<'a> = dyn FnMut(usize, &PartHit) -> Verdict + 'a;

/// The batch queries that a renderer needs.
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

    /// The first hit of each ray that a filter accepts, in order. Only scenes with [holes or blends](kd_scene::AlphaMode) need it.
    ///
    /// A tracer that is no [`RayQuery`] traces a ray again behind each hit that is rejected: of several surfaces at one distance, it
    /// finds one.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn intersect_filtered(
        &self,
        rays: &[Ray],
        hits: &mut [Option<PartHit>],
        filter: &mut HitFilter<'_>,
    ) {
        self.intersect(rays, hits);
        for (number, (ray, hit)) in rays.iter().zip(hits).enumerate() {
            while let Some(found) = *hit {
                match filter(number, &found) {
                    Verdict::Accept => break,
                    Verdict::Reject if found.hit.t < ray.t_max => {
                        let behind = ray.with_range(found.hit.t.next_up(), ray.t_max);
                        self.intersect(&[behind], std::slice::from_mut(hit));
                    }
                    Verdict::Reject | Verdict::Stop => *hit = None,
                }
            }
        }
    }

    /// Whether a filter accepts any hit of each ray, in order; else as [`intersect_filtered`](Self::intersect_filtered).
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    fn occluded_filtered(&self, rays: &[Ray], occluded: &mut [bool], filter: &mut HitFilter<'_>) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        let mut hits = vec![None; rays.len()];
        self.intersect_filtered(rays, &mut hits, filter);
        for (occluded, hit) in occluded.iter_mut().zip(hits) {
            *occluded = hit.is_some();
        }
    }
}

impl<Q: RayQuery<Hit = PartHit> + Sync> Tracer for Q {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        self.intersect_batch(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_batch(rays, occluded);
    }

    fn intersect_filtered(
        &self,
        rays: &[Ray],
        hits: &mut [Option<PartHit>],
        filter: &mut HitFilter<'_>,
    ) {
        self.intersect_filtered_batch(rays, hits, filter);
    }

    fn occluded_filtered(&self, rays: &[Ray], occluded: &mut [bool], filter: &mut HitFilter<'_>) {
        self.occluded_filtered_batch(rays, occluded, filter);
    }
}

/// A frame of a [`Stage`](crate::Stage), whose hits name parts by their index in the scene description. Hits at one distance are in the
/// order of the frame: a part that was hidden for a while is behind all others.
#[derive(Clone, Copy, Debug)]
pub struct FrameTracer<'a> {
    pub(crate) frame: &'a FrameData,
    /// The instances in the frame, in order of their ids.
    pub(crate) seen: &'a [SeenInstance],
    /// The parts of the description.
    pub(crate) parts: &'a [PlacedPart],
}

impl FrameTracer<'_> {
    fn part_hit(&self, (id, hit): (PartId, Hit)) -> PartHit {
        let found = self.seen.binary_search_by_key(&id, |seen| seen.id);
        let found = found.expect("every part of the frame is in the description");
        let SeenInstance { part, instance, .. } = self.seen[found];
        PartHit {
            part,
            instance,
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

    fn hits_behind(&self, ray: &Ray, last: &PartHit, max: usize, out: &mut Vec<PartHit>) {
        let part = self.parts.get(last.part);
        let Some(id) = part.and_then(|part| part.id(last.instance)) else {
            // A part without a place in the order is before all others.
            let rest = ray.with_range(ray.t_min.max(last.hit.t), ray.t_max);
            return self.hits(&rest, max, out);
        };
        let mut found = Vec::new();
        self.frame
            .hits_behind(ray, &(id, last.hit), max, &mut found);
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
