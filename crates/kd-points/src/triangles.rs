//! Eight triangles before a point, in f32: an estimate of each distance, and a bound below it.
//!
//! # The bound
//!
//! Let g be any vector, and A, B, C the corners as the point sees them. A point q of the triangle is a mean of the corners, so that
//! |q| |g| ≥ q · g ≥ m, the least of A · g, B · g and C · g. So the triangle is at least m / |g| away: g is the normal of a plane between it
//! and the point. The bound is sharp where g is the closest point itself, and it holds for every g, however g was computed. Here g is
//! the closest point in f32, from a plain computation without care for rounding.
//!
//! In scaled units coordinates are at most 1 ([`reach`](crate::reach)). A corner errs by a factor of 1 ± u in each coordinate, and a
//! product with g by three roundings at most: together by 4.1u (|g.x| + |g.y| + |g.z|). We allow 8u. Then m is squared, which costs 3u, and
//! compared with the limit times |g|² as computed, which costs 5u: less than the 16u that a limit allows. Products that underflow lose less
//! than 2⁻¹⁴⁰, and we allow 2⁻¹⁰⁰.

use kd_simd::{F32x8, LANES, Mask as _, Number as _, Simd};
use kd_wide::Block;

use crate::reach::ReachLanes;

/// 8 u.
const BLUR: f32 = 8.0 / (1 << 24) as f32;
/// 2⁻¹⁰⁰.
const FLOOR: f32 = 1.0 / (1_u128 << 100) as f32;

/// Eight triangles before a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimates<N> {
    /// |g|², an estimate of the squared distance. NaN in lanes without a triangle.
    squares: N,
    /// m², less its error, or 0.
    bounds: N,
}

impl<N: F32x8> Estimates<N> {
    #[inline(always)]
    pub(crate) fn new<S: Simd<F32 = N>>(simd: S, reach: &ReachLanes<N>, block: &Block) -> Self {
        let [a, b, c] = &block.corners;
        let a = reach.seen(simd, a);
        let b = reach.seen(simd, b);
        let c = reach.seen(simd, c);
        let zero = simd.splat(0.0);
        let g = closest(simd, a, b, c);
        let [x, y, z] = g;
        let least = dot(a, g).min(dot(b, g)).min(dot(c, g));
        let error = (x.abs() + y.abs() + z.abs()) * simd.splat(BLUR);
        let least = (least - error).max(zero);
        Self {
            squares: dot(g, g),
            bounds: least * least,
        }
    }

    /// The lanes whose triangle may be within a limit of [`Reach::limit`](crate::reach::Reach::limit).
    #[inline(always)]
    pub(crate) fn within<S: Simd<F32 = N>>(&self, simd: S, limit: f32) -> u32 {
        let most = self.squares.mul_add(simd.splat(limit), simd.splat(FLOOR));
        self.bounds.le(most).bits()
    }

    #[inline(always)]
    pub(crate) fn squares(&self) -> [f32; LANES] {
        let mut squares = [0.0; LANES];
        self.squares.store(&mut squares);
        squares
    }
}

type Vector<N> = [N; 3];

#[inline(always)]
fn dot<N: F32x8>([a, b, c]: Vector<N>, [x, y, z]: Vector<N>) -> N {
    c.mul_add(z, b.mul_add(y, a * x))
}

#[inline(always)]
fn minus<N: F32x8>([a, b, c]: Vector<N>, [x, y, z]: Vector<N>) -> Vector<N> {
    [a - x, b - y, c - z]
}

/// `from + factor * along`.
#[inline(always)]
fn ahead<N: F32x8>(from: Vector<N>, factor: N, [x, y, z]: Vector<N>) -> Vector<N> {
    let [a, b, c] = from;
    [
        x.mul_add(factor, a),
        y.mul_add(factor, b),
        z.mul_add(factor, c),
    ]
}

/// The first where the mask is true, elsewhere the second.
#[inline(always)]
fn either<N: F32x8>(mask: N::Mask, [a, b, c]: Vector<N>, [x, y, z]: Vector<N>) -> Vector<N> {
    [a.or(mask, x), b.or(mask, y), c.or(mask, z)]
}

/// The point of each triangle that is closest to the origin, up to rounding: the closest of its edges, or the foot of the perpendicular if
/// that is inside.
#[inline(always)]
fn closest<S: Simd>(
    simd: S,
    a: Vector<S::F32>,
    b: Vector<S::F32>,
    c: Vector<S::F32>,
) -> Vector<S::F32> {
    let (zero, one) = (simd.splat(0.0), simd.splat(1.0));
    let (ab, ac, bc) = (minus(b, a), minus(c, a), minus(c, b));
    let (ab_ab, ac_ac, ab_ac) = (dot(ab, ab), dot(ac, ac), dot(ab, ac));
    let (to_b, to_c) = (zero - dot(a, ab), zero - dot(a, ac));
    // A quotient of zeros, at an edge without length, becomes 0.
    let on_ab = ahead(a, (to_b / ab_ab).max(zero).min(one), ab);
    let on_ac = ahead(a, (to_c / ac_ac).max(zero).min(one), ac);
    let along_bc = (zero - dot(b, bc)) / dot(bc, bc);
    let on_bc = ahead(b, along_bc.max(zero).min(one), bc);
    let (of_ab, of_ac, of_bc) = (dot(on_ab, on_ab), dot(on_ac, on_ac), dot(on_bc, on_bc));
    let edge = either(of_ab.le(of_ac), on_ab, on_ac);
    let edge = either(of_bc.le(of_ab.min(of_ac)), on_bc, edge);
    let whole = ab_ab * ac_ac - ab_ac * ab_ac;
    let v = ac_ac * to_b - ab_ac * to_c;
    let w = ab_ab * to_c - ab_ac * to_b;
    let is_inside = zero.lt(v) & zero.lt(w) & (v + w).lt(whole);
    // At most 1, also where the reciprocal of a tiny number overflows.
    let part = one / whole;
    let (v, w) = ((v * part).min(one), (w * part).min(one));
    let foot = ahead(ahead(a, v, ab), w, ac);
    either(is_inside, foot, edge)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::{Aabb, is_zero_area};
    use kd_oracle::effort;
    use kd_simd::{Level, Task};
    use proptest::prelude::*;

    use super::*;
    use crate::decision::Foot;
    use crate::reach::Reach;

    /// Whether each of eight triangles may be as close as it is, and whether its box may.
    struct Kept<'a> {
        reach: Reach,
        block: &'a Block,
        faces: [[[f32; LANES]; 2]; 3],
        squares: [f64; LANES],
    }

    impl<S: Simd> Task<S> for &Kept<'_> {
        type Output = [bool; LANES];

        #[inline(always)]
        fn run(self, simd: S) -> [bool; LANES] {
            let lanes = self.reach.lanes(simd);
            let estimates = Estimates::new(simd, &lanes, self.block);
            let boxes = lanes.squared_distances(simd, &self.faces);
            let mut kept = [false; LANES];
            for (lane, kept) in kept.iter_mut().enumerate() {
                let limit = self.reach.limit(self.squares[lane]);
                let boxes = boxes.le(simd.splat(limit)).bits();
                *kept = (estimates.within(simd, limit) & boxes) >> lane & 1 == 1;
            }
            kept
        }
    }

    fn place() -> impl Strategy<Value = Vec3> {
        let one =
            || prop_oneof![3 => -1.0_f32..1.0, 1 => (-2_i8..=2).prop_map(|x| 0.5 * f32::from(x))];
        [one(), one(), one()].prop_map(Vec3::from_array)
    }

    /// Triangles of any size and shape, thin ones included.
    fn triangle() -> impl Strategy<Value = [Vec3; 3]> {
        let size = prop_oneof![Just(1.0_f32), Just(1e-2), Just(1e-4), Just(1e-6)];
        (place(), [place(), place(), place()], size, 0_u8..3).prop_map(
            |(center, [a, b, c], size, shape)| {
                let c = match shape {
                    0 => a.lerp(b, c.x) + 1e-6 * c,
                    _ => c,
                };
                [a, b, c].map(|corner| center + size * corner)
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(effort::cases(4_000, 40_000)))]

        /// No triangle is rejected at its own distance, at any scale and from any distance, on both levels.
        #[test]
        fn nothing_is_lost(
            triangles in prop::array::uniform8(triangle()),
            from in place(),
            share in prop_oneof![Just(0.0_f32), Just(1e-6), Just(1e-3), Just(1.0), Just(1e4)],
            scale in prop::sample::select(vec![1.0_f32, 1e-3, 1e12, 1e25, 1e33, 1e-12, 1e-25, 1e-38]),
        ) {
            // On the first triangle, near it, or far from all.
            let [a, b, c] = triangles[0];
            let point = (a.midpoint(b).lerp(c, 0.3) + share * from) * scale;
            let triangles = triangles.map(|corners| corners.map(|corner| corner * scale));
            // Those without an area do not count, and are in no block.
            let has_area = triangles.map(|corners| !is_zero_area(corners));
            let mut block = Block::EMPTY;
            let mut faces = [[[0.0; LANES]; 2]; 3];
            let mut squares = [0.0; LANES];
            for (lane, corners) in triangles.into_iter().enumerate() {
                block.set(lane, 0, corners);
                if has_area[lane] {
                    squares[lane] = Foot::new(point, corners).squared;
                }
                let bounds = Aabb::around(corners);
                for (axis, [starts, ends]) in faces.iter_mut().enumerate() {
                    starts[lane] = bounds.min[axis];
                    ends[lane] = bounds.max[axis];
                }
            }
            let bounds = Aabb::around(triangles.into_iter().flatten());
            let reach = Reach::new(point, &bounds);
            let kept = Kept { reach, block: &block, faces, squares };
            for level in [Level::portable(), Level::detect()] {
                let is_kept = level.run(&kept);
                let is_lost = (0..LANES).any(|lane| has_area[lane] && !is_kept[lane]);
                prop_assert!(!is_lost, "{level}: {point} {triangles:?}, {is_kept:?}");
            }
        }
    }
}
