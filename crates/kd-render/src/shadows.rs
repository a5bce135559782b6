//! Shadow rays, traced as one batch.

use kd::Ray;
use kd::glam::Vec3;

use crate::alpha::light_through;
use crate::light::ShownLight;
use crate::render::{RayCounts, RenderContext};
use crate::surface::SurfacePoint;
use crate::tracer::Tracer;

/// Rays from surface points to lights, with the contribution of each if it is not occluded.
#[derive(Debug)]
pub(crate) struct ShadowRays {
    rays: Vec<Ray>,
    /// For each ray, the sample and the color to add to it.
    contributions: Vec<(usize, Vec3)>,
}

impl ShadowRays {
    pub(crate) fn with_capacity(rays: usize) -> Self {
        Self {
            rays: Vec::with_capacity(rays),
            contributions: Vec::with_capacity(rays),
        }
    }

    pub(crate) fn push(
        &mut self,
        point: &SurfacePoint<'_>,
        light: &ShownLight,
        sample: usize,
        color: Vec3,
    ) {
        self.rays.push(light.shadow_ray(point.above()));
        self.contributions.push((sample, color));
    }

    /// Traces all rays, and adds the contributions of those that reach their light.
    pub(crate) fn add(
        self,
        context: &RenderContext<'_, impl Tracer>,
        colors: &mut [Vec3],
        counts: &mut RayCounts,
    ) {
        let shares = light_through(context, &self.rays);
        counts.shadow += self.rays.len() as u64;
        for ((sample, color), share) in self.contributions.into_iter().zip(shares) {
            if share > 0.0 {
                colors[sample] += share * color;
            }
        }
    }
}
