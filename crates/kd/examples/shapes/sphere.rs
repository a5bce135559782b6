//! Spheres as primitives.

use kd::custom::{PrimitiveHit, Primitives};
use kd::glam::Vec3;
use kd::{Aabb, Ray};

/// A sphere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sphere {
    /// Its center, in scene units.
    pub(crate) center: Vec3,
    /// Its radius, not below 0.
    pub(crate) radius: f32,
}

/// A list of spheres. Rays meet the surface from both sides.
#[derive(Clone, Debug)]
pub(crate) struct Spheres(
    /// By number.
    pub(crate) Vec<Sphere>,
);

impl Primitives for Spheres {
    fn count(&self) -> u32 {
        u32::try_from(self.0.len()).expect("32 bits number the spheres")
    }

    /// Rounded outwards: half a unit in the last place is more than a hit may be beside its box where coordinates are large.
    fn bounds(&self, sphere: u32) -> Aabb {
        let Sphere { center, radius } = self.0[sphere as usize];
        Aabb {
            min: (center - radius).map(f32::next_down),
            max: (center + radius).map(f32::next_up),
        }
    }

    #[inline]
    fn intersect(&self, sphere: u32, ray: &Ray) -> Option<PrimitiveHit> {
        let is_in_range = |t: &f32| ray.t_min <= *t && *t <= ray.t_max;
        let depths = self.0[sphere as usize].depths(ray)?;
        depths.into_iter().find(is_in_range).map(PrimitiveHit::at)
    }
}

impl Sphere {
    /// Where the line of a ray enters the sphere, and where it leaves it; `None` if it passes it.
    ///
    /// The distance of the line from the center is that of its nearest point, and of the two solutions of the quadratic equation the
    /// smaller one is the product of both over the larger one, so neither is a small difference of large numbers (E. Haines, J. Günther,
    /// T. Akenine-Möller, *Precision Improvements for Ray/Sphere Intersection*, Ray Tracing Gems, 2019). In f64, rounded once.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "rounded once")]
    pub(crate) fn depths(&self, ray: &Ray) -> Option<[f32; 2]> {
        let direction = ray.direction.as_dvec3();
        let from_center = ray.origin.as_dvec3() - self.center.as_dvec3();
        let radius = f64::from(self.radius);
        let a = direction.dot(direction);
        let b = -from_center.dot(direction);
        let nearest = from_center + b / a * direction;
        let rest = radius * radius - nearest.dot(nearest);
        // Also false for NaN.
        (rest >= 0.0).then(|| {
            let c = from_center.dot(from_center) - radius * radius;
            let q = b + (a * rest).sqrt().copysign(b);
            let [one, other] = [(c / q) as f32, (q / a) as f32];
            if one > other {
                [other, one]
            } else {
                [one, other]
            }
        })
    }
}
