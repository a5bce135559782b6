//! The queries for single rays.

use kd_core::{Hit, Mesh, Ray};
use kd_trace::kit::{Any, Closest, Collect, Ordered};

use crate::bvh::Bvh;
use crate::counts::{BvhCounts, Probe};
use crate::walk::{PreparedRay, walk};

impl Bvh {
    /// The closest hit, the lower triangle among equals, or `None`. `mesh` is the one that the hierarchy was built from or
    /// refitted to last.
    ///
    /// `None` for a mesh without triangles, and for a ray that is not finite, has a zero direction, `t_min > t_max` or mask
    /// 0. Expected time is logarithmic in the number of triangles; nothing is allocated.
    ///
    /// # Panics
    ///
    /// If `mesh` is another one, and has fewer triangles.
    #[inline]
    pub fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        let mut closest = Closest::default();
        self.collect(mesh, ray, &mut closest, &mut ());
        closest.0
    }

    /// [`intersect`](Self::intersect), and what it took. Slower.
    ///
    /// # Panics
    ///
    /// As [`intersect`](Self::intersect).
    pub fn intersect_counted(&self, mesh: &Mesh, ray: &Ray) -> (Option<Hit>, BvhCounts) {
        let mut closest = Closest::default();
        let mut counts = BvhCounts::default();
        self.collect(mesh, ray, &mut closest, &mut counts);
        (closest.0, counts)
    }

    /// Whether there is any hit: the same as `intersect(..).is_some()`, and faster, since it stops at the first one found.
    ///
    /// # Panics
    ///
    /// As [`intersect`](Self::intersect).
    #[inline]
    pub fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool {
        let mut any = Any::default();
        self.collect(mesh, ray, &mut any, &mut ());
        any.0
    }

    /// The first `max` hits in `out`, which is cleared before: ordered by `t`, then by triangle, each triangle once.
    ///
    /// With `usize::MAX` all of them. `out` is the only memory that is allocated; keep it for the next ray.
    ///
    /// # Panics
    ///
    /// As [`intersect`](Self::intersect).
    pub fn hits(&self, mesh: &Mesh, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        out.clear();
        if max > 0 {
            self.collect(mesh, ray, &mut Ordered { max, out }, &mut ());
        }
    }

    #[inline]
    fn collect(
        &self,
        mesh: &Mesh,
        ray: &Ray,
        collector: &mut impl Collect,
        probe: &mut impl Probe,
    ) {
        if let Some(ray) = PreparedRay::new(ray, self, probe) {
            walk(self, mesh, ray, collector, probe);
        }
    }
}
