//! The crate `obvhs`: a binary and a compressed wide BVH, with the crate's own triangles in the order of the leaves, as in its
//! examples.

use std::convert::Infallible;
use std::time::Duration;

use kd_core::{Hit, Mesh, Ray};
use obvhs::BvhBuildParams;
use obvhs::bvh2::{Bvh2, builder::build_bvh2_from_tris};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::RayHit;
use obvhs::rt_triangle::RtTriangle;
use obvhs::triangle::Triangle;

use super::{Trace, unit};
use crate::{Built, ObvhsBuild, Options, RivalError};

/// A tree of the crate with the triangles of its leaves.
struct Obvhs<Tree> {
    tree: Tree,
    triangles: Vec<RtTriangle>,
    /// For each of these, its number in the mesh.
    numbers: Vec<u32>,
}

/// Builds with one of the crate's presets. The fastest one gives the binary tree, which builds fast; the others the wide one,
/// which traces fast.
pub(crate) fn build(build: ObvhsBuild, mesh: &Mesh, options: Options) -> Result<Built, RivalError> {
    let triangles = triangles_of(mesh);
    // The crate adds the time of its core to a sum; our time covers everything before the first ray.
    let core_time = || Duration::ZERO;
    let wide = |preset| {
        super::build(options, || {
            let tree = build_cwbvh_from_tris(&triangles, preset, &mut core_time());
            let numbers = tree.primitive_indices.clone();
            Ok::<_, Infallible>(Obvhs::new(tree, numbers, &triangles))
        })
    };
    match build {
        ObvhsBuild::Fastest => super::build(options, || {
            let preset = BvhBuildParams::fastest_build();
            let tree = build_bvh2_from_tris(&triangles, preset, &mut core_time());
            let numbers = tree.primitive_indices.clone();
            Ok::<_, Infallible>(Obvhs::new(tree, numbers, &triangles))
        }),
        ObvhsBuild::Medium => wide(BvhBuildParams::medium_build()),
        ObvhsBuild::Slow => wide(BvhBuildParams::slow_build()),
    }
}

fn triangles_of(mesh: &Mesh) -> Vec<Triangle> {
    let triangle = |corners: &[u32; 3]| {
        let [v0, v1, v2] = corners.map(|corner| mesh.positions()[corner as usize].into());
        Triangle { v0, v1, v2 }
    };
    mesh.triangles().iter().map(triangle).collect()
}

impl<Tree> Obvhs<Tree> {
    fn new(tree: Tree, numbers: Vec<u32>, triangles: &[Triangle]) -> Self {
        let in_leaf_order = numbers
            .iter()
            .map(|number| (&triangles[*number as usize]).into());
        Self {
            triangles: in_leaf_order.collect(),
            tree,
            numbers,
        }
    }

    fn hit(&self, found: &RayHit, length: f32) -> Option<Hit> {
        let place = (found.t < f32::INFINITY).then_some(found.primitive_id as usize)?;
        Some(super::hit(found.t / length, self.numbers[place]))
    }
}

/// The crate's ray, and the divisor of its `t`. The wide tree skips boxes nearer than a fixed `t`, which is right only for
/// directions of unit length.
#[inline]
fn ray_of(ray: &Ray) -> (obvhs::ray::Ray, f32) {
    let (direction, length) = unit(ray.direction);
    let (origin, direction) = (ray.origin.to_array(), direction.to_array());
    let (t_min, t_max) = (ray.t_min * length, ray.t_max * length);
    let unit = obvhs::ray::Ray::new(origin.into(), direction.into(), t_min, t_max);
    (unit, length)
}

/// Both trees have the same queries without a common trait.
macro_rules! trace_through {
    ($tree:ty) => {
        impl Trace for Obvhs<$tree> {
            #[inline]
            fn closest(&self, ray: &Ray) -> Option<Hit> {
                let mut found = RayHit::none();
                let (ray, length) = ray_of(ray);
                let test = |ray: &obvhs::ray::Ray, at: usize| self.triangles[at].intersect(ray);
                self.tree.ray_traverse(ray, &mut found, test);
                self.hit(&found, length)
            }

            #[inline]
            fn any(&self, ray: &Ray) -> bool {
                let (ray, _) = ray_of(ray);
                let test = |ray: &obvhs::ray::Ray, at: usize| self.triangles[at].intersect(ray);
                !self.tree.ray_traverse_miss(ray, test)
            }
        }
    };
}

trace_through!(Bvh2);
trace_through!(CwBvh);
