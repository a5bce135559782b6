//! The beam: intervals around a group of rays, tested against eight boxes at a time.
//!
//! Origins and inverse directions are intervals on each axis. The rays cross a face within the product of the two. (S. Boulos,
//! I. Wald, P. Shirley, *Geometric and Arithmetic Culling Methods for Entire Ray Packets*, 2006.) Each end of it is computed
//! like the crossing of a ray, `(s - o) / d`, with its error, so the [bound](crate::planes) is the widest of all rays in the
//! group.

use kd_core::RayPacket8;
use kd_simd::{LANES, Number, Simd};
use kd_wide::{Block, WideNode};

use super::slabs::{Slabs, in_memory};

/// Intervals around a group of rays.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beam {
    /// The origins of the first and the last ray to cross a face.
    first: [f32; 3],
    last: [f32; 3],
    /// The ends of the interval of `t` per unit of each axis.
    inverse: [[f32; 3]; 2],
    pad: [f32; 3],
    /// The near face: 0 for the lower one, 1 for the upper.
    near: [usize; 3],
    start: f32,
}

impl Beam {
    /// Around some lanes of a packet, at least one.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        packet: &RayPacket8,
        slabs: &Slabs<S::F32>,
        lanes: u32,
    ) -> Self {
        let [from_x, from_y, from_z] = &packet.origin;
        let [x, y, z] = slabs.inverses();
        let pads = slabs.pads();
        let starts = slabs.starts();
        let first = lanes.trailing_zeros() as usize % LANES;
        let columns = simd.transpose([from_x, from_y, from_z, &x, &y, &z, &starts, &starts]);
        let of_pads = simd.transpose([
            &pads[0], &pads[1], &pads[2], &starts, &starts, &starts, &starts, &starts,
        ]);
        let (mut least, mut most) = (columns[first], columns[first]);
        let mut pad = of_pads[first];
        for lane in 0..LANES {
            if lanes >> lane & 1 != 0 {
                least = columns[lane].min(least);
                most = columns[lane].max(most);
                pad = of_pads[lane].max(pad);
            }
        }
        let (least, most, pad) = (in_memory(least), in_memory(most), in_memory(pad));
        let near = slabs.near();
        let (mut first, mut last) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            (first[axis], last[axis]) = if near[axis] == 0 {
                (most[axis], least[axis])
            } else {
                (least[axis], most[axis])
            };
        }
        Self {
            first,
            last,
            inverse: [[least[3], least[4], least[5]], [most[3], most[4], most[5]]],
            pad: [pad[0], pad[1], pad[2]],
            near,
            start: least[6],
        }
    }

    /// The boxes that rays which end at `limit` or before may meet.
    #[inline(always)]
    pub(super) fn meets<S: Simd, B: Boxes<S>>(
        &self,
        simd: S,
        boxes: &B,
        limit: f32,
    ) -> <S::F32 as Number>::Mask {
        let mut enters = simd.splat(self.start);
        let mut leaves = simd.splat(limit);
        for axis in 0..3 {
            let pad = simd.splat(self.pad[axis]);
            let [least, most] = &self.inverse;
            let (least, most) = (simd.splat(least[axis]), simd.splat(most[axis]));
            let near = boxes.face(simd, axis, self.near[axis]) - simd.splat(self.first[axis]);
            enters = ((near * least).min(near * most) - pad).max(enters);
            let far = boxes.face(simd, axis, self.near[axis] ^ 1) - simd.splat(self.last[axis]);
            leaves = ((far * least).max(far * most) + pad).min(leaves);
        }
        enters.le(leaves)
    }
}

/// Eight boxes.
pub(super) trait Boxes<S: Simd> {
    /// Their faces across an axis: 0 for the lower ones, 1 for the upper.
    fn face(&self, simd: S, axis: usize, side: usize) -> S::F32;
}

/// The boxes of the children.
impl<S: Simd> Boxes<S> for WideNode {
    #[inline(always)]
    fn face(&self, simd: S, axis: usize, side: usize) -> S::F32 {
        simd.load(&self.faces[axis][side])
    }
}

/// The boxes around each triangle.
impl<S: Simd> Boxes<S> for Block {
    #[inline(always)]
    fn face(&self, simd: S, axis: usize, side: usize) -> S::F32 {
        let [a, b, c] = &self.corners;
        let (a, b, c) = (
            simd.load(&a[axis]),
            simd.load(&b[axis]),
            simd.load(&c[axis]),
        );
        if side == 0 {
            a.min(b).min(c)
        } else {
            a.max(b).max(c)
        }
    }
}
