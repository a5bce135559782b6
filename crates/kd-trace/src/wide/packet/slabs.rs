//! Slabs: where eight rays of one octant cross the faces of boxes, with the bound of [`planes`](crate::planes).

use kd_core::RayPacket8;
use kd_simd::{F32x8, LANES, Simd};
use kd_wide::WideNode;

use crate::planes::{Frame, LEAST_SLOPE, PER_ORIGIN, PER_REACH, PER_STEP, RELATIVE};

/// Eight rays with the same signs of direction. Distances are in `t`.
pub(super) struct Slabs<F> {
    /// `t` per unit of each axis.
    inverse: [F; 3],
    /// The bound.
    pad: [F; 3],
    /// Added for a near face: minus the origin's distance, minus the bound.
    enter: [F; 3],
    /// Added for a far face: minus the origin's distance, plus the bound.
    exit: [F; 3],
    start: F,
    /// The near face: 0 for the lower one, 1 for the upper.
    near: [usize; 3],
    reach: F,
}

impl<F: F32x8> Slabs<F> {
    /// For rays within the [limits](super::super::limits). Other lanes hold meaningless values.
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

    /// The begins of the rays.
    #[inline(always)]
    pub(super) fn starts(&self) -> [f32; LANES] {
        in_memory(self.start)
    }

    /// The distances at which the rays enter and leave a child's box.
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
