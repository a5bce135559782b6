//! The three queries, each in terms of one walk.

use kd_core::{Hit, Mesh, Ray};
use kd_trace::kit::{Any, Closest, Collect, Ordered};

/// What a ray can walk through.
pub(crate) trait Walk {
    /// Gives the collector every hit that it may want, some of them more than once, roughly front to back.
    fn walk<C: Collect>(&self, mesh: &Mesh, ray: &Ray, collector: &mut C);
}

pub(crate) fn intersect(structure: &impl Walk, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
    let mut closest = Closest::default();
    structure.walk(mesh, ray, &mut closest);
    closest.0
}

pub(crate) fn occluded(structure: &impl Walk, mesh: &Mesh, ray: &Ray) -> bool {
    let mut any = Any::default();
    structure.walk(mesh, ray, &mut any);
    any.0
}

pub(crate) fn hits(structure: &impl Walk, mesh: &Mesh, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
    out.clear();
    if max > 0 {
        structure.walk(mesh, ray, &mut Ordered { max, out });
    }
}
