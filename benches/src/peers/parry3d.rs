//! The crate `parry3d`: its triangle mesh, which has a BVH inside.

use kd::{Hit, Mesh, Ray};
use kd_trace::RayQuery;
use parry3d::shape::{CompositeShapeRef, TriMesh};

use super::rust;
use crate::structure::{Built, restarted_hits};

/// Builds on one thread for any `threads`: the crate has no parallel build.
pub(super) fn build(mesh: &Mesh, threads: usize) -> anyhow::Result<Built> {
    let positions = mesh.positions().iter().map(|at| (*at).into()).collect();
    let triangles = mesh.triangles().to_vec();
    rust::build(threads, || Ok(Parry(TriMesh::new(positions, triangles)?)))
}

fn ray_of(ray: &Ray) -> parry3d::query::Ray {
    let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
    parry3d::query::Ray::new(origin.into(), direction.into())
}

/// The mesh of the crate. (Neither the trait nor the type is ours, hence a type of our own.)
struct Parry(TriMesh);

/// The crate's ranges always start at 0.
impl RayQuery for Parry {
    type Hit = Hit;

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let found = CompositeShapeRef(&self.0).cast_local_ray(&ray_of(ray), ray.t_max, false);
        found.map(|(triangle, t)| rust::hit(t, triangle))
    }

    /// The crate's own query for this is a closest hit, too.
    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.intersect(ray).is_some()
    }

    fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        restarted_hits(self, ray, max, out);
    }
}
