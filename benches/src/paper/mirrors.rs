//! The rays of a small ray tracer in a world of mirrors: a picture, two reflections of it, and from every point seen a ray to
//! the light. (The workload of Table 4.1 of *kd-tree merging*: one light, two bounces.)

use kd::glam::Vec3;
use kd::{KdTree, Ray};
use kd_scene::Camera;

use crate::rays::{self, SurfacePoint};

/// The picture, in pixels.
const WIDTH: u32 = 800;
const HEIGHT: u32 = 600;
const BOUNCES: usize = 2;

/// What is traced for a frame, in this order.
#[derive(Debug)]
pub(crate) struct Mirrors {
    pub(crate) batches: Vec<Batch>,
    /// How many rays the whole picture has for one here.
    pub(crate) scale: f64,
}

#[derive(Debug)]
pub(crate) enum Batch {
    Closest(Vec<Ray>),
    Any(Vec<Ray>),
}

impl Mirrors {
    /// The rays of about so many pixels, or of all for 0.
    pub(crate) fn new(tree: &KdTree, camera: &Camera, light: Vec3, limit: usize) -> Self {
        let all = (WIDTH * HEIGHT) as usize;
        let stride = if limit == 0 { 1 } else { all.div_ceil(limit) };
        let mut closest = rays::picture(camera, [WIDTH, HEIGHT], stride);
        let scale = all as f64 / closest.len() as f64;
        let mut batches = Vec::new();
        for _ in 0..=BOUNCES {
            let (mut shadow, mut mirrored) = (Vec::new(), Vec::new());
            for ray in &closest {
                let hit = tree.intersect(ray);
                let point = hit.and_then(|hit| SurfacePoint::new(tree.mesh(), ray, &hit));
                let Some(SurfacePoint { origin, normal }) = point else {
                    continue;
                };
                shadow.push(Ray::between(origin, light));
                let direction = ray.direction.reflect(normal);
                mirrored.push(Ray::new(origin, direction));
            }
            batches.push(Batch::Closest(std::mem::replace(&mut closest, mirrored)));
            batches.push(Batch::Any(shadow));
        }
        Self { batches, scale }
    }

    /// How many rays the whole picture takes, about.
    pub(crate) fn of_whole_picture(&self) -> u64 {
        let lens = self.batches.iter().map(|batch| match batch {
            Batch::Closest(rays) | Batch::Any(rays) => rays.len(),
        });
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few million"
        )]
        let all = (lens.sum::<usize>() as f64 * self.scale) as u64;
        all
    }
}
