//! Light that would reach points, if nothing were in the way.

use kd::Ray;
use kd::glam::Vec3;

use crate::render::RayCounts;
use crate::stage::ShownLight;
use crate::surface::SurfacePoint;
use crate::tracer::Tracer;

/// Rays to lights, which are asked together, and what each adds to which sample if it gets there.
#[derive(Debug)]
pub(crate) struct Shadows {
    rays: Vec<Ray>,
    lit: Vec<(usize, Vec3)>,
}

impl Shadows {
    pub(crate) fn with_capacity(rays: usize) -> Self {
        Self {
            rays: Vec::with_capacity(rays),
            lit: Vec::with_capacity(rays),
        }
    }

    pub(crate) fn push(
        &mut self,
        point: &SurfacePoint<'_>,
        light: &ShownLight,
        sample: usize,
        color: Vec3,
    ) {
        self.rays.push(Ray::between(point.above(), light.position));
        self.lit.push((sample, color));
    }

    /// Adds what gets there.
    pub(crate) fn add(self, tracer: &impl Tracer, colors: &mut [Vec3], counts: &mut RayCounts) {
        let mut occluded = vec![false; self.rays.len()];
        tracer.occluded(&self.rays, &mut occluded);
        counts.shadow += self.rays.len() as u64;
        for ((sample, color), occluded) in self.lit.into_iter().zip(occluded) {
            if !occluded {
                colors[sample] += color;
            }
        }
    }
}
