//! Two pictures of a scene: what it looks like, and what its rays cost.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, Rgb, RgbImage};
use kd::glam::Vec3;
use kd::{Hit, Ray};
use kd_render::Heat;
use kd_scene::View;
use serde::{Deserialize, Serialize};

use crate::rays::SurfacePoint;
use crate::sampling::Random;
use crate::scenes::Scene;
use crate::structure::Structure;

/// What the colours of a heat picture mean.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
pub(crate) struct HeatScale {
    /// Steps (nodes, leaves and triangles) of the brightest colour; of 200 pixels one may be above.
    pub(crate) brightest: u64,
    pub(crate) mean: f64,
}

/// Rays through a pixel: this many across and down.
const SUBPIXELS: u32 = 2;
/// Ambient rays for each of them, and how far they look, in diagonals of the scene.
const AMBIENT_RAYS: u8 = 3;
const AMBIENT_REACH: f32 = 0.15;

const SKY_ABOVE: Vec3 = Vec3::new(0.72, 0.80, 0.92);
const SKY_BELOW: Vec3 = Vec3::new(0.93, 0.94, 0.95);
const SURFACE: Vec3 = Vec3::new(0.82, 0.76, 0.68);
const SUNLIGHT: f32 = 0.75;
const SKYLIGHT: f32 = 0.45;

/// The scene in its light, as PNG: a matt surface with the light's shadow, and dark where little sky is seen.
pub(crate) fn shaded(
    scene: &Scene,
    structure: &dyn Structure,
    side: u32,
) -> anyhow::Result<Vec<u8>> {
    let view = scene.camera.view(1.0);
    let lines = side * SUBPIXELS;
    let pixels = by_rows(side, |column, row| {
        let mut random = Random::new(u64::from(row * side + column));
        let mut sum = Vec3::ZERO;
        for sub in 0..SUBPIXELS * SUBPIXELS {
            let x = column * SUBPIXELS + sub % SUBPIXELS;
            let y = row * SUBPIXELS + sub / SUBPIXELS;
            sum += radiance(scene, structure, &primary(&view, x, y, lines), &mut random);
        }
        sum / (SUBPIXELS * SUBPIXELS) as f32
    });
    png(RgbImage::from_fn(side, side, |x, y| {
        // The square root is close enough to the display's gamma for a picture to look at.
        let light = pixels[(y * side + x) as usize].map(f32::sqrt);
        Rgb(light.to_array().map(byte))
    }))
}

fn primary(view: &View, column: u32, row: u32, side: u32) -> Ray {
    Ray::new(
        view.eye,
        view.through_pixel(column, row, side, side).normalize(),
    )
}

fn radiance(scene: &Scene, structure: &dyn Structure, ray: &Ray, random: &mut Random) -> Vec3 {
    let hit = closest(structure, ray);
    let point = hit
        .as_ref()
        .and_then(|hit| SurfacePoint::new(&scene.mesh, ray, hit));
    let Some(point) = point else {
        let up = scene.camera.up.normalize_or_zero();
        return SKY_BELOW.lerp(SKY_ABOVE, (0.5 + ray.direction.dot(up)).clamp(0.0, 1.0));
    };
    let to_light = (scene.light - point.origin).normalize_or_zero();
    let facing = point.normal.dot(to_light).max(0.0);
    let lit = facing > 0.0 && !occluded(structure, &Ray::between(point.origin, scene.light));
    let reach = AMBIENT_REACH * scene.mesh.bounds().diagonal();
    let open = (0..AMBIENT_RAYS).filter(|_| {
        let direction = random.cosine_around(point.normal);
        !occluded(
            structure,
            &Ray::new(point.origin, direction).with_range(0.0, reach),
        )
    });
    let open = open.count() as f32 / f32::from(AMBIENT_RAYS);
    let sunlight = if lit { SUNLIGHT * facing } else { 0.0 };
    SURFACE * (sunlight + SKYLIGHT * open * SKY_ABOVE)
}

/// How many steps the ray through each pixel takes, as PNG; none if the structure does not count.
pub(crate) fn heat(
    scene: &Scene,
    structure: &dyn Structure,
    side: u32,
) -> anyhow::Result<Option<(Vec<u8>, HeatScale)>> {
    let view = scene.camera.view(1.0);
    let steps = by_rows(side, |column, row| {
        let (_, steps) = structure.counted(&primary(&view, column, row, side))?;
        Some(steps.node_steps + steps.leaf_steps + steps.triangle_tests)
    });
    let Some(steps) = steps.into_iter().collect::<Option<Vec<u64>>>() else {
        return Ok(None);
    };
    let heat = Heat::new([side, side], &steps);
    let scale = HeatScale {
        brightest: heat.brightest,
        mean: heat.mean,
    };
    Ok(Some((png(heat.picture.to_image())?, scale)))
}

fn closest(structure: &dyn Structure, ray: &Ray) -> Option<Hit> {
    let mut hit = [None];
    structure.closest(std::slice::from_ref(ray), &mut hit);
    hit[0]
}

fn occluded(structure: &dyn Structure, ray: &Ray) -> bool {
    let mut hit = [false];
    structure.any(std::slice::from_ref(ray), &mut hit);
    hit[0]
}

/// The value of every pixel, row by row, worked out on all cores.
fn by_rows<T: Send>(side: u32, pixel: impl Fn(u32, u32) -> T + Sync) -> Vec<T> {
    let threads =
        std::thread::available_parallelism().map_or(1, |n| u32::try_from(n.get()).unwrap_or(1));
    let share = side.div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let pixel = &pixel;
        let bands: Vec<_> = (0..side.div_ceil(share))
            .map(|band| {
                let rows = band * share..((band + 1) * share).min(side);
                scope.spawn(move || {
                    let places = rows.flat_map(|row| (0..side).map(move |column| (column, row)));
                    places
                        .map(|(column, row)| pixel(column, row))
                        .collect::<Vec<T>>()
                })
            })
            .collect();
        bands
            .into_iter()
            .flat_map(|band| band.join().expect("a pixel never panics"))
            .collect()
    })
}

fn png(picture: RgbImage) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    DynamicImage::from(picture).write_to(&mut bytes, ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to 0..=255"
)]
fn byte(light: f32) -> u8 {
    (light * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::structure::REFERENCE;

    #[test]
    fn pictures_show_the_scene() {
        let setup = kd_scene::Spd::Tetra.generate(2).expect("small");
        let scene = Scene {
            mesh: setup.mesh.into(),
            camera: setup.camera,
            light: setup.lights[0],
        };
        let built = REFERENCE.build(&scene.mesh, 1).expect("small");
        let structure = built.structure;
        let shaded = image::load_from_memory(&shaded(&scene, &*structure, 16).expect("drawn"))
            .expect("a PNG")
            .to_rgb8();
        let (corner, middle) = (shaded.get_pixel(0, 0), shaded.get_pixel(8, 8));
        assert_ne!(
            corner, middle,
            "sky in the corner, the tetrahedron in the middle"
        );
        let (heat, scale) = heat(&scene, &*structure, 16)
            .expect("drawn")
            .expect("the kd-tree counts");
        let heat = image::load_from_memory(&heat).expect("a PNG").to_rgb8();
        assert_ne!(
            heat.get_pixel(0, 0),
            heat.get_pixel(8, 8),
            "the sky is cheap"
        );
        assert!(
            scale.brightest as f64 >= scale.mean && scale.mean > 0.0,
            "{scale:?}"
        );
    }
}
