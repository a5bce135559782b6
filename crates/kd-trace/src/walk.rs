//! The one traversal loop.
//!
//! Recursive descent with near and far child as in V. Havran, *Heuristic Ray Shooting Algorithms*, 2000 (his TA-B),
//! unrolled into a loop with a stack. The near child is told by the direction alone, not by the side that the origin
//! lies on: with planes that are crossed somewhere in an interval the side is not certain, and in line order the
//! direction is right for negative `t` as well.

use std::ops::ControlFlow;

use kd_core::{Aabb, MAX_DEPTH, Node, NodeIndex, Ray};
use kd_simd::{max, min};

use crate::collect::Collect;
use crate::planes::{Frame, RayPlanes, Span};
use crate::probe::Probe;
use crate::triangle::TriangleTest;

/// A node to visit later. Indices have 30 bits, so u32 keeps it at 12 bytes.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    place: u32,
    span: Span,
}

/// A ray, ready to be asked about planes and triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedRay {
    pub(crate) planes: RayPlanes,
    test: TriangleTest,
}

impl PreparedRay {
    /// For triangles within a box, with the part of the ray that may hit them; `None` if there is none.
    #[inline(always)]
    pub(crate) fn new(ray: &Ray, bounds: &Aabb) -> Option<(Self, Span)> {
        if bounds.is_empty() || !ray.can_hit() {
            return None;
        }
        let planes = RayPlanes::new(ray, &Frame::new(bounds));
        let span = planes.clip(ray, bounds)?;
        let test = TriangleTest::new(ray, planes.reach());
        Some((Self { planes, test }, span))
    }
}

/// Where a walk begins.
pub(crate) trait Begin {
    /// A ray ready for a tree with these bounds, and the part of it to walk; `None` if there is none.
    fn begin(self, bounds: &Aabb) -> Option<(PreparedRay, Span)>;
}

/// A ray from outside.
impl Begin for &Ray {
    #[inline(always)]
    fn begin(self, bounds: &Aabb) -> Option<(PreparedRay, Span)> {
        PreparedRay::new(self, bounds)
    }
}

/// A ray on its way through a larger tree, which it was prepared for.
impl Begin for (&PreparedRay, Span) {
    #[inline(always)]
    fn begin(self, _: &Aabb) -> Option<(PreparedRay, Span)> {
        Some((*self.0, self.1))
    }
}

/// What can be walked: nodes, and something at their leaves. Valid in the sense of
/// [`Arena::freeze`](kd_core::Arena::freeze).
pub(crate) trait Walkable {
    fn bounds(&self) -> Aabb;
    fn root(&self) -> NodeIndex;
    /// Child indices refer to this slice.
    fn nodes(&self) -> &[Node];
    /// Gives the collector every hit of a leaf's triangles that it may want; breaks if it does.
    fn visit<C: Collect, P: Probe>(
        &self,
        leaf: Node,
        test: &TriangleTest,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()>;
}

/// Gives the collector every hit of the ray that it may want, some of them more than once, roughly front to back.
///
/// Always inlined, so that it is compiled for the instructions that its caller may use.
#[inline(always)]
pub(crate) fn walk<W: Walkable, C: Collect, P: Probe>(
    tree: &W,
    ray: impl Begin,
    collector: &mut C,
    probe: &mut P,
) {
    let Some((PreparedRay { planes, test }, mut span)) = ray.begin(&tree.bounds()) else {
        return;
    };
    let nodes = tree.nodes();
    // A valid tree has at most MAX_DEPTH nodes on a path that leave something behind. (Tried, 2026-11-24: no checks of
    // bounds in this loop, no difference; a `SmallVec`, 2 to 20 % slower. Not clearing the stack would gain 2 %, and is
    // not worth `unsafe`.)
    let mut stack = [Pending::default(); MAX_DEPTH];
    let mut pending = 0;
    let mut node = nodes[tree.root().index()];
    loop {
        while !node.is_leaf() {
            probe.node();
            let crossing = planes.crossing(node.tag(), node.split());
            let near = node.first_child().0 ^ crossing.near;
            // Both conditions are false for NaN, and they cannot both be true.
            let place = if span.exit < crossing.first {
                near
            } else if span.enter > crossing.last {
                near ^ 1
            } else {
                stack[pending] = Pending {
                    place: near ^ 1,
                    span: Span {
                        enter: max(crossing.first, span.enter),
                        exit: span.exit,
                    },
                };
                pending += 1;
                span.exit = min(crossing.last, span.exit);
                near
            };
            node = nodes[place as usize];
        }
        probe.leaf(node.count());
        // A hit counts wherever it lies, even outside of this leaf's cell: it is as good as any.
        if tree.visit(node, &test, collector, probe).is_break() {
            return;
        }
        let limit = planes.steps(collector.limit());
        loop {
            if pending == 0 {
                return;
            }
            pending -= 1;
            let next = stack[pending];
            // At the limit itself a lower triangle may lie.
            if next.span.enter <= limit {
                span = Span {
                    exit: min(limit, next.span.exit),
                    ..next.span
                };
                node = nodes[next.place as usize];
                break;
            }
        }
    }
}
