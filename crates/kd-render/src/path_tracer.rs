//! Light that dull surfaces scatter, followed by chance (J. Kajiya, *The Rendering Equation*, 1986).

use fastrand::Rng;
use kd::Ray;
use kd::glam::Vec3;
use kd_scene::View;

use crate::random::cosine_around;
use crate::render::{RayCounts, RenderOptions, Tile};
use crate::stage::Stage;
use crate::surface::SurfacePoint;
use crate::tracer::Tracer;

/// A way that light came.
struct Path {
    sample: usize,
    weight: Vec3,
    random: Rng,
}

/// What is seen by each sample of a tile.
pub(crate) fn trace(
    stage: &Stage,
    tracer: &impl Tracer,
    options: &RenderOptions,
    view: &View,
    tile: &Tile,
) -> (Vec<Vec3>, RayCounts) {
    let lights = stage.lights(options.lights);
    let mut counts = RayCounts::default();
    let mut rays = Vec::new();
    let mut paths = Vec::new();
    for (sample, [x, y]) in tile.samples(options).enumerate() {
        rays.push(Ray::new(view.eye, view.direction(x, y)));
        // A sequence of its own for each place of the picture.
        let seed = u64::from(x.to_bits()) << 32 | u64::from(y.to_bits());
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
        let (mut shadows, mut lit) = (Vec::new(), Vec::new());
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
                    shadows.push(Ray::between(point.above(), light.position));
                    lit.push((
                        path.sample,
                        weight * light.color * facing * lights.len() as f32,
                    ));
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
        let mut occluded = vec![false; shadows.len()];
        tracer.occluded(&shadows, &mut occluded);
        counts.shadow += shadows.len() as u64;
        for ((sample, color), occluded) in lit.into_iter().zip(occluded) {
            if !occluded {
                colors[sample] += color;
            }
        }
        (rays, paths) = (next_rays, next_paths);
        counts.diffuse += rays.len() as u64;
    }
    (colors, counts)
}
