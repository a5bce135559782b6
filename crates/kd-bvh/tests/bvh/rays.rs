//! Rays that ask for trouble.

use glam::Vec3;
use kd_bvh::BvhNode;
use kd_core::{Aabb, Mesh, Ray};

use crate::check::Subject;
use crate::rng::Rng;

/// Makes rays around a mesh and the boxes of hierarchies over it.
pub(crate) struct Rays<'a> {
    mesh: &'a Mesh,
    boxes: Vec<Aabb>,
    pub(crate) rng: Rng,
}

impl<'a> Rays<'a> {
    pub(crate) fn new(mesh: &'a Mesh, subjects: &[Subject], seed: u64) -> Self {
        let nodes = subjects.iter().flat_map(|subject| subject.bvh.nodes());
        Self {
            mesh,
            boxes: nodes.map(BvhNode::bounds).collect(),
            rng: Rng(seed),
        }
    }

    /// A point on a triangle: inside, on an edge, or a corner.
    fn target(&mut self) -> Vec3 {
        let triangle = u32::try_from(self.rng.below(self.mesh.len())).expect("few");
        let [a, b, c] = self.mesh.corners(triangle);
        match self.rng.below(6) {
            0 => a,
            1 => a.midpoint(b),
            2 => a.lerp(b, self.rng.unit()),
            _ => a.lerp(b, self.rng.unit()).lerp(c, self.rng.unit()),
        }
    }

    /// A point in the box of the mesh, or a little around it.
    fn somewhere(&mut self) -> Vec3 {
        let bounds = self.mesh.bounds();
        bounds.center() + 0.7 * self.rng.vec3() * bounds.extent().max_element()
    }

    /// The point, moved on some axes to a face of a node's box.
    fn on_faces(&mut self, mut point: Vec3) -> Vec3 {
        let bounds = self.rng.pick(&self.boxes);
        for _ in 0..=self.rng.below(3) {
            let axis = self.rng.below(3);
            point[axis] = self.rng.pick(&[bounds.min, bounds.max])[axis];
        }
        point
    }

    pub(crate) fn next(&mut self) -> Ray {
        let (origin, target) = (self.somewhere(), self.target());
        let ray = Ray::new(origin, target - origin);
        match self.rng.below(12) {
            0..=2 => ray,
            3 => Ray::new(origin, self.somewhere() - origin),
            // From a face of a box, or a corner of one.
            4 => {
                let origin = self.on_faces(origin);
                Ray::new(origin, target - origin)
            }
            // Along an axis, with zeros of both signs, often in a face.
            5 | 6 => {
                let axis = self.rng.below(3);
                let mut origin = self.rng.pick(&[target, origin]);
                if self.rng.below(2) == 0 {
                    origin = self.on_faces(origin);
                }
                origin[axis] = self.somewhere()[axis];
                let mut direction = self.rng.pick(&[Vec3::ZERO, -Vec3::ZERO]);
                direction[axis] = self.rng.pick(&[1.0, -1.0, 1e-20, -3e20]);
                Ray::new(origin, direction)
            }
            // In a face, or nearly so.
            7 => {
                let origin = self.on_faces(target);
                let mut direction = target - self.somewhere();
                direction[self.rng.below(3)] = self.rng.pick(&[0.0, -0.0, 1e-38, -1e-30, 1e-12]);
                Ray::new(origin - direction * self.rng.unit(), direction)
            }
            // From far away.
            8 => {
                let distance = self.rng.pick(&[1e2, 1e4, 1e7]);
                let origin = target + distance * (origin - target);
                Ray::new(origin, target - origin)
            }
            // From a surface to another.
            9 => {
                let origin = self.target();
                Ray::new(origin, target - origin)
            }
            // Backwards.
            10 => Ray::new(origin, origin - target).with_range(f32::NEG_INFINITY, 0.5),
            // Very short and very long directions.
            _ => {
                let factor = self.rng.pick(&[1e-38, 1e-20, 1e-6, 1e20, 1e36]);
                Ray::new(origin, (target - origin) * factor)
            }
        }
    }

    /// The same ray with a range that ends exactly at a `t`, or just before or behind.
    pub(crate) fn ending_at(&mut self, ray: &Ray, t: f32) -> Ray {
        match self.rng.below(5) {
            0 => ray.with_range(t, t),
            1 => ray.with_range(t, ray.t_max),
            2 => ray.with_range(ray.t_min, t),
            3 => ray.with_range(t.next_up(), f32::INFINITY),
            _ => ray.with_range(ray.t_min, t.next_down()),
        }
    }
}

/// Rays that hit nothing, whatever there is.
pub(crate) fn bad() -> Vec<Ray> {
    let good = Ray::new([0.1, 0.2, 0.3], [0.0, 0.0, 1.0]);
    let (nan, infinity) = (f32::NAN, f32::INFINITY);
    vec![
        Ray::new([nan, 0.0, 0.0], [0.0, 0.0, 1.0]),
        Ray::new([0.0, infinity, 0.0], [0.0, 0.0, 1.0]),
        Ray::new([0.0; 3], [0.0, nan, 1.0]),
        Ray::new([0.0; 3], [0.0, -infinity, 1.0]),
        Ray::new([0.0; 3], [0.0, -0.0, 0.0]),
        good.with_range(nan, 2.0),
        good.with_range(0.0, nan),
        good.with_range(2.0, 0.0),
        good.with_range(infinity, infinity),
        good.with_range(-infinity, -infinity),
        good.with_mask(0),
    ]
}
