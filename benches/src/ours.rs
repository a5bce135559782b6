//! Our structures that are no kd-trees, in the form that the bench measures.

mod bvh;
mod comparators;
mod grid;

use kd::{Hit, Ray};
use kd_trace::RayQuery;

use crate::record::Steps;
use crate::structure::{Shape, Structure};

pub(crate) use bvh::build as bvh;
pub(crate) use comparators::{bsp, octree};
pub(crate) use grid::build as grid;

/// A structure over one mesh, with its statistics.
trait Ours: RayQuery<Hit = Hit> + Send + Sync {
    fn shape(&self) -> Shape;
}

/// The structure, traced ray by ray.
struct Single<T>(T);

impl<T: Ours> Structure for Single<T> {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.0.intersect(ray);
        }
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.0.occluded(ray);
        }
    }

    fn counted(&self, _: &Ray) -> Option<(Option<Hit>, Steps)> {
        None
    }

    fn shape(&self) -> Shape {
        self.0.shape()
    }

    fn flaw(&self) -> Option<String> {
        None
    }
}
