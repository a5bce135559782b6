//! Pictures of a stage, tile by tile.

use kd::Ray;
use kd::glam::Vec3;
use kd_scene::{Camera, View};
use rayon::prelude::*;

use crate::path_tracer;
use crate::picture::Picture;
use crate::stage::{ShownLight, Stage};
use crate::tracer::Tracer;
use crate::whitted;

/// What a picture is to be like.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderOptions {
    /// In pixels, at least 1.
    pub width: u32,
    /// In pixels, at least 1.
    pub height: u32,
    /// How light is followed.
    pub method: RenderMethod,
    /// How often rays are mirrored, refracted or scattered.
    pub bounces: u32,
    /// Lights that are used, in the order of the file.
    pub lights: usize,
    /// Rays for each pixel: so many across, and as many down.
    pub subpixels: u32,
    /// Whether surfaces have their textures.
    pub textures: bool,
}

/// How light is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum RenderMethod {
    /// From lights straight to what is seen, by mirrors and through glass, with hard shadows.
    #[default]
    Whitted,
    /// Scattered from dull surface to dull surface, by chance: soft light, from the sky too. Mirrors are dull.
    Diffuse,
}

impl Default for RenderOptions {
    /// 800 by 600 pixels, one ray each, two bounces, all lights, textures.
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

/// How many rays a picture took, of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// From the camera.
    pub primary: u64,
    /// To lights.
    pub shadow: u64,
    /// From mirrors.
    pub mirrored: u64,
    /// Into glass and out of it.
    pub refracted: u64,
    /// Scattered by dull surfaces.
    pub diffuse: u64,
}

impl RayCounts {
    /// All of them.
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

/// Pixels along the side of a tile.
const TILE: u32 = 32;
/// Pixels along the side of what is taken together in a tile, as batches of rays like them.
const BLOCK: u32 = 8;

/// A part of a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tile {
    pub(crate) left: u32,
    pub(crate) top: u32,
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl Tile {
    fn all(options: &RenderOptions) -> Vec<Self> {
        let (width, height) = (options.width, options.height);
        let rows = (0..height).step_by(TILE as usize);
        let tiles = rows.flat_map(|top| {
            let columns = (0..width).step_by(TILE as usize);
            columns.map(move |left| Self {
                left,
                top,
                width: TILE.min(width - left),
                height: TILE.min(height - top),
            })
        });
        tiles.collect()
    }

    /// Its pixels, block by block.
    pub(crate) fn pixels(self) -> impl Iterator<Item = [u32; 2]> {
        let blocks = self.height.div_ceil(BLOCK) * self.width.div_ceil(BLOCK);
        (0..blocks).flat_map(move |block| {
            let across = self.width.div_ceil(BLOCK);
            let (left, top) = (block % across * BLOCK, block / across * BLOCK);
            let (right, bottom) = (self.width.min(left + BLOCK), self.height.min(top + BLOCK));
            let rows = top..bottom;
            rows.flat_map(move |y| (left..right).map(move |x| [self.left + x, self.top + y]))
        })
    }

    /// Places in the picture, from 0 to 1, those of a pixel one after the other.
    pub(crate) fn samples(self, options: &RenderOptions) -> impl Iterator<Item = [f32; 2]> {
        let sub = options.subpixels.max(1);
        let size = [options.width, options.height].map(|pixels| pixels as f32 * sub as f32);
        self.pixels().flat_map(move |[column, row]| {
            (0..sub * sub).map(move |i| {
                let place = [column * sub + i % sub, row * sub + i / sub];
                [0, 1].map(|axis| (place[axis] as f32 + 0.5) / size[axis])
            })
        })
    }
}

/// Everything that is the same for all tiles of a picture.
pub(crate) struct Shot<'a, T> {
    pub(crate) stage: &'a Stage,
    pub(crate) tracer: &'a T,
    pub(crate) options: &'a RenderOptions,
    pub(crate) lights: Vec<ShownLight>,
    view: View,
}

impl<T> Shot<'_, T> {
    /// The ray through a place of the picture.
    pub(crate) fn ray_through(&self, [x, y]: [f32; 2]) -> Ray {
        Ray::new(self.view.eye, self.view.direction(x, y))
    }
}

/// A picture, and the rays that it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// What is seen.
    pub picture: Picture,
    /// What that took.
    pub rays: RayCounts,
}

/// Makes a picture of a stage as it is now, on the threads of the pool in scope (rayon's).
///
/// It does not depend on the number of threads. `watch` is told after each tile how many rays it took.
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
/// assert!(middle.x > 0.9 && middle.y == 0.0, "red: {middle}");
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
    let shot = Shot {
        stage,
        tracer,
        options,
        lights: stage.lights(options.lights),
        view: camera.view(width as f32 / height as f32),
    };
    let tiles: Vec<_> = Tile::all(options)
        .into_par_iter()
        .map(|tile| {
            let (colors, counts) = match options.method {
                RenderMethod::Whitted => whitted::trace(&shot, &tile),
                RenderMethod::Diffuse => path_tracer::trace(&shot, &tile),
            };
            watch(&counts);
            (tile, colors, counts)
        })
        .collect();
    let mut picture = Picture::new(width, height, Vec3::ZERO, stage.description().colors);
    let mut rays = RayCounts::default();
    let samples = options.subpixels.max(1).pow(2) as usize;
    for (tile, colors, counts) in tiles {
        rays += counts;
        for ([column, row], samples) in tile.pixels().zip(colors.chunks(samples)) {
            // What is cut off is cut off before it is blended, so that edges of bright things are smooth.
            let shown = samples.iter().map(|color| color.min(Vec3::ONE));
            picture.set(column, row, shown.sum::<Vec3>() / samples.len() as f32);
        }
    }
    Rendering { picture, rays }
}
