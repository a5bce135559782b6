//! Whitted's ray tracer: light straight from lights, mirrors and glass (T. Whitted, *An Improved Illumination Model for Shaded
//! Display*, 1980).
//!
//! Rays are asked in waves: all rays of a tile, then all rays to each light from what they met, then all that are mirrored or
//! refracted there. So those that are asked together are neighbours and go the same way.

use kd::Ray;
use kd::glam::Vec3;
use kd_scene::Material;

use crate::render::{RayCounts, Shot, Tile};
use crate::shadows::Shadows;
use crate::stage::ShownLight;
use crate::surface::SurfacePoint;
use crate::tracer::Tracer;

/// Paths that add less than this to any colour of a pixel end.
const LEAST_WEIGHT: f32 = 1.0 / 512.0;

/// What a ray adds to.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// The sample of the tile.
    sample: usize,
    weight: Vec3,
}

/// Rays that are asked together, and what they add to.
#[derive(Debug, Default)]
struct Wave {
    rays: Vec<Ray>,
    paths: Vec<Path>,
}

impl Wave {
    fn with_capacity(rays: usize) -> Self {
        Self {
            rays: Vec::with_capacity(rays),
            paths: Vec::with_capacity(rays),
        }
    }

    fn push(&mut self, ray: Ray, sample: usize, weight: Vec3) {
        if weight.max_element() >= LEAST_WEIGHT {
            self.rays.push(ray);
            self.paths.push(Path { sample, weight });
        }
    }

    fn len(&self) -> usize {
        self.rays.len()
    }

    /// Takes over those of another one.
    fn append(&mut self, mut other: Self) {
        self.rays.append(&mut other.rays);
        self.paths.append(&mut other.paths);
    }
}

/// What a ray of a wave meets.
#[derive(Debug)]
struct Seen<'a> {
    /// The number of the ray.
    number: usize,
    point: SurfacePoint<'a>,
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
    let mut wave = Wave::default();
    for (sample, place) in tile.samples(options).enumerate() {
        wave.push(shot.ray_through(place), sample, Vec3::ONE);
    }
    counts.primary += wave.rays.len() as u64;
    let mut colors = vec![Vec3::ZERO; wave.rays.len()];
    for bounce in 0..=options.bounces {
        if wave.rays.is_empty() {
            break;
        }
        let mut hits = vec![None; wave.rays.len()];
        tracer.intersect(&wave.rays, &mut hits);
        let mut points = Vec::with_capacity(hits.len());
        for (number, hit) in hits.iter().enumerate() {
            let path = wave.paths[number];
            let Some(hit) = hit else {
                colors[path.sample] += path.weight * stage.description().background;
                continue;
            };
            let ray = &wave.rays[number];
            if let Some(point) = SurfacePoint::new(stage, options.textures, ray, hit) {
                let ambient = stage.description().ambient * point.material.ambient;
                colors[path.sample] += path.weight * ambient * point.texture;
                points.push(Seen { number, point });
            }
        }
        for light in lights {
            light_up(*tracer, light, &wave, &points, &mut colors, &mut counts);
        }
        if bounce == options.bounces {
            break;
        }
        // Each kind by itself: neighbours of a kind go the same way.
        let mut mirrored = Wave::with_capacity(points.len());
        let mut refracted = Wave::default();
        for seen in &points {
            scatter(&wave, seen, &mut mirrored, &mut refracted);
        }
        counts.mirrored += mirrored.len() as u64;
        counts.refracted += refracted.len() as u64;
        mirrored.append(refracted);
        wave = mirrored;
    }
    (colors, counts)
}

/// Adds the light of one lamp at all points that see it.
fn light_up(
    tracer: &impl Tracer,
    light: &ShownLight,
    wave: &Wave,
    points: &[Seen<'_>],
    colors: &mut [Vec3],
    counts: &mut RayCounts,
) {
    let mut shadows = Shadows::with_capacity(points.len());
    for Seen { number, point } in points {
        let (ray, path) = (&wave.rays[*number], &wave.paths[*number]);
        let to_light = (light.position - point.at).normalize_or_zero();
        if to_light.dot(point.flat_normal) <= 0.0 {
            continue;
        }
        let color = phong(
            point.material,
            point.texture,
            point.normal,
            to_light,
            ray.direction,
        );
        let color = path.weight * light.color * color;
        if color.max_element() > 0.0 {
            shadows.push(point, light, path.sample, color);
        }
    }
    shadows.add(tracer, colors, counts);
}

/// How a surface gives back light (B. T. Phong, *Illumination for Computer Generated Pictures*, 1975).
fn phong(
    material: &Material,
    texture: Vec3,
    normal: Vec3,
    to_light: Vec3,
    seen_along: Vec3,
) -> Vec3 {
    let facing = normal.dot(to_light);
    if facing <= 0.0 {
        return Vec3::ZERO;
    }
    let dull = material.diffuse * texture * facing;
    let mirrored = to_light - 2.0 * facing * normal;
    let toward = mirrored.dot(seen_along.normalize_or_zero());
    if material.shine <= 0.0 || toward <= 0.0 {
        return dull;
    }
    dull + material.specular * toward.powf(material.shine)
}

/// The rays that go on from a point.
fn scatter(wave: &Wave, seen: &Seen<'_>, mirrored: &mut Wave, refracted: &mut Wave) {
    let Seen { number, point } = seen;
    let (ray, path) = (&wave.rays[*number], &wave.paths[*number]);
    let direction = ray.direction.normalize_or_zero();
    let material = point.material;
    let mut mirror = material.mirror;
    if material.transmittance > 0.0 {
        match bent(direction, point, material.refraction) {
            Some(direction) => {
                let weight = path.weight * material.transmittance;
                refracted.push(Ray::new(point.below(), direction), path.sample, weight);
            }
            // Nothing gets out: all of it is mirrored.
            None => mirror += material.transmittance,
        }
    }
    let back = direction - 2.0 * direction.dot(point.normal) * point.normal;
    // A smooth normal may mirror into the surface.
    if back.dot(point.flat_normal) > 0.0 {
        let weight = path.weight * mirror;
        mirrored.push(Ray::new(point.above(), back), path.sample, weight);
    }
}

/// Where light goes on behind a surface (Snell's law); nowhere if all of it is mirrored.
fn bent(direction: Vec3, point: &SurfacePoint<'_>, refraction: f32) -> Option<Vec3> {
    if refraction <= 0.0 || refraction == 1.0 {
        return Some(direction);
    }
    let ratio = if point.is_outside {
        1.0 / refraction
    } else {
        refraction
    };
    let cosine = -direction.dot(point.normal);
    let square = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
    (square >= 0.0).then(|| ratio * direction + (ratio * cosine - square.sqrt()) * point.normal)
}
