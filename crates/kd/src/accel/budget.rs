//! How many rays there will be.

use std::borrow::Cow;

use fastrand::Rng;
use glam::Vec3;
use kd_core::{Aabb, Ray};
use kd_select::{RayScheme, sample};

/// How many rays will be asked, about, and what they are like.
#[derive(Clone, Debug, PartialEq)]
pub struct RayBudget {
    rays: u64,
    sample: Vec<Ray>,
}

impl RayBudget {
    /// So many rays, that may come from anywhere and go anywhere: structures are tried on lines through two random points of the
    /// mesh's bounding sphere.
    pub const fn new(count: u64) -> Self {
        Self {
            rays: count,
            sample: Vec::new(),
        }
    }

    /// The same with rays like those to come, some hundreds or more in the order in which they will be asked: of a camera and its
    /// light, say, in whole rows. Structures are tried on a few at a time, from all over them. The better they stand for the others, the better the choice.
    #[must_use]
    pub fn with_sample(mut self, rays: impl Into<Vec<Ray>>) -> Self {
        self.sample = rays.into();
        self
    }

    pub(super) fn count(&self) -> u64 {
        self.rays
    }

    /// Which measurements tell most about them.
    pub(super) fn scheme(&self) -> RayScheme {
        if self.sample.is_empty() {
            RayScheme::Random
        } else {
            RayScheme::Path
        }
    }

    /// Rays to try a grid over a box with, not empty.
    pub(super) fn sample(&self, bounds: &Aabb) -> Cow<'_, [Ray]> {
        if !self.sample.is_empty() {
            return Cow::Borrowed(&self.sample);
        }
        let mut random = Rng::with_seed(2011);
        let (center, radius) = (bounds.center(), 0.5 * bounds.diagonal());
        let mut on_sphere = || center + radius * direction(&mut random);
        let lines = (0..sample::RAYS).map(|_| {
            let from = on_sphere();
            Ray::new(from, on_sphere() - from)
        });
        lines.collect()
    }
}

/// Uniform on the unit sphere (G. Marsaglia, *Choosing a Point from the Surface of a Sphere*, 1972).
fn direction(random: &mut Rng) -> Vec3 {
    loop {
        let (x, y) = (2.0 * random.f32() - 1.0, 2.0 * random.f32() - 1.0);
        let square = x * x + y * y;
        if square < 1.0 {
            let stretch = 2.0 * (1.0 - square).sqrt();
            return Vec3::new(x * stretch, y * stretch, 1.0 - 2.0 * square);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_those_that_were_given_or_meet_the_sphere() {
        let bounds = Aabb {
            min: Vec3::new(-1.0, 2.0, 3.0),
            max: Vec3::new(5.0, 4.0, 4.0),
        };
        let budget = RayBudget::new(7);
        let sample = budget.sample(&bounds);
        assert_eq!(sample, budget.sample(&bounds), "the same always");
        let radius = 0.5 * bounds.diagonal();
        for ray in &*sample {
            for end in [ray.origin, ray.origin + ray.direction] {
                let off = (end - bounds.center()).length() / radius - 1.0;
                assert!(off.abs() < 1e-5, "on the sphere: {ray:?}");
            }
        }
        let own: Vec<Ray> = sample[..100].to_vec();
        let given = budget.clone().with_sample(own.clone());
        assert_eq!(*given.sample(&bounds), own, "as they are");
        assert_eq!(
            (budget.scheme(), given.scheme()),
            (RayScheme::Random, RayScheme::Path)
        );
    }
}
