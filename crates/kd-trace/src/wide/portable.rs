//! A ray for wide nodes and blocks on any processor: the portable twin of `avx2`.

use std::ops::ControlFlow;

use kd_core::Ray;
use kd_simd::{Portable, max, min};
use kd_wide::{Block, Child, WIDTH, WideNode};

use super::stack::Pending;
use super::walk::WideRay;
use crate::collect::Collect;
use crate::dispatch::TraceSimd;
use crate::planes::{Frame, RayPlanes};
use crate::probe::Probe;
use crate::triangle::TriangleTest;

/// The order of the lanes themselves.
const IN_LANES: u32 = 0o76_543_210;

impl TraceSimd for Portable {
    type Ray = PortableRay;

    #[inline(always)]
    fn prepare(self, ray: &Ray, frame: &Frame) -> Option<PortableRay> {
        PortableRay::new(ray, frame)
    }
}

/// A ray for any processor.
pub(crate) struct PortableRay {
    planes: RayPlanes,
    test: TriangleTest,
    octant: usize,
    start: f32,
    end: f32,
}

impl PortableRay {
    /// `None` if the ray cannot hit anything.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, frame: &Frame) -> Option<Self> {
        if !ray.can_hit() {
            return None;
        }
        let planes = RayPlanes::new(ray, frame);
        let sign = |axis: usize| usize::from(planes.is_downwards(axis)) << axis;
        Some(Self {
            test: TriangleTest::new(ray, planes.reach()),
            octant: sign(0) | sign(1) | sign(2),
            start: planes.steps(ray.t_min),
            end: planes.steps(ray.t_max),
            planes,
        })
    }
}

impl WideRay for PortableRay {
    #[inline(always)]
    fn end(&self) -> f32 {
        self.end
    }

    #[inline(always)]
    fn steps(&self, t: f32) -> f32 {
        self.planes.steps(t)
    }

    #[inline(always)]
    fn enter<const ANY: bool>(
        &self,
        node: &WideNode,
        limit: f32,
        pending: &mut Pending<'_>,
    ) -> Option<Child> {
        let mut enters = [self.start; WIDTH];
        let mut exits = [limit; WIDTH];
        for (axis, faces) in node.faces.iter().enumerate() {
            let near = usize::from(self.planes.is_downwards(axis));
            for lane in 0..WIDTH {
                // NaN does not count: what overflows is visited.
                enters[lane] = max(
                    self.planes.crossing(axis, faces[near][lane]).first,
                    enters[lane],
                );
                exits[lane] = min(
                    self.planes.crossing(axis, faces[near ^ 1][lane]).last,
                    exits[lane],
                );
            }
        }
        let order = if ANY {
            IN_LANES
        } else {
            node.orders[self.octant]
        };
        let far_to_near = (0..WIDTH).map(|place| (order >> (3 * place) & 7) as usize);
        let mut nearest: Option<usize> = None;
        for lane in far_to_near.filter(|lane| enters[*lane] <= exits[*lane]) {
            if let Some(farther) = nearest.replace(lane) {
                pending.push(enters[farther], node.children[farther]);
            }
        }
        nearest.map(|lane| node.children[lane])
    }

    #[inline(always)]
    fn visit<C: Collect, P: Probe>(
        &self,
        blocks: &[Block],
        _: f32,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        self.test.visit(blocks, collector, probe)
    }
}
