//! Coherent rays and the triangles of a block.
//!
//! Corners are moved to the apex and sheared along the tile's central ray, once for all rays. Seen from there, another ray
//! is at (c + a z, d + b z) across at depth z, and a corner (x, y, z) is at (x - c - a z, y - d - b z) from it. In the edge
//! function of two corners p and q,
//!
//! ```text
//! (px - c - a pz)(qy - d - b qz) - (py - d - b pz)(qx - c - a qz)
//!     = (px qy - py qx) + a (py qz - pz qy) + b (pz qx - px qz) + c (py - qy) + d (qx - px) + (bc - ad)(qz - pz):
//! ```
//!
//! six numbers for each edge, and five multiply-adds for each ray. (They are Plücker's coordinates, from a point and along a
//! line nearby, so that they are small.) Where all rays start at the apex, c and d are zero, and two multiply-adds suffice.
//!
//! That bounds an edge function for a group at once. For each ray of such a group it is computed from the triangle's own
//! corners, since that is more precise for a small triangle than the apex.
//!
//! # The bound
//!
//! As in [`triangle`](crate::triangle), let u = 2⁻²⁴; here M is the largest coordinate across of the triangle in the central
//! ray's view, Z the largest depth, s the largest of |a| and |b| (at most [`MOST_SPREAD`]), P the largest of |c|, |d| and the
//! depths where rays start, S = M + sZ + P, which is at least any coordinate in any ray's view, and L = S + Z.
//!
//! - Coordinates: moving a corner to the apex errs by u(M + Z), and by uZ along; the shear's product by uZ, the difference by uM;
//!   a by u, half of it in the slope and half in its difference from the central one, which is uZ; c by 4.5uP; the rounding to 26
//!   bits that decides by u/4 S. That is at most 4.75uL. Where coordinates are computed for a ray, its products err by usZ, and
//!   sums by u(M + sZ) and uS. All of it is below e = 6uL, so two edge functions differ by 4eS + 2e².
//! - Evaluation for groups: the products of coordinates cost 4uM², the terms with a and b 8usMZ, those with c and d 4uPM, the last
//!   one 12usPZ, together at most 6uS². All terms add up to 2S² or less, also where the middle and the radius are summed apart: so
//!   five roundings of sums, one of all products and one of the result cost 14uS².
//!
//! The bound B = (8e + 40uS)(S + e) is twice that and more. (A search finds a fifth of it. Since S ≤ L, the first term alone
//! would be enough, but less than twice.)
//!
//! For one ray, from its own corners, the triangle's size is enough: the largest difference m of corner a and another one, across
//! and along. Where a triangle is hit, the two corners of an edge are together no further away across than 3m. So coordinates
//! cost 6em and 2e², and evaluation 9um². Where f32 finds it hit, it is hit exactly as seen with the coordinates in f32, since
//! products are rounded alike, and their difference has the right sign. Such corners are together no further away than
//! 3m + 4e, which costs 8e² more. The bound b = (12e + 20um)(m + 2e) is twice that and more. (A search finds a tenth. Again the
//! first term would be enough: m ≤ 2L.)
//!
//! A ray meets the plane of a triangle with the normal n at the depth `za - (nx lx + ny ly) / (nx a + ny b + nz)`, where l is
//! across from corner a to the ray, there. The normal is made from the differences of corners b and c from a, taken before
//! the shear; they are at most m across and d along, and err by u(2m + 3d) and ud. So nx and ny err by u(10m + 6d)d, and nz by
//! 12u(m + d)m. With l, at most m + sd, known up to e, the numerator errs by e(|nx| + |ny|) + u(28m + 12d)d(m + sd), the
//! denominator D by u(16m² + 16md + 30smd + 12sd²), and the quotient, at most d where the triangle is hit, by
//! (e(|nx| + |ny|) + 58u(m + d)(m + sd)d)/|D|. Twice that and more is allowed, and 12uL for rounding depths, the ray's ends, and
//! the `t` that is reported. (A search finds a fifth of the first, a twentieth of the second and a third of the last term.) Nor is
//! a hit nearer than the nearest corner, or farther than the farthest.

use kd_simd::{F32x8, LANES, Mask, Number, Simd};
use kd_wide::Block;

use super::frustum::Apex;

/// Slopes of a tile's rays from its central one: as far as they can be on a side of the cube. (Of 64 rays of a side, 237 ns
/// for 457 alone; within a quarter of it, 155 for 445. Mirrored rays in BART kitchen; throw-away
/// program, 2026-11-28.)
pub(super) const MOST_SPREAD: f32 = 1.0;

/// Numbers that describe a ray relative to the central one: a, b, c, d, bc - ad.
pub(super) const TERMS: usize = 5;
/// The numbers of rays that start at the apex: a, b.
pub(super) const TERMS_FROM_APEX: usize = 2;

const U: f32 = f32::EPSILON / 2.0;
/// 6 u: e over L.
const BLUR: f32 = 6.0 * U;

/// Eight triangles, prepared for a tile.
#[derive(Clone, Debug, Default)]
pub(super) struct Edges {
    /// By edge, opposite to corners a, b and c: the edge function of the central ray, and its growth with each term.
    center: [[f32; LANES]; 3],
    grow: [[[f32; LANES]; TERMS]; 3],
    /// Across, across, along.
    corners: [[[f32; LANES]; 3]; 3],
    normal: [[f32; LANES]; 3],
    /// The depths of the nearest and the farthest corner.
    nearest: [f32; LANES],
    farthest: [f32; LANES],
    /// Of edge functions, for groups, and for rays.
    bound: [f32; LANES],
    bound_alone: [f32; LANES],
    /// Of depths: times one over the denominator, and alone.
    bound_depth: [f32; LANES],
    rounding: [f32; LANES],
}

/// The view of a tile: its apex, axes and central ray.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct View {
    pub(super) apex: Apex,
    /// Across, across, along.
    pub(super) axes: [usize; 3],
    /// Of the central ray.
    pub(super) slope: [f32; 2],
    /// The largest slope of another ray from there.
    pub(super) spread: f32,
    /// The largest distance from the apex of an origin, or of a ray at depth 0: 0 if all rays start there.
    pub(super) apart: f32,
    /// The octant of the central ray, as in the orders of nodes.
    pub(super) octant: usize,
}

/// Prepares a block for a tile.
#[inline(always)]
pub(super) fn prepare<S: Simd, const TERMS: usize>(
    simd: S,
    view: &View,
    block: &Block,
    to: &mut Edges,
) {
    let rows = &block.corners;
    let (a, b, c) = (
        sheared(simd, view, corner(simd, view, &rows[0])),
        sheared(simd, view, corner(simd, view, &rows[1])),
        sheared(simd, view, corner(simd, view, &rows[2])),
    );
    for (edge, [p, q]) in [[c, b], [a, c], [b, a]].into_iter().enumerate() {
        (p[0] * q[1] - p[1] * q[0]).store(&mut to.center[edge]);
        let grow = &mut to.grow[edge];
        (p[1] * q[2] - p[2] * q[1]).store(&mut grow[0]);
        (p[2] * q[0] - p[0] * q[2]).store(&mut grow[1]);
        if TERMS > TERMS_FROM_APEX {
            (p[1] - q[1]).store(&mut grow[2]);
            (q[0] - p[0]).store(&mut grow[3]);
            (q[2] - p[2]).store(&mut grow[4]);
        }
    }
    let across = a[0].abs().max(a[1].abs()).max(b[0].abs());
    let across = across.max(b[1].abs()).max(c[0].abs()).max(c[1].abs());
    let depth = a[2].abs().max(b[2].abs()).max(c[2].abs());
    let size = depth.mul_add(simd.splat(view.spread), across) + simd.splat(view.apart);
    let reach = size + depth;
    let error = reach * simd.splat(BLUR);
    let bound = size
        .mul_add(simd.splat(40.0 * U), error * simd.splat(8.0))
        .mul_add(size + error, simd.splat(f32::MIN_POSITIVE));
    bound.store(&mut to.bound);
    let [x, y, z] = difference(simd, view, &rows[0], &rows[1]);
    let [p, q, r] = difference(simd, view, &rows[0], &rows[2]);
    let normal = [y * r - z * q, z * p - x * r, x * q - y * p];
    for (normal, to) in normal.into_iter().zip(&mut to.normal) {
        normal.store(to);
    }
    let across = x.abs().max(y.abs()).max(p.abs().max(q.abs()));
    let along = z.abs().max(r.abs());
    let both = across + along;
    if TERMS > TERMS_FROM_APEX {
        both.mul_add(simd.splat(20.0 * U), error * simd.splat(12.0))
            .mul_add(both + error + error, simd.splat(f32::MIN_POSITIVE))
            .store(&mut to.bound_alone);
        for (corner, to) in [a, b, c].into_iter().zip(&mut to.corners) {
            corner[0].store(&mut to[0]);
            corner[1].store(&mut to[1]);
            corner[2].store(&mut to[2]);
        }
    } else {
        bound.store(&mut to.bound_alone);
        a[0].store(&mut to.corners[0][0]);
        a[1].store(&mut to.corners[0][1]);
        a[2].store(&mut to.corners[0][2]);
    }
    let flat = normal[0].abs() + normal[1].abs();
    // Underflow is less than the first term.
    let tiny = both.mul_add(simd.splat(f32::MIN_POSITIVE), simd.splat(f32::MIN_POSITIVE));
    let aside = along.mul_add(simd.splat(view.spread), across);
    let cubed = (both * aside * along).mul_add(simd.splat(128.0 * U), tiny);
    (error * simd.splat(2.0))
        .mul_add(flat, cubed)
        .store(&mut to.bound_depth);
    let rounding = reach * simd.splat(12.0 * U);
    rounding.store(&mut to.rounding);
    (a[2].min(b[2]).min(c[2]) - rounding).store(&mut to.nearest);
    (a[2].max(b[2]).max(c[2]) + rounding).store(&mut to.farthest);
}

/// A corner of eight triangles from the apex: across, across, along.
#[inline(always)]
fn corner<S: Simd>(simd: S, view: &View, rows: &[[f32; LANES]; 3]) -> [S::F32; 3] {
    let [x, y, along] = view.axes;
    let at = &view.apex.at;
    [
        simd.load(&rows[x]) - simd.splat(at[0]),
        simd.load(&rows[y]) - simd.splat(at[1]),
        (simd.load(&rows[along]) - simd.splat(at[2])) * simd.splat(view.apex.sign),
    ]
}

/// From a corner of eight triangles to another, sheared.
#[inline(always)]
fn difference<S: Simd>(
    simd: S,
    view: &View,
    from: &[[f32; LANES]; 3],
    to: &[[f32; LANES]; 3],
) -> [S::F32; 3] {
    let [x, y, along] = view.axes;
    let difference = [
        simd.load(&to[x]) - simd.load(&from[x]),
        simd.load(&to[y]) - simd.load(&from[y]),
        (simd.load(&to[along]) - simd.load(&from[along])) * simd.splat(view.apex.sign),
    ];
    sheared(simd, view, difference)
}

/// Sheared along the central ray.
#[inline(always)]
fn sheared<S: Simd>(simd: S, view: &View, [x, y, z]: [S::F32; 3]) -> [S::F32; 3] {
    [
        z.mul_add(simd.splat(-view.slope[0]), x),
        z.mul_add(simd.splat(-view.slope[1]), y),
        z,
    ]
}

/// The range of a term in each group: its middle and its radius.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Range {
    pub(super) middle: [f32; LANES],
    pub(super) radius: [f32; LANES],
}

/// The triangles that a group of rays may hit between two depths: a bit for each lane.
#[inline(always)]
pub(super) fn may_be_hit<S: Simd, const TERMS: usize>(
    simd: S,
    edges: &Edges,
    ranges: &[Range; self::TERMS],
    group: usize,
    [start, limit]: [f32; 2],
) -> u32 {
    let bound = simd.load(&edges.bound);
    let (least_a, most_a) = between::<S, TERMS>(simd, edges, 0, ranges, group, bound);
    let (least_b, most_b) = between::<S, TERMS>(simd, edges, 1, ranges, group, bound);
    let (least_c, most_c) = between::<S, TERMS>(simd, edges, 2, ranges, group, bound);
    let zero = simd.splat(0.0);
    // False for NaN, in lanes without a triangle.
    let above = zero.le(most_a.min(most_b).min(most_c));
    let below = least_a.max(least_b).max(least_c).le(zero);
    let starts = simd.load(&edges.nearest).le(simd.splat(limit));
    let ends = simd.splat(start).le(simd.load(&edges.farthest));
    ((above | below) & starts & ends).bits()
}

/// The bounds of an edge function for the rays of a group.
#[inline(always)]
fn between<S: Simd, const TERMS: usize>(
    simd: S,
    edges: &Edges,
    edge: usize,
    ranges: &[Range; self::TERMS],
    group: usize,
    bound: S::F32,
) -> (S::F32, S::F32) {
    let (mut middle, mut radius) = (simd.load(&edges.center[edge]), bound);
    for (grow, range) in edges.grow[edge].iter().zip(ranges).take(TERMS) {
        let grow = simd.load(grow);
        middle = grow.mul_add(simd.splat(range.middle[group]), middle);
        radius = grow.abs().mul_add(simd.splat(range.radius[group]), radius);
    }
    (middle - radius, middle + radius)
}

/// A triangle as eight rays see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight<F: Number> {
    /// Rays that may hit it between their ends.
    pub(super) may_hit: F::Mask,
    /// Rays that surely hit it, if it is between their ends.
    pub(super) is_inside: F::Mask,
    /// The least and the largest depth of the hit.
    pub(super) nearest: F,
    pub(super) farthest: F,
}

/// A triangle and eight rays; `None` if none may hit it at any depth.
#[inline(always)]
pub(super) fn sight<S: Simd, const TERMS: usize>(
    simd: S,
    edges: &Edges,
    lane: usize,
    terms: &[S::F32; TERMS],
    [start, limit]: [S::F32; 2],
) -> Option<Sight<S::F32>> {
    let [a, b, c] = weights(simd, edges, lane, terms);
    let bound = edges.bound_alone[lane];
    let (least, most) = (a.min(b).min(c), a.max(b).max(c));
    let may_hit = simd.splat(-bound).le(least) | most.le(simd.splat(bound));
    if may_hit.bits() == 0 {
        return None;
    }
    let l = seen_from(simd, &edges.corners[0], lane, terms);
    let is_inside = simd.splat(bound).lt(least) | most.lt(simd.splat(-bound));
    let (depth, error) = depth(simd, edges, lane, terms, l);
    // The depth of a triangle seen edge-on is NaN: its corners bound it.
    let nearest = (depth - error).max(simd.splat(edges.nearest[lane]));
    let farthest = (depth + error).min(simd.splat(edges.farthest[lane]));
    Some(Sight {
        may_hit: may_hit & nearest.le(limit) & start.le(farthest),
        is_inside,
        nearest,
        farthest,
    })
}

/// The edge functions of a triangle, opposite to corners a, b and c, for eight rays.
#[inline(always)]
fn weights<S: Simd, const TERMS: usize>(
    simd: S,
    edges: &Edges,
    lane: usize,
    terms: &[S::F32; TERMS],
) -> [S::F32; 3] {
    if TERMS > TERMS_FROM_APEX {
        let corner_a = seen_from(simd, &edges.corners[0], lane, terms);
        let corner_b = seen_from(simd, &edges.corners[1], lane, terms);
        let corner_c = seen_from(simd, &edges.corners[2], lane, terms);
        [
            cross(corner_c, corner_b),
            cross(corner_a, corner_c),
            cross(corner_b, corner_a),
        ]
    } else {
        [
            edge(simd, edges, 0, lane, terms),
            edge(simd, edges, 1, lane, terms),
            edge(simd, edges, 2, lane, terms),
        ]
    }
}

/// The depths at which eight rays meet the plane of a triangle, and their bounds. `corner_a` is across from the rays.
#[inline(always)]
fn depth<S: Simd, const TERMS: usize>(
    simd: S,
    edges: &Edges,
    lane: usize,
    terms: &[S::F32; TERMS],
    corner_a: [S::F32; 2],
) -> (S::F32, S::F32) {
    let [x, y, z] = &edges.normal;
    let (x, y) = (simd.splat(x[lane]), simd.splat(y[lane]));
    let sum = x.mul_add(terms[0], y.mul_add(terms[1], simd.splat(z[lane])));
    let per_sum = simd.splat(1.0) / sum;
    // From the ray to corner a, so that the quotient is added.
    let behind = x.mul_add(corner_a[0], y * corner_a[1]);
    let depth = behind.mul_add(per_sum, simd.splat(edges.corners[0][2][lane]));
    let error = per_sum.abs().mul_add(
        simd.splat(edges.bound_depth[lane]),
        simd.splat(edges.rounding[lane]),
    );
    (depth, error)
}

/// The coordinates of a corner across, as eight rays see it.
#[inline(always)]
fn seen_from<S: Simd, const TERMS: usize>(
    simd: S,
    [x, y, z]: &[[f32; LANES]; 3],
    lane: usize,
    terms: &[S::F32; TERMS],
) -> [S::F32; 2] {
    let back = simd.splat(-z[lane]);
    let x = back.mul_add(terms[0], simd.splat(x[lane]));
    let y = back.mul_add(terms[1], simd.splat(y[lane]));
    if TERMS > TERMS_FROM_APEX {
        [x - terms[2], y - terms[3]]
    } else {
        [x, y]
    }
}

/// Not fused, so that its sign is right.
#[inline(always)]
fn cross<N: Number>(p: [N; 2], q: [N; 2]) -> N {
    p[0] * q[1] - p[1] * q[0]
}

/// The edge function of one triangle, for eight rays.
#[inline(always)]
fn edge<S: Simd, const TERMS: usize>(
    simd: S,
    edges: &Edges,
    edge: usize,
    lane: usize,
    terms: &[S::F32; TERMS],
) -> S::F32 {
    let mut sum = simd.splat(edges.center[edge][lane]);
    for (grow, term) in edges.grow[edge].iter().zip(terms) {
        sum = simd.splat(grow[lane]).mul_add(*term, sum);
    }
    sum
}

#[cfg(test)]
mod bounds;
