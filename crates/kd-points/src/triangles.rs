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
