//! How near hits come to the bound of planes, by a search for those far beside their triangle's box.

use kd_oracle::rng::Rng;

use super::*;
use crate::search::{self, vary};
use crate::triangle::TriangleTest;

/// A ray and a triangle.
#[derive(Clone, Copy, Debug)]
struct Case {
    ray: Ray,
    corners: [Vec3; 3],
}

impl Case {
    /// How far the hit is outside of the triangle's box, over the part of the bound that depends on the box alone: 0 if there is no
    /// hit, or if that is not most of the bound.
    fn share(&self) -> f64 {
        let Self { ray, corners } = self;
        let test = TriangleTest::new(ray, f32::INFINITY);
        let Some(hit) = test.decide(*corners, 0) else {
            return 0.0;
        };
        let bounds = Aabb::around(*corners);
        let frame = Frame::new(&bounds);
        let planes = RayPlanes::new(ray, &frame);
        let at_hit = ray.with_range(hit.t, hit.t);
        assert!(planes.clip(&at_hit, &bounds).is_some(), "{self:?}");
        let mut share = 0.0_f64;
        for axis in 0..3 {
            let AxisPlanes { inverse, pad, .. } = planes.axes[axis];
            let place =
                f64::from(ray.origin[axis]) + f64::from(hit.t) * f64::from(ray.direction[axis]);
            let below = f64::from(bounds.min[axis]) - place;
            let above = place - f64::from(bounds.max[axis]);
            if frame.distance > 0.8 * pad / inverse.abs() {
                share = share.max(below.max(above) * f64::from(inverse.abs()) / f64::from(pad));
            }
        }
        share
    }

    /// A ray to an edge of a triangle that is thin along one axis, from a place near the edge.
    fn random(size: Vec3, rng: &mut Rng) -> Self {
        let corners = [size * rng.vec3(), size * rng.vec3(), size * rng.vec3()];
        let on_edge = corners[0].lerp(corners[1], rng.unit());
        let slope = 0.999 * rng.vec3();
        let direction = rng.pick(&[0.5, 1.0]) * Vec3::new(slope.x, slope.y, 1.0);
        let distance = rng.pick(&[1e-5, 1e-3]) * rng.unit();
        Self {
            ray: Ray::new(on_edge - distance * direction, direction)
                .with_range(f32::NEG_INFINITY, f32::INFINITY),
            corners,
        }
    }

    /// The same but for a few numbers.
    fn varied(mut self, rng: &mut Rng) -> Self {
        for _ in 0..=rng.below(3) {
            let axis = rng.below(3);
            match rng.below(3) {
                0 => {
                    let size = each(self.corners, |corner| corner[axis].abs());
                    let corner = rng.below(3);
                    vary(&mut self.corners[corner][axis], size[corner], rng);
                }
                1 => vary(&mut self.ray.origin[axis], 1e-7, rng),
                _ => vary(&mut self.ray.direction[axis], 0.1, rng),
            }
        }
        self
    }
}

#[test]
fn hits_are_found_beside_boxes() {
    for thin in [0.0, 1e-5, 1e-3] {
        let share = search::largest(
            |rng| Case::random(Vec3::new(thin, 0.0, 1.0), rng),
            Case::varied,
            Case::share,
        );
        assert!(share > 1.0 / 16.0, "{thin}: {share}");
    }
}
