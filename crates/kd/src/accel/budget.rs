//! The expected number of rays.

use std::borrow::Cow;

use fastrand::Rng;
use glam::Vec3;
use kd_core::{Aabb, Ray};
use kd_select::{RayScheme, sample};

/// The expected number of rays, and optionally a sample of them.
#[derive(Clone, Debug, PartialEq)]
pub struct RayBudget {
    count: u64,
    sample: Vec<Ray>,
}

impl RayBudget {
    /// `count` rays of unknown distribution: a grid is tried on lines through two random points of the mesh's bounding sphere.
    pub const fn new(count: u64) -> Self {
        Self {
            count,
            sample: Vec::new(),
        }
    }

    /// The same number of rays, with a sample of them: some hundreds or more, in the order in which they will be traced, for example
    /// whole rows of a camera and their shadow rays. A grid is tried on short runs from all over the sample. The better the sample
    /// represents the rays, the better the choice.
    #[must_use]
    pub fn with_sample(mut self, rays: impl Into<Vec<Ray>>) -> Self {
        self.sample = rays.into();
        self
    }

    /// The expected number of rays.
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The measurements that are closest to these rays.
    pub(super) fn scheme(&self) -> RayScheme {
        if self.sample.is_empty() {
            RayScheme::Random
        } else {
            RayScheme::Path
        }
    }

    /// Rays for the trial of a grid over a box; at least one.
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
    fn samples_are_given_or_meet_the_sphere() {
        let bounds = Aabb {
            min: Vec3::new(-1.0, 2.0, 3.0),
            max: Vec3::new(5.0, 4.0, 4.0),
        };
        let budget = RayBudget::new(7);
        let sample = budget.sample(&bounds);
        assert_eq!(sample, budget.sample(&bounds), "the same each time");
        let radius = 0.5 * bounds.diagonal();
        for ray in &*sample {
            for end in [ray.origin, ray.origin + ray.direction] {
                let off = (end - bounds.center()).length() / radius - 1.0;
                assert!(off.abs() < 1e-5, "on the sphere: {ray:?}");
            }
        }
        let own: Vec<Ray> = sample[..100].to_vec();
        let given = budget.clone().with_sample(own.clone());
        assert_eq!(*given.sample(&bounds), own, "unchanged");
        assert_eq!(
            (budget.scheme(), given.scheme()),
            (RayScheme::Random, RayScheme::Path)
        );
    }
}
