//! The queries of single rays, each in terms of one walk.

use kd_core::{Hit, Ray};
use kd_trace::kit::{Any, Closest, Collect, Ordered};

/// The walk of a ray through a structure.
pub(crate) trait Walk {
    /// Passes every hit to the collector that it may want, some of them more than once, roughly front to back.
    fn walk<C: Collect>(&self, ray: &Ray, collector: &mut C);
}

/// The queries of a structure by its walk.
pub(crate) struct Walked<'a, W>(pub(crate) &'a W);

impl<W: Walk> Walked<'_, W> {
    #[inline]
    pub(crate) fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = Closest::default();
        self.0.walk(ray, &mut closest);
        closest.0
    }

    #[inline]
    pub(crate) fn occluded(&self, ray: &Ray) -> bool {
        let mut any = Any::default();
        self.0.walk(ray, &mut any);
        any.0
    }

    pub(crate) fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        Ordered::fill(out, max, |ordered| self.0.walk(ray, ordered));
    }
}
