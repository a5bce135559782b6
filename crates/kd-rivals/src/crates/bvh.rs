//! The crate `bvh`, which returns candidates: with a triangle test of our own, and for closest hits its traversal that gives
//! near candidates first, ended at the first one behind the best hit.

use std::convert::Infallible;

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::{BHShape, BoundingHierarchy as _};
use bvh::bvh::Bvh;
use glam::Vec3;
use kd_core::{Hit, Mesh, Ray};

use super::Trace;
use crate::{Built, Options, RivalError};

/// A triangle in the form of the test.
#[derive(Clone, Debug)]
struct Shape {
    corner: Vec3,
    edges: [Vec3; 2],
    bounds: Aabb<f32, 3>,
    number: u32,
    /// The crate's index of its node.
    node: usize,
}

struct Tree {
    bvh: Bvh<f32, 3>,
    shapes: Vec<Shape>,
}

/// Builds, on several threads by the crate's parallel build.
pub(crate) fn build(mesh: &Mesh, options: Options) -> Result<Built, RivalError> {
    let numbers = (0..).take(mesh.len());
    let mut shapes: Vec<Shape> = numbers.map(|number| Shape::new(mesh, number)).collect();
    super::build(options, move || {
        let bvh = if options.threads > 1 {
            Bvh::build_par(&mut shapes)
        } else {
            Bvh::build(&mut shapes)
        };
        Ok::<_, Infallible>(Tree { bvh, shapes })
    })
}

impl Shape {
    fn new(mesh: &Mesh, number: u32) -> Self {
        let [a, b, c] = mesh.corners(number);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        Self {
            corner: a,
            edges: [b - a, c - a],
            bounds: Aabb::with_bounds(low.to_array().into(), high.to_array().into()),
            number,
            node: 0,
        }
    }

    /// The distance at which the ray meets the triangle, from either side (T. Möller and B. Trumbore: *Fast, Minimum Storage
    /// Ray/Triangle Intersection*, 1997).
    #[inline]
    fn distance(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        let across = ray.direction.cross(self.edges[1]);
        let scale = self.edges[0].dot(across).recip();
        let from_corner = ray.origin - self.corner;
        let u = from_corner.dot(across) * scale;
        let over = from_corner.cross(self.edges[0]);
        let v = ray.direction.dot(over) * scale;
        let t = self.edges[1].dot(over) * scale;
        // A NaN is in no range.
        let is_inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        (is_inside && t >= ray.t_min && t <= t_max).then_some(t)
    }
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        self.bounds
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

fn ray_of(ray: &Ray) -> bvh::ray::Ray<f32, 3> {
    let (origin, direction) = (ray.origin.to_array(), ray.direction.to_array());
    bvh::ray::Ray::new(origin.into(), direction.into())
}

impl Trace for Tree {
    #[inline]
    fn closest(&self, ray: &Ray) -> Option<Hit> {
        let line = ray_of(ray);
        // The crate's rays have unit length.
        let length = ray.direction.length();
        let mut best: Option<Hit> = None;
        for shape in self.bvh.nearest_traverse_iterator(&line, &self.shapes) {
            let t_max = best.map_or(ray.t_max, |hit| hit.t);
            let entry = line.intersection_slice_for_aabb(&shape.bounds);
            if entry.is_some_and(|(entry, _)| entry > t_max * length) {
                break;
            }
            if let Some(t) = shape.distance(ray, t_max) {
                best = Some(super::hit(t, shape.number));
            }
        }
        best
    }

    #[inline]
    fn any(&self, ray: &Ray) -> bool {
        let line = ray_of(ray);
        let mut candidates = self.bvh.traverse_iterator(&line, &self.shapes);
        candidates.any(|shape| shape.distance(ray, ray.t_max).is_some())
    }
}
