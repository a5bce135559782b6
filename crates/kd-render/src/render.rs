//! Renders a picture of a stage, one bucket of pixels at a time.

use kd::Ray;
use kd::glam::Vec3;
use kd_scene::{Camera, View};
use rayon::prelude::*;

use crate::light::ShownLight;
use crate::path_tracer;
use crate::picture::Picture;
use crate::stage::Stage;
use crate::tracer::Tracer;
use crate::whitted;

/// Settings of one rendering.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// Width of the picture in pixels, at least 1.
    pub width: u32,
    /// Height of the picture in pixels, at least 1.
    pub height: u32,
    /// The light transport to simulate.
    pub method: RenderMethod,
    /// Maximum number of reflections, refractions or scattering events along a path. 0 traces primary and shadow rays only.
    pub bounces: u32,
    /// Number of lights to use, taken in file order. `usize::MAX` uses all of them.
    pub lights: usize,
    /// Samples per pixel along each axis: a pixel takes `subpixels`² primary rays. 0 counts as 1.
    pub subpixels: u32,
    /// Whether textures modulate the colors and the alpha of surfaces.
    pub textures: bool,
}

/// The light transport that a rendering simulates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum RenderMethod {
    /// Whitted ray tracing: direct light with hard shadows, perfect mirrors, refraction.
    #[default]
    Whitted,
    /// Path tracing of diffuse surfaces, lit by the lights and by the background. Mirrors and glass count as diffuse.
    Diffuse,
}

impl Default for RenderOptions {
    /// 800 × 600 pixels, one sample per pixel, Whitted, two bounces, all lights, textures on.
    fn default() -> Self {
        Self {
            width: 800,
            height: 600,
            method: RenderMethod::Whitted,
            bounces: 2,
            lights: usize::MAX,
            subpixels: 1,
            textures: true,
        }
    }
}

/// Number of rays traced for a picture, by kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Rays from the camera.
    pub primary: u64,
    /// Rays from surfaces to lights.
    pub shadow: u64,
    /// Rays reflected by mirrors.
    pub mirrored: u64,
    /// Rays refracted into or out of a transparent body.
    pub refracted: u64,
    /// Rays scattered by diffuse surfaces.
    pub diffuse: u64,
}

impl RayCounts {
    /// Sum over all kinds.
    pub fn total(&self) -> u64 {
        self.primary + self.shadow + self.mirrored + self.refracted + self.diffuse
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
        self.mirrored += other.mirrored;
        self.refracted += other.refracted;
        self.diffuse += other.diffuse;
    }
}

/// Side of a bucket in pixels. A bucket is the unit of parallel work.
const BUCKET: u32 = 32;
/// Side in pixels of the squares by which a bucket is ordered: at one sample per pixel, 64 consecutive rays are coherent.
const SQUARE: u32 = 8;

/// A rectangle of pixels that one thread renders.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bucket {
    pub(crate) left: u32,
    pub(crate) top: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl Bucket {
    fn all(options: &RenderOptions) -> Vec<Self> {
        let (width, height) = (options.width, options.height);
        let rows = (0..height).step_by(BUCKET as usize);
        let buckets = rows.flat_map(|top| {
            let columns = (0..width).step_by(BUCKET as usize);
            columns.map(move |left| Self {
                left,
                top,
                width: BUCKET.min(width - left),
                height: BUCKET.min(height - top),
            })
        });
        buckets.collect()
    }

    /// Column and row of each pixel in the picture, square by square.
    pub(crate) fn pixels(self) -> impl Iterator<Item = [u32; 2]> {
        let squares = self.height.div_ceil(SQUARE) * self.width.div_ceil(SQUARE);
        (0..squares).flat_map(move |square| {
            let across = self.width.div_ceil(SQUARE);
            let (left, top) = (square % across * SQUARE, square / across * SQUARE);
            let (right, bottom) = (self.width.min(left + SQUARE), self.height.min(top + SQUARE));
            let rows = top..bottom;
            rows.flat_map(move |y| (left..right).map(move |x| [self.left + x, self.top + y]))
        })
    }

    /// Positions of the samples in the picture, from 0 to 1 along each axis. The samples of a pixel are consecutive.
    pub(crate) fn samples(self, options: &RenderOptions) -> impl Iterator<Item = [f32; 2]> {
        let sub = options.subpixels.max(1);
        let size = [options.width, options.height].map(|pixels| pixels as f32 * sub as f32);
        self.pixels().flat_map(move |[column, row]| {
            (0..sub * sub).map(move |i| {
                let cell = [column * sub + i % sub, row * sub + i / sub];
                [0, 1].map(|axis| (cell[axis] as f32 + 0.5) / size[axis])
            })
        })
    }
}

/// The inputs that all buckets of a picture share.
pub(crate) struct RenderContext<'a, T> {
    pub(crate) stage: &'a Stage,
    pub(crate) tracer: &'a T,
    pub(crate) options: &'a RenderOptions,
    pub(crate) lights: Vec<ShownLight>,
    view: View,
}

impl<T> RenderContext<'_, T> {
    /// The primary ray through a position of the picture, from 0 to 1 along each axis.
    pub(crate) fn ray_through(&self, [x, y]: [f32; 2]) -> Ray {
        Ray::new(self.view.eye, self.view.direction(x, y))
    }
}

/// A picture and the number of rays that it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// The rendered image.
    pub picture: Picture,
    /// The rays traced for it.
    pub rays: RayCounts,
}

/// Renders `stage`, at the time it shows, on the threads of the current rayon pool.
///
/// `tracer` answers the rays; it must hold the same triangles as the stage, as [`Stage::tracer`] does. The picture does not
/// depend on the number of threads. After each bucket of at most 32 × 32 pixels, `watch` receives the number of rays that the
/// bucket took, on the thread that rendered it.
///
/// ```
/// use kd_render::{RenderOptions, Stage, render};
/// use kd_scene::{AffOptions, read_aff};
///
/// let text = "l 1 2 3  f 1 0 0 1 0 0 0 0  s 0 0 0 1  v from 0 0 4 at 0 0 0 up 0 1 0 angle 40 hither 0.1 resolution 8 6";
/// let mut files = |_: &std::path::Path| Ok(text.as_bytes().to_vec());
/// let ball = read_aff("ball.aff".as_ref(), &mut files, &AffOptions::default())?;
/// let stage = Stage::new(ball, Default::default(), Default::default())?;
/// let options = RenderOptions { width: 64, height: 48, ..RenderOptions::default() };
/// let rendering = render(&stage, &stage.tracer(), &stage.camera(), &options, &|_| {});
/// let middle = rendering.picture.at(32, 24);
/// assert!(middle.x > 0.9 && middle.y == 0.0, "the ball is red: {middle}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn render(
    stage: &Stage,
    tracer: &impl Tracer,
    camera: &Camera,
    options: &RenderOptions,
    watch: &(dyn Fn(&RayCounts) + Sync),
) -> Rendering {
    let (width, height) = (options.width, options.height);
    let context = RenderContext {
        stage,
        tracer,
        options,
        lights: stage.lights(options.lights),
        view: camera.view(width as f32 / height as f32),
    };
    let buckets: Vec<_> = Bucket::all(options)
        .into_par_iter()
        .map(|bucket| {
            let (colors, counts) = match options.method {
                RenderMethod::Whitted => whitted::trace(&context, &bucket),
                RenderMethod::Diffuse => path_tracer::trace(&context, &bucket),
            };
            watch(&counts);
            (bucket, colors, counts)
        })
        .collect();
    let mut picture = Picture::new(width, height, Vec3::ZERO, stage.description().colors);
    let mut rays = RayCounts::default();
    let samples = options.subpixels.max(1).pow(2) as usize;
    for (bucket, colors, counts) in buckets {
        rays += counts;
        for ([column, row], samples) in bucket.pixels().zip(colors.chunks(samples)) {
            // Clamping before averaging keeps the edges of overexposed surfaces smooth.
            let shown = samples.iter().map(|color| color.min(Vec3::ONE));
            picture.set(column, row, shown.sum::<Vec3>() / samples.len() as f32);
        }
    }
    Rendering { picture, rays }
}
