//! The crate `parry3d`: its triangle mesh, which has a BVH inside.

use kd::{Hit, Mesh, Ray};
use parry3d::shape::{CompositeShapeRef, TriMesh};

use super::rust::{self, SingleRays};
use crate::structure::Built;

/// Builds on one thread, whatever `threads` says: the crate has no other way.
pub(super) fn build(mesh: &Mesh, threads: usize) -> anyhow::Result<Built> {
    let positions = mesh.positions().iter().map(|at| (*at).into()).collect();
    let triangles = mesh.triangles().to_vec();
    rust::build(threads, || Ok(TriMesh::new(positions, triangles)?))
}

fn ray_of(ray: &Ray) -> parry3d::query::Ray {
    let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
    parry3d::query::Ray::new(origin.into(), direction.into())
}

/// Ranges start at 0: the crate knows no other.
impl SingleRays for TriMesh {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let found = CompositeShapeRef(self).cast_local_ray(&ray_of(ray), ray.t_max, false);
        found.map(|(triangle, t)| rust::hit(t, triangle))
    }

    /// The crate's own query for this is a closest hit, too.
    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}
