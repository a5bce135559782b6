//! The crate `parry3d`: its triangle mesh, which has a BVH inside.

use kd_core::{Hit, Mesh, Ray};
use parry3d::shape::{CompositeShapeRef, TriMesh};

use super::Trace;
use crate::{Built, Options, PointQueries, RivalError};

/// Builds on one thread for any number of threads: the crate has no parallel build.
pub(crate) fn build(mesh: &Mesh, options: Options) -> Result<Built, RivalError> {
    let positions = mesh.positions().iter().map(|at| (*at).into()).collect();
    let triangles = mesh.triangles().to_vec();
    super::build(options, || TriMesh::new(positions, triangles).map(Parry))
}

/// A mesh for closest points.
pub(crate) fn points(mesh: &Mesh) -> Result<Box<dyn PointQueries>, RivalError> {
    let positions = mesh.positions().iter().map(|at| (*at).into()).collect();
    let built = TriMesh::new(positions, mesh.triangles().to_vec());
    Ok(Box::new(Parry(built.map_err(super::failed)?)))
}

impl PointQueries for Parry {
    fn distances(&self, points: &[[f32; 3]], out: &mut [f32]) {
        let mesh = CompositeShapeRef(&self.0);
        for (point, distance) in points.iter().zip(out) {
            let point = (*point).into();
            let found = mesh.project_local_point(point, f32::MAX, false);
            *distance = found.map_or(f32::INFINITY, |(_, at)| at.point.distance(point));
        }
    }
}

/// The ray from `t_min` on: the crate's ranges start at 0.
fn ray_of(ray: &Ray) -> parry3d::query::Ray {
    let start = ray.at(ray.t_min);
    let (origin, direction) = (start.to_array(), ray.direction.to_array());
    parry3d::query::Ray::new(origin.into(), direction.into())
}

/// The mesh of the crate. (Neither the trait nor the type is ours, hence a type of our own.)
struct Parry(TriMesh);

impl Trace for Parry {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let length = ray.t_max - ray.t_min;
        let found = CompositeShapeRef(&self.0).cast_local_ray(&ray_of(ray), length, false);
        found.map(|(triangle, t)| super::hit(ray.t_min + t, triangle))
    }

    /// The crate's own query for this is a closest hit, too.
    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}
