//! The queries.

use kd_core::{Hit, Ray};
use kd_trace::RayQuery;
use kd_trace::kit::{Closest, Collect, Probe};

use super::walk::{PreparedRay, walk};
use super::{Bvh, BvhCounts};
use crate::query::{Walk, Walked};

impl Bvh {
    /// [`intersect`](RayQuery::intersect), with its counts. Slower.
    pub fn intersect_counted(&self, ray: &Ray) -> (Option<Hit>, BvhCounts) {
        let mut closest = Closest::default();
        let mut counts = BvhCounts::default();
        self.collect(ray, &mut closest, &mut counts);
        (closest.0, counts)
    }

    #[inline]
    fn collect(&self, ray: &Ray, collector: &mut impl Collect, probe: &mut impl Probe) {
        if let Some(ray) = PreparedRay::new(ray, self, probe) {
            walk(self, ray, collector, probe);
        }
    }
}

impl Walk for Bvh {
    #[inline]
    fn walk<C: Collect>(&self, ray: &Ray, collector: &mut C) {
        self.collect(ray, collector, &mut ());
    }
}

impl RayQuery for Bvh {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        Walked(self).intersect(ray)
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        Walked(self).occluded(ray)
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        Walked(self).hits(ray, max, out);
    }

    fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.intersect_packets(rays, hits, &mut ());
    }

    fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.occluded_packets(rays, occluded);
    }
}
