//! The queries of single rays, each in terms of one walk.

use kd_core::{Hit, Ray};
use kd_trace::kit::{Any, Closest, Collect, Ordered};

/// The walk of a ray through a structure.
pub(crate) trait Walk {
    /// Passes every hit to the collector that it may want, some of them more than once, roughly front to back.
    fn walk<C: Collect>(&self, ray: &Ray, collector: &mut C);
}

#[inline]
pub(crate) fn intersect(structure: &impl Walk, ray: &Ray) -> Option<Hit> {
    let mut closest = Closest::default();
    structure.walk(ray, &mut closest);
    closest.0
}

#[inline]
pub(crate) fn occluded(structure: &impl Walk, ray: &Ray) -> bool {
    let mut any = Any::default();
    structure.walk(ray, &mut any);
    any.0
}

pub(crate) fn hits(structure: &impl Walk, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
    out.clear();
    if max > 0 {
        structure.walk(ray, &mut Ordered { max, out });
    }
}
