//! A ray for wide nodes and blocks on any processor: the portable twin of `avx2`.

use std::ops::ControlFlow;

use kd_core::{Hit, Ray};
use kd_simd::{Portable, max, min};
use kd_wide::{Block, Child, WIDTH, WideBoxes, WideNode, WideTree};

use super::batch::Query;
use super::batch_ray::{BatchRay, Entry, IN_LANES};
use super::placed::InPlaced;
use super::stack::Pending;
use super::subtree::Subtree;
use super::walk::walk;
use crate::collect::{Any, Closest, Collect};
use crate::dispatch::{NO_HIT, TraceSimd};
use crate::items::{Items, VisitItem};
use crate::planes::{Frame, RayPlanes};
use crate::probe::Probe;
use crate::triangle::TriangleTest;

impl TraceSimd for Portable {
    type ClosestInBatch = PortableBatchRay<Closest>;
    type AnyInBatch = PortableBatchRay<Any>;

    #[inline(always)]
    fn collect<C: Collect, P: Probe>(
        self,
        subtree: Subtree<'_>,
        ray: &Ray,
        collector: &mut C,
        probe: &mut P,
    ) {
        if let Some(ray) = PortableRay::new(ray, subtree.tree().frame()) {
            walk(subtree, &ray, collector, probe);
        }
    }

    #[inline(always)]
    fn collect_placed<C: Collect, P: Probe>(self, placed: InPlaced<'_, C>, probe: &mut P) {
        placed.walk(self, probe);
    }

    #[inline(always)]
    fn closest<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> Hit {
        let mut closest = Closest::default();
        self.collect(subtree, ray, &mut closest, probe);
        closest.0.unwrap_or(NO_HIT)
    }

    #[inline(always)]
    fn any<P: Probe>(self, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> bool {
        let mut any = Any::default();
        self.collect(subtree, ray, &mut any, probe);
        any.0
    }

    #[inline(always)]
    fn boxes<V: VisitItem>(self, boxes: &WideBoxes, frame: &Frame, ray: &Ray, visitor: &mut V) {
        if let Some(ray) = PortableRay::new(ray, frame) {
            walk(
                Subtree::whole(boxes.as_wide()),
                &ray,
                &mut Items(visitor),
                &mut (),
            );
        }
    }
}

/// A ray for any processor.
pub(crate) struct PortableRay {
    planes: RayPlanes,
    test: TriangleTest,
    octant: usize,
    start: f32,
    /// The end of the ray, or a hit.
    pub(super) end: f32,
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

    /// A value of `t` in steps.
    #[inline(always)]
    pub(super) fn steps(&self, t: f32) -> f32 {
        self.planes.steps(t)
    }

    /// Where the ray enters the boxes of eight children, and where it leaves them, at the latest at `limit`. It meets a box that it
    /// enters before.
    #[inline(always)]
    fn meet(&self, node: &WideNode, limit: f32) -> [[f32; WIDTH]; 2] {
        self.slabs(|axis, side| &node.faces[axis][side], limit)
    }

    /// [`meet`](Self::meet) for the boxes of a block of items. Meaningless in lanes without an item.
    #[inline(always)]
    pub(super) fn meet_items(&self, block: &Block, limit: f32) -> [[f32; WIDTH]; 2] {
        self.slabs(|axis, side| &block.corners[side][axis], limit)
    }

    /// `faces` are the lower and the upper ones of eight boxes, by axis.
    #[inline(always)]
    fn slabs<'a>(
        &self,
        faces: impl Fn(usize, usize) -> &'a [f32; WIDTH],
        limit: f32,
    ) -> [[f32; WIDTH]; 2] {
        let mut enters = [self.start; WIDTH];
        let mut exits = [limit; WIDTH];
        for axis in 0..3 {
            let near = usize::from(self.planes.is_downwards(axis));
            let [near, far] = [faces(axis, near), faces(axis, near ^ 1)];
            for lane in 0..WIDTH {
                // NaN does not count: what overflows is visited.
                enters[lane] = max(self.planes.crossing(axis, near[lane]).first, enters[lane]);
                exits[lane] = min(self.planes.crossing(axis, far[lane]).last, exits[lane]);
            }
        }
        [enters, exits]
    }

    /// The nearest child whose box the ray may meet up to `limit`. Pushes the other ones, farthest first.
    ///
    /// With `ANY`, the child in the last lane, where a hit is likely for little work; the other ones are pushed in the order of
    /// their lanes.
    #[inline(always)]
    pub(super) fn enter<const ANY: bool>(
        &self,
        node: &WideNode,
        limit: f32,
        pending: &mut Pending<'_>,
    ) -> Option<Child> {
        let [enters, exits] = self.meet(node, limit);
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

    /// Passes every hit in the blocks to the collector. Breaks if the collector does.
    #[inline(always)]
    pub(super) fn visit<C: Collect, P: Probe>(
        &self,
        blocks: &[Block],
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        self.test.visit(blocks, collector, probe)
    }
}

/// A ray of many, with the collector of its answer.
pub(crate) struct PortableBatchRay<C>(C);

impl<C: Query, S> BatchRay<S> for PortableBatchRay<C> {
    const ANY: bool = C::ANY;
    type Answer = C::Answer;
    type Nodes = PortableRay;

    #[inline(always)]
    fn begin(_: S, ray: &Ray, frame: &Frame) -> Option<(PortableRay, Self)> {
        Some((PortableRay::new(ray, frame)?, Self(C::default())))
    }

    #[inline(always)]
    fn octant(nodes: &PortableRay) -> usize {
        nodes.octant
    }

    #[inline(always)]
    fn limit(nodes: &PortableRay) -> f32 {
        nodes.end
    }

    #[inline(always)]
    fn divide(
        _: S,
        rays: &[PortableRay],
        list: &[Entry],
        node: &WideNode,
        lists: &mut [Entry],
    ) -> [u32; WIDTH] {
        let mut lens = [0; WIDTH];
        for entry in list {
            let ray = &rays[entry.ray as usize];
            let [enters, exits] = ray.meet(node, ray.end);
            for lane in 0..WIDTH {
                let enter = enters[lane];
                lists[lane * list.len() + lens[lane] as usize] = Entry { enter, ..*entry };
                lens[lane] += u32::from(enter <= exits[lane]);
            }
        }
        lens
    }

    #[inline(always)]
    fn enter_or_pop(nodes: &PortableRay, node: &WideNode, pending: &mut Pending<'_>) -> Child {
        nodes
            .enter::<false>(node, nodes.end, pending)
            .unwrap_or_else(|| pending.pop_last())
    }

    #[inline(always)]
    fn trace_below(&mut self, nodes: &mut PortableRay, subtree: Subtree<'_>, _: &Ray) {
        walk(subtree, nodes, &mut self.0, &mut ());
        nodes.end = if self.0.is_done() {
            f32::NEG_INFINITY
        } else {
            min(nodes.steps(self.0.limit()), nodes.end)
        };
    }

    #[inline(always)]
    fn answer(&self, _: &WideTree) -> C::Answer {
        self.0.answer()
    }
}
