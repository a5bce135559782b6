//! Eight rays and a triangle for each: what is a hit, and where.
//!
//! [`TriangleTest::decide`](crate::triangle::TriangleTest::decide) for eight of them side by side, step by step: the same
//! answers to the bit.

use kd_core::Hit;
use kd_simd::{F64x8, LANES, Mask, Number, Simd};
use kd_wide::Block;

use crate::triangle::{LEAST_SHARE, TO_26_BITS};

/// Floats in a block, its numbers included, and in a corner of eight triangles.
const FLOATS: usize = size_of::<Block>() / size_of::<f32>();
const PER_CORNER: usize = 3 * LANES;

/// A triangle in a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place<'a> {
    pub(super) block: &'a Block,
    pub(super) lane: usize,
}

impl<'a> Place<'a> {
    /// One number for both.
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

    /// The first triangle for a number that is too large.
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
        // Within the array whatever the axis is, so that nothing is checked.
        floats[corner * PER_CORNER + (axis * LANES + self.lane) % 32]
    }
}

/// Eight rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rays<'a> {
    /// Across, across and along: the last is the one on which they all move most.
    pub(super) axes: [usize; 3],
    /// In that order, as are those of directions.
    pub(super) origin: [&'a [f32; LANES]; 3],
    pub(super) direction: [&'a [f32; LANES]; 3],
    pub(super) t_min: &'a [f32; LANES],
    pub(super) t_max: &'a [f32; LANES],
}

/// Rounded to f32, where no zero is negative.
#[inline(always)]
fn reported<N: F64x8>(x: N) -> [f32; LANES] {
    x.narrow().map(|x| x + 0.0)
}

/// Triangles for eight rays.
pub(super) trait Triangles: Copy {
    /// A coordinate of a corner, for each.
    fn coordinates<S: Simd>(&self, simd: S, corner: usize, axis: usize) -> S::F64;
}

/// A triangle for each ray.
impl Triangles for [Place<'_>; LANES] {
    #[inline(always)]
    fn coordinates<S: Simd>(&self, simd: S, corner: usize, axis: usize) -> S::F64 {
        let mut row = [0.0; LANES];
        for (coordinate, place) in row.iter_mut().zip(self) {
            *coordinate = place.coordinate(corner, axis);
        }
        simd.widen(&row)
    }
}

/// The same for all.
impl Triangles for Place<'_> {
    #[inline(always)]
    fn coordinates<S: Simd>(&self, simd: S, corner: usize, axis: usize) -> S::F64 {
        simd.splat_f64(self.coordinate(corner, axis).into())
    }
}

/// What eight rays hit: whether they do, a bit for each, and where.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decided {
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
    let sight = Sight::new(simd, rays);
    let corners = [
        sight.corner(simd, triangles, 0),
        sight.corner(simd, triangles, 1),
        sight.corner(simd, triangles, 2),
    ];
    let [a, b, c] = corners;
    let rounded = weights([rounded(a), rounded(b), rounded(c)]);
    let is_inside = are_inside(simd, rounded);

    let finer = weights(corners);
    let size = a[0].abs().max(a[1].abs()).max(b[0].abs());
    let size = size.max(b[1].abs()).max(c[0].abs()).max(c[1].abs());
    let is_sound = (simd.splat_f64(LEAST_SHARE) * size * size).le(sum(finer).abs());
    let is_finer = is_sound & are_inside(simd, finer);
    let weights = [
        finer[0].or(is_finer, rounded[0]),
        finer[1].or(is_finer, rounded[1]),
        finer[2].or(is_finer, rounded[2]),
    ];
    let ([t_a, t_b, t_c], [a, b, c]) = ([a[2], b[2], c[2]], weights);
    let sum = sum(weights);
    let t = reported((a * t_a + b * t_b + c * t_c) / sum);
    let at = simd.load(&t);
    let is_within = simd.load(rays.t_min).le(at)
        & at.le(simd.load(rays.t_max))
        & at.abs().le(simd.splat(f32::MAX));
    Decided {
        is_hit: is_inside.bits() & is_within.bits(),
        t,
        u: reported(b / sum),
        v: reported(c / sum),
    }
}

/// How eight rays see a corner: [`TriangleTest`](crate::triangle::TriangleTest).
#[derive(Clone, Copy, Debug)]
struct Sight<N> {
    axes: [usize; 3],
    origin: [N; 3],
    shear: [N; 2],
    scale: N,
}

impl<N: F64x8> Sight<N> {
    #[inline(always)]
    fn new<S: Simd<F64 = N>>(simd: S, rays: &Rays<'_>) -> Self {
        let [x, y, along] = rays.direction;
        let along = simd.widen(along);
        let [from_x, from_y, from_z] = rays.origin;
        Self {
            axes: rays.axes,
            origin: [simd.widen(from_x), simd.widen(from_y), simd.widen(from_z)],
            shear: [simd.widen(x) / along, simd.widen(y) / along],
            scale: simd.splat_f64(1.0) / along,
        }
    }

    /// A corner of each of eight triangles: across, across, and along in units of `t`.
    #[inline(always)]
    fn corner<S: Simd<F64 = N>>(
        &self,
        simd: S,
        triangles: impl Triangles,
        corner: usize,
    ) -> [N; 3] {
        let [x, y, along] = self.axes;
        let x = triangles.coordinates(simd, corner, x) - self.origin[0];
        let y = triangles.coordinates(simd, corner, y) - self.origin[1];
        let z = triangles.coordinates(simd, corner, along) - self.origin[2];
        [x - self.shear[0] * z, y - self.shear[1] * z, self.scale * z]
    }
}

/// Coordinates across, rounded to 26 bits.
#[inline(always)]
fn rounded<N: F64x8>([x, y, t]: [N; 3]) -> [N; 3] {
    let (half, kept) = (TO_26_BITS.half, TO_26_BITS.kept);
    [
        x.add_and_mask_bits(half, kept),
        y.add_and_mask_bits(half, kept),
        t,
    ]
}

/// Of corners a, b and c: the edge functions of c and b, a and c, b and a.
#[inline(always)]
fn weights<N: Number>([a, b, c]: [[N; 3]; 3]) -> [N; 3] {
    [edge(c, b), edge(a, c), edge(b, a)]
}

#[inline(always)]
fn edge<N: Number>(p: [N; 3], q: [N; 3]) -> N {
    p[0] * q[1] - p[1] * q[0]
}

#[inline(always)]
fn sum<N: Number>([a, b, c]: [N; 3]) -> N {
    a + b + c
}

#[inline(always)]
fn are_inside<S: Simd>(simd: S, weights: [S::F64; 3]) -> <S::F64 as Number>::Mask {
    let zero = simd.splat_f64(0.0);
    let [a, b, c] = weights;
    let above = zero.le(a) & zero.le(b) & zero.le(c);
    let below = a.le(zero) & b.le(zero) & c.le(zero);
    let sum = sum(weights);
    (above | below) & (sum.lt(zero) | zero.lt(sum))
}
