//! Eight rays and a triangle for each: the [decision](crate::decision) in lanes.

use kd_core::Hit;
use kd_simd::{F64x8, LANES, Mask, Simd, Three, Triple, each};
use kd_wide::Block;

use crate::decision::{View, are_inside, is_within};

/// Floats in a block, its slots included, and in a corner of eight triangles.
const FLOATS: usize = size_of::<Block>() / size_of::<f32>();
const PER_CORNER: usize = 3 * LANES;

/// A triangle of a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockLane<'a> {
    pub(super) block: &'a Block,
    pub(super) lane: usize,
}

impl<'a> BlockLane<'a> {
    /// The number of the triangle of a lane of a block: eight times the block's, plus the lane.
    #[inline(always)]
    pub(super) fn number(block: usize, lane: usize) -> u32 {
        u32::try_from(block * LANES + lane).expect("fewer than 2^28 blocks")
    }

    #[inline(always)]
    pub(super) fn new(blocks: &'a [Block], number: u32) -> Self {
        let number = number as usize;
        Self {
            block: &blocks[number / LANES],
            lane: number % LANES,
        }
    }

    /// The triangle of a number; the first triangle for a number beyond all blocks.
    #[inline(always)]
    pub(super) fn or_any(blocks: &'a [Block], number: u32) -> Self {
        let is_there = number as usize / LANES < blocks.len();
        Self::new(blocks, if is_there { number } else { 0 })
    }

    #[inline(always)]
    pub(super) fn triangle(&self) -> u32 {
        self.block.triangles[self.lane]
    }

    #[inline(always)]
    fn coordinate(&self, corner: usize, axis: usize) -> f32 {
        let floats: &[f32; FLOATS] = bytemuck::must_cast_ref(self.block);
        // Within the array for every axis, so that no check is needed.
        floats[corner * PER_CORNER + (axis * LANES + self.lane) % 32]
    }
}

/// Eight rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rays<'a> {
    /// Across, across and along: on the last axis the directions of all rays are largest.
    pub(super) axes: [usize; 3],
    /// In this order, like the directions.
    pub(super) origin: [&'a [f32; LANES]; 3],
    pub(super) direction: [&'a [f32; LANES]; 3],
    pub(super) t_min: &'a [f32; LANES],
    pub(super) t_max: &'a [f32; LANES],
}

/// Rounded to f32, without negative zeros.
#[inline(always)]
fn reported<N: F64x8>(x: N) -> [f32; LANES] {
    each(x.narrow(), |x| x + 0.0)
}

/// Triangles for eight rays.
pub(super) trait Triangles: Copy {
    /// A coordinate of a corner of each triangle.
    fn coordinates<S: Simd>(&self, simd: S, corner: usize, axis: usize) -> S::F64;
}

/// A triangle for each ray.
impl Triangles for [BlockLane<'_>; LANES] {
    #[inline(always)]
    fn coordinates<S: Simd>(&self, simd: S, corner: usize, axis: usize) -> S::F64 {
        let mut row = [0.0; LANES];
        for (coordinate, place) in row.iter_mut().zip(self) {
            *coordinate = place.coordinate(corner, axis);
        }
        simd.widen(&row)
    }
}

/// The same triangle for all rays.
impl Triangles for BlockLane<'_> {
    #[inline(always)]
    fn coordinates<S: Simd>(&self, simd: S, corner: usize, axis: usize) -> S::F64 {
        simd.splat_f64(self.coordinate(corner, axis).into())
    }
}

/// The hits of eight rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decided {
    /// A bit for each ray that hits its triangle.
    pub(super) is_hit: u32,
    t: [f32; LANES],
    u: [f32; LANES],
    v: [f32; LANES],
}

impl Decided {
    #[inline(always)]
    pub(super) fn hit(&self, lane: usize, triangle: u32) -> Hit {
        Hit {
            t: self.t[lane],
            u: self.u[lane],
            v: self.v[lane],
            triangle,
        }
    }
}

/// Eight rays, and a triangle for each.
#[inline(always)]
pub(super) fn decide<S: Simd>(simd: S, rays: &Rays<'_>, triangles: impl Triangles) -> Decided {
    let view = view(simd, rays);
    let [x, y, along] = [
        corners(simd, rays, triangles, 0),
        corners(simd, rays, triangles, 1),
        corners(simd, rays, triangles, 2),
    ];
    let sight = view.sight([x, y, along]);
    let weights = sight.deciding_weights();
    let is_inside = are_inside(weights);
    let [t, u, v] = sight.point(weights);
    let t = reported(t);
    let ends = [simd.load(rays.t_min), simd.load(rays.t_max)];
    let is_within = is_within(simd.load(&t), ends, simd.splat(f32::MAX));
    Decided {
        is_hit: is_inside.bits() & is_within.bits(),
        t,
        u: reported(u),
        v: reported(v),
    }
}

/// How each ray sees triangles.
#[inline(always)]
fn view<S: Simd>(simd: S, rays: &Rays<'_>) -> View<S::F64> {
    let [x, y, along] = rays.direction;
    let along = simd.widen(along);
    View {
        shear: [simd.widen(x) / along, simd.widen(y) / along],
        scale: simd.splat_f64(1.0) / along,
    }
}

/// The coordinates of all corners on one of the axes of the rays, from their origins.
#[inline(always)]
fn corners<S: Simd>(
    simd: S,
    rays: &Rays<'_>,
    triangles: impl Triangles,
    axis: usize,
) -> Three<S::F64> {
    let of_scene = rays.axes[axis];
    let corners = Three([
        triangles.coordinates(simd, 0, of_scene),
        triangles.coordinates(simd, 1, of_scene),
        triangles.coordinates(simd, 2, of_scene),
    ]);
    corners.minus(simd.widen(rays.origin[axis]))
}
