//! Whitted ray tracing: direct light, mirrors and glass (T. Whitted, *An Improved Illumination Model for Shaded Display*,
//! 1980).
//!
//! Rays are traced in waves: all primary rays of a bucket, then all shadow rays to each light, then all reflected and refracted
//! rays. The rays of a batch are therefore mostly coherent.

use kd::Ray;
use kd::glam::Vec3;
use kd_scene::Material;

use crate::alpha::Seen;
use crate::light::ShownLight;
use crate::render::{Bucket, RayCounts, RenderContext};
use crate::shadows::ShadowRays;
use crate::surface::SurfacePoint;
use crate::tracer::{PartHit, Tracer};

/// A path ends when its weight is below this in every color channel.
const MIN_WEIGHT: f32 = 1.0 / 512.0;

/// The contribution of a ray to its sample.
#[derive(Clone, Copy, Debug)]
struct Path {
    /// Index of the sample in the bucket.
    sample: usize,
    /// Factor on the color that the ray finds.
    weight: Vec3,
}

/// Rays that are traced as one batch, with the path of each.
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
        if weight.max_element() >= MIN_WEIGHT {
            self.rays.push(ray);
            self.paths.push(Path { sample, weight });
        }
    }

    fn len(&self) -> usize {
        self.rays.len()
    }

    /// Moves the rays of `other` to the end of this wave.
    fn append(&mut self, mut other: Self) {
        self.rays.append(&mut other.rays);
        self.paths.append(&mut other.paths);
    }
}

/// The surface point that a ray of a wave hits.
#[derive(Debug)]
struct VisiblePoint<'a> {
    /// Index of the ray in the wave.
    ray: usize,
    /// Factor on the color of the point.
    weight: Vec3,
    point: SurfacePoint<'a>,
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
    let mut wave = Wave::default();
    for (sample, position) in bucket.samples(options).enumerate() {
        wave.push(context.ray_through(position), sample, Vec3::ONE);
    }
    counts.primary += wave.rays.len() as u64;
    let mut colors = vec![Vec3::ZERO; wave.rays.len()];
    for bounce in 0..=options.bounces {
        if wave.rays.is_empty() {
            break;
        }
        let seen = Seen::by(context, &wave.rays);
        let mut points = Vec::with_capacity(seen.hits.len());
        let mut see = |ray: usize, hit: &PartHit, share: f32, colors: &mut [Vec3]| {
            let Path { sample, weight } = wave.paths[ray];
            let of_ray = &wave.rays[ray];
            if let Some(point) = SurfacePoint::new(stage, options.textures, of_ray, hit) {
                let weight = share * weight;
                let ambient = stage.description().ambient * point.material.ambient;
                let own = ambient * point.texture + point.material.emission;
                colors[sample] += weight * own;
                points.push(VisiblePoint { ray, weight, point });
            }
        };
        for (ray, hit) in seen.hits.iter().enumerate() {
            let share = seen.share(ray);
            if let Some(hit) = hit {
                see(ray, hit, share, &mut colors);
            } else {
                let Path { sample, weight } = wave.paths[ray];
                colors[sample] += share * weight * stage.description().background;
            }
        }
        for veil in &seen.veils {
            see(veil.ray, &veil.hit, veil.share, &mut colors);
        }
        for light in lights {
            add_light(context, light, &wave, &points, &mut colors, &mut counts);
        }
        if bounce == options.bounces {
            break;
        }
        // Reflected and refracted rays stay separate, because neighbors of one kind are coherent.
        let mut mirrored = Wave::with_capacity(points.len());
        let mut refracted = Wave::default();
        for visible in &points {
            scatter(&wave, visible, &mut mirrored, &mut refracted);
        }
        counts.mirrored += mirrored.len() as u64;
        counts.refracted += refracted.len() as u64;
        mirrored.append(refracted);
        wave = mirrored;
    }
    (colors, counts)
}

/// Adds the light of one source at all points that it reaches.
fn add_light(
    context: &RenderContext<'_, impl Tracer>,
    light: &ShownLight,
    wave: &Wave,
    points: &[VisiblePoint<'_>],
    colors: &mut [Vec3],
    counts: &mut RayCounts,
) {
    let mut shadow_rays = ShadowRays::with_capacity(points.len());
    for VisiblePoint { ray, weight, point } in points {
        let (ray, sample) = (&wave.rays[*ray], wave.paths[*ray].sample);
        let (to_light, arriving) = light.seen_from(point.at);
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
        let color = *weight * arriving * color;
        if color.max_element() > 0.0 {
            shadow_rays.push(point, light, sample, color);
        }
    }
    shadow_rays.add(context, colors, counts);
}

/// The reflected share of light (B. T. Phong, *Illumination for Computer Generated Pictures*, 1975).
fn phong(
    material: &Material,
    texture: Vec3,
    normal: Vec3,
    to_light: Vec3,
    view_direction: Vec3,
) -> Vec3 {
    let facing = normal.dot(to_light);
    if facing <= 0.0 {
        return Vec3::ZERO;
    }
    let diffuse = material.diffuse * texture * facing;
    let mirrored = to_light - 2.0 * facing * normal;
    let toward = mirrored.dot(view_direction.normalize_or_zero());
    if material.shine <= 0.0 || toward <= 0.0 {
        return diffuse;
    }
    diffuse + material.specular * toward.powf(material.shine)
}

/// Adds the reflected and the refracted ray of a point to their waves.
fn scatter(wave: &Wave, visible: &VisiblePoint<'_>, mirrored: &mut Wave, refracted: &mut Wave) {
    let VisiblePoint { ray, weight, point } = visible;
    let (ray, sample) = (&wave.rays[*ray], wave.paths[*ray].sample);
    let direction = ray.direction.normalize_or_zero();
    let material = point.material;
    let mut mirror = material.mirror;
    if material.transmittance > 0.0 {
        match refracted_direction(direction, point, material.refraction) {
            Some(direction) => {
                let weight = *weight * material.transmittance;
                refracted.push(Ray::new(point.below(), direction), sample, weight);
            }
            // Total internal reflection.
            None => mirror += material.transmittance,
        }
    }
    let back = direction - 2.0 * direction.dot(point.normal) * point.normal;
    // With an interpolated normal, the reflection may point into the surface.
    if back.dot(point.flat_normal) > 0.0 {
        let weight = *weight * mirror;
        mirrored.push(Ray::new(point.above(), back), sample, weight);
    }
}

/// The direction of the refracted ray (Snell's law); `None` on total internal reflection.
fn refracted_direction(direction: Vec3, point: &SurfacePoint<'_>, refraction: f32) -> Option<Vec3> {
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
