//! The traversal loop over 8-byte nodes.
//!
//! Recursive descent with near and far child as in V. Havran, *Heuristic Ray Shooting Algorithms*, 2000 (his TA-B),
//! unrolled into a loop with a stack. The direction alone determines the near child, not the side of the origin: a plane is
//! crossed somewhere in an interval, so the side is not certain, and the direction is right for negative `t` as well.

use std::ops::ControlFlow;

use arrayvec::ArrayVec;
use kd_core::{Aabb, MAX_DEPTH, Node, NodeIndex, Ray};
use kd_simd::{max, min};

use crate::collect::Limited;
use crate::planes::{Frame, RayPlanes, Span};
use crate::probe::Probe;
use crate::triangle::TriangleTest;

/// A node to visit later. Indices have 30 bits, so u32 keeps it at 12 bytes.
#[derive(Clone, Copy, Debug)]
struct Pending {
    place: u32,
    span: Span,
}

/// A ray, prepared for planes and triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedRay {
    pub(crate) planes: RayPlanes,
    test: TriangleTest,
}

impl PreparedRay {
    /// For triangles within a box, with the part of the ray that may hit them; `None` if no part does.
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

/// The begin of a walk.
pub(crate) trait Begin {
    /// A ray prepared for a tree with these bounds, and the part of it to walk; `None` if it misses them.
    fn begin(self, bounds: &Aabb) -> Option<(PreparedRay, Span)>;
}

/// A ray that enters at the root.
impl Begin for &Ray {
    #[inline(always)]
    fn begin(self, bounds: &Aabb) -> Option<(PreparedRay, Span)> {
        PreparedRay::new(self, bounds)
    }
}

/// A ray inside a larger tree, which it was prepared for.
impl Begin for (&PreparedRay, Span) {
    #[inline(always)]
    fn begin(self, _: &Aabb) -> Option<(PreparedRay, Span)> {
        Some((*self.0, self.1))
    }
}

/// 8-byte nodes over some kind of leaves. Valid in the sense of [`Arena::freeze`](kd_core::Arena::freeze).
pub(crate) trait Walkable<C> {
    fn bounds(&self) -> Aabb;
    fn root(&self) -> NodeIndex;
    /// Child indices refer to this slice.
    fn nodes(&self) -> &[Node];
    /// Gives the collector what it may want of a leaf: every hit of its triangles, or every item. Breaks if the collector does.
    fn visit<P: Probe>(
        &self,
        leaf: Node,
        test: &TriangleTest,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()>;
}

/// Gives the collector what it may want of every leaf that the ray may meet, some more than once, roughly front to back.
///
/// Always inlined, so that it is compiled for the level of its caller.
#[inline(always)]
pub(crate) fn walk<C: Limited, W: Walkable<C>, P: Probe>(
    tree: &W,
    ray: impl Begin,
    collector: &mut C,
    probe: &mut P,
) {
    let Some((PreparedRay { planes, test }, mut span)) = ray.begin(&tree.bounds()) else {
        return;
    };
    let nodes = tree.nodes();
    // A valid tree has at most MAX_DEPTH interior nodes on a path. (Tried, 2026-11-24: without bounds checks in this loop no
    // difference; a `SmallVec`, 2 to 20 % slower; an array that is cleared, 7 % more
    // instructions.)
    let mut stack = ArrayVec::<Pending, MAX_DEPTH>::new();
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
                stack.push(Pending {
                    place: near ^ 1,
                    span: Span {
                        enter: max(crossing.first, span.enter),
                        exit: span.exit,
                    },
                });
                span.exit = min(crossing.last, span.exit);
                near
            };
            node = nodes[place as usize];
        }
        probe.leaf(|| node.count());
        // A hit outside this leaf's cell counts like any other.
        if tree.visit(node, &test, collector, probe).is_break() {
            return;
        }
        let limit = planes.steps(collector.farthest());
        loop {
            let Some(next) = stack.pop() else {
                return;
            };
            // A lower triangle may be hit at the limit itself.
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
