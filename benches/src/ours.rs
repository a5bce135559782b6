//! Structures of ours that are no kd-trees, as the bench asks them.

mod bvh;
mod comparators;
mod grid;

use std::sync::Arc;

use kd::{Hit, Mesh, Ray};

use crate::record::Steps;
use crate::structure::{Shape, Structure};

pub(crate) use bvh::build as bvh;
pub(crate) use comparators::{bsp, octree};
pub(crate) use grid::build as grid;

/// What takes the mesh with each query.
trait OverMesh: Send + Sync {
    fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit>;
    fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool;
    fn shape(&self, mesh: &Mesh) -> Shape;
}

/// It, with its mesh.
struct WithMesh<T> {
    structure: T,
    mesh: Arc<Mesh>,
}

impl<T: OverMesh> Structure for WithMesh<T> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.structure.intersect(&self.mesh, ray);
        }
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.structure.occluded(&self.mesh, ray);
        }
    }

    fn counted(&self, _: &Ray) -> Option<(Option<Hit>, Steps)> {
        None
    }

    fn shape(&self) -> Shape {
        self.structure.shape(&self.mesh)
    }

    fn flaw(&self) -> Option<String> {
        None
    }
}
