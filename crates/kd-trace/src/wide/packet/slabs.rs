//! Where eight rays cross the faces of boxes: the bound of [`planes`](crate::planes), for rays of one octant.

use kd_core::RayPacket8;
use kd_simd::{F32x8, LANES, Simd};
use kd_wide::WideNode;

use crate::planes::{Frame, LEAST_SLOPE, PER_ORIGIN, PER_REACH, PER_STEP, RELATIVE};

/// Eight rays that go the same way on every axis. Distances are in `t`.
pub(super) struct Slabs<F> {
    /// `t` per unit of each axis.
    inverse: [F; 3],
    /// The bound.
    pad: [F; 3],
    /// What to add for a face that is entered through: minus the origin's, less the bound.
    enter: [F; 3],
    /// What to add for a face that is left through: minus the origin's, and the bound.
    exit: [F; 3],
    start: F,
    /// Which face is entered through: 0 for the lower one, 1 for the upper.
    near: [usize; 3],
    reach: F,
}

impl<F: F32x8> Slabs<F> {
    /// Of rays of usual sizes, those in lanes that count: what is computed for others means nothing.
    #[inline(always)]
    pub(super) fn new<S: Simd<F32 = F>>(
        simd: S,
        frame: &Frame,
        packet: &RayPacket8,
        octant: usize,
    ) -> Self {
        let [x, y, z] = &packet.direction;
        let (x, y, z) = (simd.load(x).abs(), simd.load(y).abs(), simd.load(z).abs());
        let sizes = [x, y, z];
        let [from_x, from_y, from_z] = &packet.origin;
        let origin = [simd.load(from_x), simd.load(from_y), simd.load(from_z)];
        let least = x.max(y).max(z) * simd.splat(LEAST_SLOPE);
        let near = [0, 1, 2].map(|axis| octant >> axis & 1);
        let [lower, upper] = &frame.corners;
        let mut reaches = [simd.splat(0.0); 3];
        for axis in 0..3 {
            let lower = (simd.splat(lower[axis]) - origin[axis]).abs();
            reaches[axis] = lower.max((simd.splat(upper[axis]) - origin[axis]).abs());
        }
        let reach = reaches[0].max(reaches[1]).max(reaches[2]);
        let every = reach.mul_add(simd.splat(PER_REACH), simd.splat(frame.distance));
        let none = [simd.splat(0.0); 3];
        let (mut inverse, mut pad, mut enter, mut exit) = (none, none, none, none);
        for axis in 0..3 {
            let sign = if near[axis] == 0 { 1.0 } else { -1.0 };
            inverse[axis] = simd.splat(sign) / sizes[axis].max(least);
            let distance = reaches[axis].mul_add(simd.splat(RELATIVE), every);
            let distance = origin[axis].abs().mul_add(simd.splat(PER_ORIGIN), distance);
            pad[axis] = distance.mul_add(inverse[axis].abs(), simd.splat(PER_STEP));
            let from = (simd.splat(0.0) - origin[axis]) * inverse[axis];
            (enter[axis], exit[axis]) = (from - pad[axis], from + pad[axis]);
        }
        Self {
            inverse,
            pad,
            enter,
            exit,
            // A hit is at a finite t.
            start: simd.load(&packet.t_min).max(simd.splat(-f32::MAX)),
            near,
            reach,
        }
    }

    /// The largest component of (corner - origin), up to rounding.
    #[inline(always)]
    pub(super) fn reach(&self) -> F {
        self.reach
    }

    #[inline(always)]
    pub(super) fn near(&self) -> [usize; 3] {
        self.near
    }

    #[inline(always)]
    pub(super) fn inverses(&self) -> [[f32; LANES]; 3] {
        let [x, y, z] = self.inverse;
        [in_memory(x), in_memory(y), in_memory(z)]
    }

    #[inline(always)]
    pub(super) fn pads(&self) -> [[f32; LANES]; 3] {
        let [x, y, z] = self.pad;
        [in_memory(x), in_memory(y), in_memory(z)]
    }

    /// Where the rays start.
    #[inline(always)]
    pub(super) fn starts(&self) -> [f32; LANES] {
        in_memory(self.start)
    }

    /// Where the rays enter a child's box, and where they leave it.
    #[inline(always)]
    pub(super) fn span<S: Simd<F32 = F>>(&self, simd: S, node: &WideNode, lane: usize) -> (F, F) {
        let (mut enters, mut leaves) = (self.start, simd.splat(f32::INFINITY));
        for axis in 0..3 {
            let near = self.near[axis];
            let [near, far] = [near, near ^ 1].map(|side| node.faces[axis][side][lane]);
            let entered = simd
                .splat(near)
                .mul_add(self.inverse[axis], self.enter[axis]);
            let left = simd.splat(far).mul_add(self.inverse[axis], self.exit[axis]);
            (enters, leaves) = (entered.max(enters), left.min(leaves));
        }
        (enters, leaves)
    }
}

#[inline(always)]
pub(super) fn in_memory<F: F32x8>(x: F) -> [f32; LANES] {
    let mut array = [0.0; LANES];
    x.store(&mut array);
    array
}
