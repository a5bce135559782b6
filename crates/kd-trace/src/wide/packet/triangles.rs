//! Eight rays and the triangles of a block, one after another.
//!
//! [`TriangleTest`](crate::triangle::TriangleTest) for eight rays: f32 rejects by the same bound, and the remaining rays are
//! [decided](crate::wide::eight).

use kd_core::RayPacket8;
use kd_simd::{F32x8, Mask, Number, Simd, each, max_lane};
use kd_wide::Block;

use super::beam::Beam;
use super::{Bits, Found};
use crate::collect::Collect;
use crate::triangle::{BLUR, SLOPE};
use crate::wide::eight::{BlockLane, Rays, decide};

/// Eight rays whose directions are largest on the same axis.
pub(super) struct Triangles<'a, F> {
    rays: Rays<'a>,
    /// Across, across and along, as in `rays`.
    origin: [F; 3],
    /// Negated steps across per step along.
    shear: [F; 2],
    /// The slope of the bound of edge functions.
    slope: F,
    blur: F,
}

impl<'a, F: F32x8> Triangles<'a, F> {
    #[inline(always)]
    pub(super) fn new<S: Simd<F32 = F>>(
        simd: S,
        packet: &'a RayPacket8,
        axes: [usize; 3],
        reach: F,
    ) -> Self {
        let rays = Rays {
            axes,
            origin: each(axes, |axis| &packet.origin[axis]),
            direction: each(axes, |axis| &packet.direction[axis]),
            t_min: &packet.t_min,
            t_max: &packet.t_max,
        };
        let [x, y, along] = rays.direction;
        let (x, y, along) = (simd.load(x), simd.load(y), simd.load(along));
        let [from_x, from_y, from_z] = rays.origin;
        let zero = simd.splat(0.0);
        Self {
            origin: [simd.load(from_x), simd.load(from_y), simd.load(from_z)],
            shear: [(zero - x) / along, (zero - y) / along],
            slope: reach * simd.splat(SLOPE),
            blur: reach * simd.splat(BLUR),
            rays,
        }
    }

    /// Finds every hit of the rays of some lanes in a block.
    #[inline(always)]
    pub(super) fn visit<S: Simd<F32 = F>, C: Collect>(
        &self,
        simd: S,
        block: &Block,
        beam: &Beam,
        lanes: u32,
        found: &mut Found<C>,
    ) {
        // Lanes without a triangle hold NaN, which are met.
        let coordinate = simd.load(&block.corners[0][0]);
        let there = coordinate.le(coordinate).bits();
        let met = beam.meets(simd, block, max_lane(&found.limits)).bits() & there;
        for lane in Bits(met) {
            let may_hit = self.may_hit(simd, block, lane) & lanes;
            if may_hit != 0 {
                let place = BlockLane { block, lane };
                let decided = decide(simd, &self.rays, place);
                for ray in Bits(decided.is_hit & may_hit) {
                    found.take(ray, decided.hit(ray, place.triangle()));
                }
            }
        }
    }

    /// The rays that may hit a triangle.
    #[inline(always)]
    fn may_hit<S: Simd<F32 = F>>(&self, simd: S, block: &Block, lane: usize) -> u32 {
        let [a, b, c] = [
            self.corner(simd, block, lane, 0),
            self.corner(simd, block, lane, 1),
            self.corner(simd, block, lane, 2),
        ];
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        let size = size(a).max(size(b)).max(size(c));
        let bound = (size + self.blur).mul_add(self.slope, simd.splat(f32::MIN_POSITIVE));
        let (lowest, highest) = (u.min(v).min(w), u.max(v).max(w));
        let is_inside = (simd.splat(0.0) - bound).le(lowest) | highest.le(bound);
        is_inside.bits()
    }

    /// A corner as the rays see it: its coordinates across.
    #[inline(always)]
    fn corner<S: Simd<F32 = F>>(
        &self,
        simd: S,
        block: &Block,
        lane: usize,
        corner: usize,
    ) -> [F; 2] {
        let rows = &block.corners[corner];
        let [x, y, along] = self.rays.axes;
        let x = simd.splat(rows[x][lane]) - self.origin[0];
        let y = simd.splat(rows[y][lane]) - self.origin[1];
        let z = simd.splat(rows[along][lane]) - self.origin[2];
        [z.mul_add(self.shear[0], x), z.mul_add(self.shear[1], y)]
    }
}

/// The largest coordinate.
#[inline(always)]
fn size<N: Number>([x, y]: [N; 2]) -> N {
    x.abs().max(y.abs())
}

#[inline(always)]
fn edge<N: Number>(p: [N; 2], q: [N; 2]) -> N {
    p[0] * q[1] - p[1] * q[0]
}
