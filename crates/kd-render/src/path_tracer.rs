//! Path tracing of diffuse surfaces (J. Kajiya, *The Rendering Equation*, 1986).

use fastrand::Rng;
use kd::Ray;
use kd::glam::Vec3;

use crate::alpha::hits_at_random;
use crate::random::cosine_around;
use crate::render::{Bucket, RayCounts, RenderContext};
use crate::shadows::ShadowRays;
use crate::surface::SurfacePoint;
use crate::tracer::Tracer;

/// The state of one path from the camera.
struct Path {
    /// Index of the sample in the bucket.
    sample: usize,
    /// Product of the reflectances so far.
    weight: Vec3,
    random: Rng,
}

/// The color of each sample of a bucket, and the number of rays traced.
pub(crate) fn trace(
    context: &RenderContext<'_, impl Tracer>,
    bucket: &Bucket,
) -> (Vec<Vec3>, RayCounts) {
    let RenderContext {
        stage,
        options,
        lights,
        ..
    } = context;
    let mut counts = RayCounts::default();
    let mut rays = Vec::new();
    let mut paths = Vec::new();
    for (sample, position) in bucket.samples(options).enumerate() {
        rays.push(context.ray_through(position));
        // The seed depends on the image position only, so that threads cannot change the picture.
        let [x, y] = position.map(f32::to_bits);
        let seed = u64::from(x) << 32 | u64::from(y);
        paths.push(Path {
            sample,
            weight: Vec3::ONE,
            random: Rng::with_seed(seed),
        });
    }
    counts.primary += rays.len() as u64;
    let mut colors = vec![Vec3::ZERO; rays.len()];
    for bounce in 0..=options.bounces {
        let hits = hits_at_random(context, &rays, |ray| paths[ray].random.f32());
        let mut shadow_rays = ShadowRays::with_capacity(rays.len());
        let (mut next_rays, mut next_paths) = (Vec::new(), Vec::new());
        for ((ray, mut path), hit) in rays.iter().zip(paths).zip(&hits) {
            let Some(hit) = hit else {
                colors[path.sample] += path.weight * stage.description().background;
                continue;
            };
            let Some(point) = SurfacePoint::new(stage, options.textures, ray, hit) else {
                continue;
            };
            // Mirrors and glass are treated as diffuse surfaces of the same reflectance.
            let material = point.material;
            let reflectance = (material.diffuse * point.texture + material.mirror).min(Vec3::ONE);
            colors[path.sample] += path.weight * material.emission;
            let weight = path.weight * reflectance;
            if !lights.is_empty() {
                // One light, chosen at random, represents all of them.
                let light = &lights[path.random.usize(..lights.len())];
                let (to_light, arriving) = light.seen_from(point.at);
                let facing = to_light.dot(point.normal);
                if facing > 0.0 && to_light.dot(point.flat_normal) > 0.0 {
                    let color = weight * arriving * facing * lights.len() as f32;
                    shadow_rays.push(&point, light, path.sample, color);
                }
            }
            if bounce < options.bounces {
                let direction = cosine_around(point.normal, &mut path.random);
                if direction.dot(point.flat_normal) > 0.0 {
                    next_rays.push(Ray::new(point.above(), direction));
                    next_paths.push(Path { weight, ..path });
                }
            }
        }
        shadow_rays.add(context, &mut colors, &mut counts);
        (rays, paths) = (next_rays, next_paths);
        counts.diffuse += rays.len() as u64;
    }
    (colors, counts)
}
