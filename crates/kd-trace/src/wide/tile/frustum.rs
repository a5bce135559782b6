//! Frusta around coherent rays, and the boxes that they meet.
//!
//! Depth z is measured from a point, the apex, along the axis of the largest components of the directions, so that depth
//! increases along every ray, and no slope across exceeds 1. Nothing is inverted, and rays parallel to an axis need no special
//! case. Across, the lowest of some rays is a concave function of the depth, and so nowhere below the line between its values at
//! two depths: each side of a frustum is such a line. Within a box, between the depths of its near and its far face, the
//! rays are above the smaller of the line's values there. The sign of the slope determines which one that is: so slopes are
//! stored as two numbers, of which one is zero.
//!
//! # The bound
//!
//! The bound of [`planes`](crate::planes) is on distances between faces and hits, times `|1/d|`, so here faces are moved by
//! the distances alone. The rounded quantities differ. Let u = 2⁻²⁴, Q the largest distance between the apex and a face of the
//! tree's box on an axis, A the apex's coordinate there, P the largest distance between the apex and a ray's start, and between it
//! and the place where the ray is at depth 0. Where a product of a slope and a depth is larger than Q + P, the line is on the right
//! side of a face for any rounding. Elsewhere the errors at a hit are
//!
//! - for the line's slope: u(Q + P) each for the slope of a ray, its product with the largest depth, the difference of places,
//!   and the quotient; u(Q + 2P) for the place at the largest depth;
//! - 4uP for the place at depth 0, besides the slope, and u(2A + P) for its sum with the apex's coordinate and the pad;
//! - u(Q + P) for the product with a depth, u(Q + A) for the sum, and u(3Q + 4P) for the depths at which rays start or end.
//!
//! That is at most 10uQ + 16uP + 3uA. Twice that is added, or more. (A search finds a seventh of what is for Q and P, and a third
//! of what is for A; a pad as small as uA is rounded to the neighbors of A, and so may be enough.) The depths of faces err by
//! less than the distances by which these are moved.
//!
//! The slopes of single rays are known relative to the central one. With the tile's spread s, that adds usz at depth z, which
//! may be far more than uQ where a ray hardly moves across, and the central one does. So 2usz is added. (A search finds half.)

use kd_simd::{F32x8, LANES, Number, Simd};
use kd_wide::WideNode;

use super::leaf::View;
use crate::planes::{Frame, PER_REACH};

/// 2⁻¹⁹, of distances.
const PER_DISTANCE: f32 = 1.0 / (1 << 19) as f32;
/// 2⁻²¹, of the apex's coordinates.
const PER_COORDINATE: f32 = 1.0 / (1 << 21) as f32;

/// 2⁻²³, of depths times the spread of the tile.
const PER_SPREAD: f32 = f32::EPSILON;

/// 2⁻¹⁰⁰.
const LEAST_DEPTH: f32 = f32::from_bits((127 - 100) << 23);

/// The point of depth 0, in the order across, across, along.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Apex {
    pub(super) at: [f32; 3],
    /// 1 if depth increases with the coordinate, otherwise -1.
    pub(super) sign: f32,
    /// The distance by which faces are moved.
    pad: [f32; 3],
    /// The largest depth of a box.
    pub(super) deepest: f32,
}

impl Apex {
    /// `axes` are its axes; `apart` is the largest distance from it of an origin, or of a ray at depth 0.
    pub(super) fn new(
        at: [f32; 3],
        sign: f32,
        axes: [usize; 3],
        apart: f32,
        frame: &Frame,
    ) -> Self {
        let [lower, upper] = &frame.corners;
        let mut distances = [0.0; 3];
        for (i, axis) in axes.into_iter().enumerate() {
            distances[i] = (lower[axis] - at[i]).abs().max((upper[axis] - at[i]).abs());
        }
        let reach = distances.into_iter().fold(apart, f32::max);
        let mut pad = [0.0; 3];
        for (i, pad) in pad.iter_mut().enumerate() {
            *pad = frame.distance
                + PER_REACH * reach
                + PER_DISTANCE * (distances[i] + apart)
                + PER_COORDINATE * at[i].abs();
        }
        let last = if sign < 0.0 { lower } else { upper };
        Self {
            at,
            sign,
            pad,
            // Above zero: slopes are quotients by it.
            deepest: (sign * (last[axes[2]] - at[2]) + pad[2]).max(LEAST_DEPTH),
        }
    }

    /// The near and the far faces.
    #[inline(always)]
    fn sides(&self) -> [usize; 2] {
        if self.sign < 0.0 { [1, 0] } else { [0, 1] }
    }
}

/// Bounds of some rays across, by depth, and the depths between which they count.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Frustum<F> {
    lo: [Line<F>; 2],
    hi: [Line<F>; 2],
    pub(super) start: F,
    pub(super) limit: F,
}

/// A coordinate that is linear in depth.
#[derive(Clone, Copy, Debug, Default)]
struct Line<F> {
    /// At depth 0.
    at: F,
    /// Its slope if that is positive, or else zero.
    up: F,
    /// Its slope if that is negative, or else zero.
    down: F,
}

impl<F: Number> Line<F> {
    /// Through a coordinate at depth 0.
    #[inline(always)]
    fn new<S: Simd<F32 = F>>(simd: S, at: F, slope: F) -> Self {
        let zero = simd.splat(0.0);
        Self {
            at,
            up: slope.max(zero),
            down: slope.min(zero),
        }
    }

    #[inline(always)]
    fn store<S: Simd<F32 = F>>(self, _: S, to: &mut Line<[f32; LANES]>)
    where
        F: F32x8,
    {
        self.at.store(&mut to.at);
        self.up.store(&mut to.up);
        self.down.store(&mut to.down);
    }
}

impl Line<[f32; LANES]> {
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S) -> Line<S::F32> {
        Line {
            at: simd.load(&self.at),
            up: simd.load(&self.up),
            down: simd.load(&self.down),
        }
    }

    #[inline(always)]
    fn splat<S: Simd>(&self, simd: S, lane: usize) -> Line<S::F32> {
        Line {
            at: simd.splat(self.at[lane]),
            up: simd.splat(self.up[lane]),
            down: simd.splat(self.down[lane]),
        }
    }
}

/// Eight frusta side by side.
impl Frustum<[f32; LANES]> {
    /// Sets the bounds across one axis, from the apex: the least and the largest coordinate at depth 0, and the slopes of the
    /// two.
    #[inline(always)]
    pub(super) fn set<S: Simd>(
        &mut self,
        simd: S,
        apex: &Apex,
        axis: usize,
        at: [S::F32; 2],
        slope: [S::F32; 2],
    ) {
        let lo = at[0] + simd.splat(apex.at[axis] - apex.pad[axis]);
        let hi = at[1] + simd.splat(apex.at[axis] + apex.pad[axis]);
        Line::new(simd, lo, slope[0]).store(simd, &mut self.lo[axis]);
        Line::new(simd, hi, slope[1]).store(simd, &mut self.hi[axis]);
    }

    /// The frustum of one lane, in all lanes.
    #[inline(always)]
    pub(super) fn splat<S: Simd>(&self, simd: S, lane: usize) -> Frustum<S::F32> {
        let ([lo_x, lo_y], [hi_x, hi_y]) = (&self.lo, &self.hi);
        Frustum {
            lo: [lo_x.splat(simd, lane), lo_y.splat(simd, lane)],
            hi: [hi_x.splat(simd, lane), hi_y.splat(simd, lane)],
            start: simd.splat(self.start[lane]),
            limit: simd.splat(self.limit[lane]),
        }
    }

    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S) -> Frustum<S::F32> {
        let ([lo_x, lo_y], [hi_x, hi_y]) = (&self.lo, &self.hi);
        Frustum {
            lo: [lo_x.load(simd), lo_y.load(simd)],
            hi: [hi_x.load(simd), hi_y.load(simd)],
            start: simd.load(&self.start),
            limit: simd.load(&self.limit),
        }
    }
}

impl<F: F32x8> Frustum<F> {
    /// The least and the largest coordinate across one axis between two depths, moved.
    #[inline(always)]
    fn across(&self, axis: usize, [near, far]: [F; 2]) -> [F; 2] {
        let (lo, hi) = (&self.lo[axis], &self.hi[axis]);
        [
            far.mul_add(lo.down, near.mul_add(lo.up, lo.at)),
            near.mul_add(hi.down, far.mul_add(hi.up, hi.at)),
        ]
    }
}

/// Boxes, in the order of the apex's axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Boxes<F> {
    min: [F; 2],
    max: [F; 2],
    /// The near and the far faces along.
    near: F,
    far: F,
}

impl<F> Boxes<F> {
    /// The boxes of a node's children.
    #[inline(always)]
    pub(super) fn of_children<S: Simd<F32 = F>>(simd: S, view: &View, node: &WideNode) -> Self {
        let ([x, y, along], [near, far]) = (view.axes, view.apex.sides());
        let faces = &node.faces;
        Self {
            min: [simd.load(&faces[x][0]), simd.load(&faces[y][0])],
            max: [simd.load(&faces[x][1]), simd.load(&faces[y][1])],
            near: simd.load(&faces[along][near]),
            far: simd.load(&faces[along][far]),
        }
    }

    /// The box of one child, in all lanes.
    #[inline(always)]
    pub(super) fn of_child<S: Simd<F32 = F>>(
        simd: S,
        view: &View,
        node: &WideNode,
        lane: usize,
    ) -> Self {
        let ([x, y, along], [near, far]) = (view.axes, view.apex.sides());
        let faces = &node.faces;
        Self {
            min: [simd.splat(faces[x][0][lane]), simd.splat(faces[y][0][lane])],
            max: [simd.splat(faces[x][1][lane]), simd.splat(faces[y][1][lane])],
            near: simd.splat(faces[along][near][lane]),
            far: simd.splat(faces[along][far][lane]),
        }
    }
}

/// The depths of the near and the far faces, moved.
#[inline(always)]
fn depths<S: Simd>(simd: S, apex: &Apex, boxes: &Boxes<S::F32>) -> (S::F32, S::F32) {
    let sign = simd.splat(apex.sign);
    let from_apex = -apex.sign * apex.at[2];
    let least = simd.splat(from_apex - apex.pad[2]);
    let most = simd.splat(from_apex + apex.pad[2]);
    (
        boxes.near.mul_add(sign, least),
        boxes.far.mul_add(sign, most),
    )
}

/// The boxes that the frusta may meet, and from which depth on: one frustum and eight boxes, or one box and eight frusta.
#[inline(always)]
pub(super) fn meet<S: Simd>(
    simd: S,
    apex: &Apex,
    frusta: &Frustum<S::F32>,
    boxes: &Boxes<S::F32>,
) -> (<S::F32 as Number>::Mask, S::F32) {
    let (near, far) = depths(simd, apex, boxes);
    let (near, far) = (near.max(frusta.start), far.min(frusta.limit));
    let mut is_met = near.le(far);
    for axis in 0..2 {
        let [least, most] = frusta.across(axis, [near, far]);
        is_met = is_met & least.le(boxes.max[axis]) & boxes.min[axis].le(most);
    }
    (is_met, near)
}

/// The rays of eight that may meet a box, from their coordinates across at depth 0, from the apex, their slopes, and the depths
/// between which they count. The slopes are sums of the central slope and a difference.
#[inline(always)]
pub(super) fn meet_each<S: Simd>(
    simd: S,
    view: &View,
    at: [S::F32; 2],
    slope: [S::F32; 2],
    [start, limit]: [S::F32; 2],
    boxes: &Boxes<S::F32>,
) -> <S::F32 as Number>::Mask {
    let apex = &view.apex;
    let (near, far) = depths(simd, apex, boxes);
    let (near, far) = (near.max(start), far.min(limit));
    let mut is_met = near.le(far);
    for axis in 0..2 {
        let [least, most] = across(simd, view, axis, at[axis], slope[axis], [near, far]);
        is_met = is_met & least.le(boxes.max[axis]) & boxes.min[axis].le(most);
    }
    is_met
}

/// The least and the largest coordinate of eight rays across one axis between two depths, moved.
#[inline(always)]
fn across<S: Simd>(
    simd: S,
    view: &View,
    axis: usize,
    at: S::F32,
    slope: S::F32,
    [near, far]: [S::F32; 2],
) -> [S::F32; 2] {
    let apex = &view.apex;
    let there = simd.splat(apex.at[axis]);
    let ends = [
        slope.mul_add(near, at) + there,
        slope.mul_add(far, at) + there,
    ];
    let per_depth = simd.splat(PER_SPREAD * view.spread);
    let pad = far.mul_add(per_depth, simd.splat(apex.pad[axis]));
    [ends[0].min(ends[1]) - pad, ends[0].max(ends[1]) + pad]
}

#[cfg(test)]
mod bounds;
