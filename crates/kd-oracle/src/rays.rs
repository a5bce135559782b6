//! Hard rays.

use glam::Vec3;
use kd_core::{Mesh, Ray};

use crate::rng::Rng;

/// A source of rays around a mesh and the planes of structures over it.
#[derive(Debug)]
pub struct Rays<'a> {
    mesh: &'a Mesh,
    /// Axis and position.
    planes: Vec<(usize, f32)>,
    rng: Rng,
}

impl<'a> Rays<'a> {
    /// Rays around a mesh of at least one triangle. `planes` are axis and position of planes of structures over it: some rays begin
    /// or run in them.
    pub fn new(mesh: &'a Mesh, planes: Vec<(usize, f32)>, seed: u64) -> Self {
        Self {
            mesh,
            planes,
            rng: Rng(seed),
        }
    }

    /// A point on a triangle: inside, on an edge or on a corner.
    fn target(&mut self) -> Vec3 {
        let triangle = u32::try_from(self.rng.below(self.mesh.len())).expect("small");
        let [a, b, c] = self.mesh.corners(triangle);
        match self.rng.below(8) {
            0 => a,
            1 => a.midpoint(b),
            2 => a.lerp(b, self.rng.unit()),
            _ => {
                let (u, v) = (self.rng.unit(), self.rng.unit());
                let (u, v) = if u + v > 1.0 {
                    (1.0 - u, 1.0 - v)
                } else {
                    (u, v)
                };
                a + (b - a) * u + (c - a) * v
            }
        }
    }

    /// A point in the plane of a triangle, up to rounding, mostly outside of the triangle.
    fn in_a_plane(&mut self) -> Vec3 {
        let triangle = u32::try_from(self.rng.below(self.mesh.len())).expect("small");
        let [a, b, c] = self.mesh.corners(triangle);
        a + (b - a) * self.rng.between(-2.0, 2.0) + (c - a) * self.rng.between(-2.0, 2.0)
    }

    /// A point in the box or a little around it.
    fn somewhere(&mut self) -> Vec3 {
        let bounds = self.mesh.bounds();
        bounds.center() + self.rng.vec3() * self.size()
    }

    /// The longest side of the box. (The square of a diagonal may overflow.)
    fn size(&self) -> f32 {
        self.mesh.bounds().extent().max_element()
    }

    /// Moves a point exactly to planes of structures, on some axes.
    fn on_planes(&mut self, mut point: Vec3) -> Vec3 {
        if !self.planes.is_empty() {
            for _ in 0..=self.rng.below(3) {
                let (axis, split) = self.rng.pick(&self.planes);
                point[axis] = split;
            }
        }
        point
    }

    /// The next ray, of one of fifteen kinds. Most rays hit something.
    pub fn draw(&mut self) -> Ray {
        let target = self.target();
        let origin = self.somewhere();
        let ray = match self.rng.below(15) {
            0..=2 => Ray::new(origin, target - origin),
            3 => Ray::new(origin, self.somewhere() - origin),
            4 => {
                let origin = self.on_planes(origin);
                Ray::new(origin, target - origin)
            }
            // From a surface to another.
            5 => {
                let origin = self.target();
                Ray::new(origin, target - origin)
            }
            // Along an axis, aimed exactly.
            6 | 7 => {
                let axis = self.rng.below(3);
                let mut origin = if self.rng.chance(0.5) {
                    target
                } else {
                    self.on_planes(target)
                };
                origin[axis] = self.somewhere()[axis];
                let mut direction = self.rng.pick(&[Vec3::ZERO, -Vec3::ZERO]);
                direction[axis] = self.rng.pick(&[1.0, -1.0, 1e-20, -3e20]);
                Ray::new(origin, direction)
            }
            // In a plane of a structure, or nearly so.
            8 => {
                let origin = self.on_planes(target);
                let mut direction = target - self.somewhere();
                direction[self.rng.below(3)] =
                    self.rng.pick(&[0.0, -0.0, 1e-30, -1e-38, 1e-12, 1e-42]);
                Ray::new(origin - direction * self.rng.between(-1.0, 2.0), direction)
            }
            // From far away.
            9 => {
                let distance = self.rng.pick(&[1e2, 1e4, 1e7]) * self.size();
                let origin = target + distance * self.rng.direction();
                Ray::new(origin, target - origin)
            }
            // Along an edge.
            10 => {
                let triangle = u32::try_from(self.rng.below(self.mesh.len())).expect("small");
                let [a, b, c] = self.mesh.corners(triangle);
                let direction = self
                    .rng
                    .pick(&[b - a, c - b, 0.3 * (b - a) + 0.2 * (c - a)]);
                Ray::new(a - direction * self.rng.between(-0.5, 2.0), direction)
            }
            // Backwards.
            11 => Ray::new(origin, origin - target).with_range(f32::NEG_INFINITY, 0.5),
            // A short segment that ends on the surface, just before it or behind it.
            12 => Ray::new(origin, target - origin)
                .with_range(self.rng.between(-1.0, 1.0), self.rng.between(0.99, 1.01)),
            // From a triangle's plane, or along it.
            13 => {
                let origin = self.in_a_plane();
                let towards = if self.rng.chance(0.5) {
                    target
                } else {
                    self.in_a_plane()
                };
                Ray::new(origin, towards - origin)
            }
            _ => {
                let direction =
                    (target - origin) * self.rng.pick(&[1e-20, 1e-38, 1e20, 1e36, 1e-6]);
                Ray::new(origin, direction)
            }
        };
        if self.rng.chance(0.2) {
            self.exactly_at_a_hit(ray)
        } else {
            ray
        }
    }

    /// Moves one end of the range, or both, to the `t` of one of the ray's hits.
    fn exactly_at_a_hit(&mut self, ray: Ray) -> Ray {
        let mut hits = Vec::new();
        kd_trace::brute_force::hits(self.mesh, &ray, usize::MAX, &mut hits);
        if hits.is_empty() {
            return ray;
        }
        let t = self.rng.pick(&hits).t;
        match self.rng.below(5) {
            0 => ray.with_range(t, t),
            1 => ray.with_range(t, ray.t_max),
            2 => ray.with_range(ray.t_min, t),
            3 => ray.with_range(t.next_up(), f32::INFINITY),
            _ => ray.with_range(ray.t_min, t.next_down()),
        }
    }
}

/// Rays that hit nothing in any mesh: not finite, without a direction, a range or a mask.
pub fn that_cannot_hit() -> Vec<Ray> {
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
