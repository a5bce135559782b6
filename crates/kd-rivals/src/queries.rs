//! The queries of a rival.

use kd_core::{Hit, Ray};
use kd_trace::RayQuery;

/// The greatest number of hits of a ray that Embree's filter keeps.
pub const FIRST: usize = 4;

/// Queries of a rival: [`RayQuery`], and lists of rays, so that one virtual call serves many rays.
///
/// [`RayQuery::intersect_batch`] traces a list in the way that is best for coherent rays: Embree in packets of eight, other
/// rivals one ray at a time.
pub trait Queries: RayQuery<Hit = Hit> + Send + Sync {
    /// [`RayQuery::intersect`] for each ray, one at a time.
    fn intersect_each(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.intersect(ray);
        }
    }

    /// [`RayQuery::occluded`] for each ray, one at a time.
    fn occluded_each(&self, rays: &[Ray], occluded: &mut [bool]) {
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded(ray);
        }
    }
}

impl<Q: Queries + ?Sized> Queries for &Q {
    fn intersect_each(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        (**self).intersect_each(rays, hits);
    }

    fn occluded_each(&self, rays: &[Ray], occluded: &mut [bool]) {
        (**self).occluded_each(rays, occluded);
    }
}

/// A structure whose first hits are found by further rays, each from just behind a closest hit: the way without a query for
/// several hits. Of several hits at the same distance it finds one.
#[derive(Clone, Copy, Debug)]
pub struct Restarting<Q>(pub Q);

impl<Q: RayQuery<Hit = Hit>> RayQuery for Restarting<Q> {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.0.intersect(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.0.occluded(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        restarted_hits(&self.0, ray, max, out);
    }
}

/// The first hits by the closest hits of rays that are restarted behind each. Where the rounding of a library finds the same
/// triangle again, the next ray starts further behind it.
pub(crate) fn restarted_hits(
    query: &impl RayQuery<Hit = Hit>,
    ray: &Ray,
    max: usize,
    out: &mut Vec<Hit>,
) {
    out.clear();
    let mut rest = *ray;
    let mut further = 0.0;
    while out.len() < max
        && let Some(hit) = query.intersect(&rest)
    {
        if out.last().is_some_and(|last| last.triangle == hit.triangle) {
            further = f32::max(2.0 * further, f32::EPSILON * hit.t.abs());
        } else {
            out.push(hit);
            further = 0.0;
        }
        rest.t_min = hit.t.next_up() + further;
    }
}
