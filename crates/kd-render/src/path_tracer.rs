//! Light that dull surfaces scatter, followed by chance (J. Kajiya, *The Rendering Equation*, 1986).

use fastrand::Rng;
use kd::Ray;
use kd::glam::Vec3;

use crate::random::cosine_around;
use crate::render::{RayCounts, Shot, Tile};
use crate::shadows::Shadows;
use crate::surface::SurfacePoint;
use crate::tracer::Tracer;

/// A way that light came.
struct Path {
    sample: usize,
    weight: Vec3,
    random: Rng,
}

/// What is seen by each sample of a tile.
pub(crate) fn trace(shot: &Shot<'_, impl Tracer>, tile: &Tile) -> (Vec<Vec3>, RayCounts) {
    let Shot {
        stage,
        tracer,
        options,
        lights,
        ..
    } = shot;
    let mut counts = RayCounts::default();
    let mut rays = Vec::new();
    let mut paths = Vec::new();
    for (sample, place) in tile.samples(options).enumerate() {
        rays.push(shot.ray_through(place));
        // A sequence of its own for each place of the picture.
        let [x, y] = place.map(f32::to_bits);
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
        let mut hits = vec![None; rays.len()];
        tracer.intersect(&rays, &mut hits);
        let mut shadows = Shadows::with_capacity(rays.len());
        let (mut next_rays, mut next_paths) = (Vec::new(), Vec::new());
        for ((ray, mut path), hit) in rays.iter().zip(paths).zip(&hits) {
            let Some(hit) = hit else {
                colors[path.sample] += path.weight * stage.description().background;
                continue;
            };
            let Some(point) = SurfacePoint::new(stage, options.textures, ray, hit) else {
                continue;
            };
            // Mirrors and glass give back what they can as dull surfaces.
            let material = point.material;
            let reflectance = (material.diffuse * point.texture + material.mirror).min(Vec3::ONE);
            let weight = path.weight * reflectance;
            if !lights.is_empty() {
                // One light stands for all.
                let light = &lights[path.random.usize(..lights.len())];
                let to_light = (light.position - point.at).normalize_or_zero();
                let facing = to_light.dot(point.normal);
                if facing > 0.0 && to_light.dot(point.flat_normal) > 0.0 {
                    let color = weight * light.color * facing * lights.len() as f32;
                    shadows.push(&point, light, path.sample, color);
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
        shadows.add(*tracer, &mut colors, &mut counts);
        (rays, paths) = (next_rays, next_paths);
        counts.diffuse += rays.len() as u64;
    }
    (colors, counts)
}
