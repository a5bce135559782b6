//! One ray through the hierarchy.

use std::ops::ControlFlow;

use kd_core::{Aabb, MAX_DEPTH, Mesh, Ray};
use kd_trace::kit::{Collect, Probe, RayPlanes, Span, TriangleTest};

use super::{Bvh, BvhNodeView};

/// A ray with its precomputed box and triangle tests.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedRay {
    planes: RayPlanes,
    test: TriangleTest,
    /// The range of wanted hits.
    range: Span,
}

/// A node to visit later.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    node: u32,
    enter: f32,
}

impl PreparedRay {
    /// `None` if the ray misses the box of the root.
    #[inline]
    pub(crate) fn new(ray: &Ray, bvh: &Bvh, probe: &mut impl Probe) -> Option<Self> {
        let root = bvh.nodes.first()?;
        if !ray.can_hit() {
            return None;
        }
        let planes = RayPlanes::new(ray, &bvh.frame);
        let range = planes.range(ray);
        probe.ray_box();
        planes.clip_span(range, &root.bounds())?;
        let test = TriangleTest::new(ray, planes.reach());
        Some(Self {
            planes,
            test,
            range,
        })
    }

    #[inline]
    pub(crate) fn planes(&self) -> &RayPlanes {
        &self.planes
    }

    #[inline]
    pub(crate) fn range(&self) -> Span {
        self.range
    }

    /// The range in which the ray may hit something in a box.
    #[inline]
    pub(crate) fn clip(&self, bounds: &Aabb, probe: &mut impl Probe) -> Option<Span> {
        probe.ray_box();
        self.planes.clip_span(self.range, bounds)
    }

    /// Passes the hits of triangles to the collector, and shortens the range to the hits that it still wants. Breaks if the
    /// collector breaks.
    #[inline]
    pub(crate) fn visit<C: Collect>(
        &mut self,
        triangles: &[u32],
        mesh: &Mesh,
        collector: &mut C,
    ) -> ControlFlow<()> {
        for &triangle in triangles {
            self.test.ask(mesh, triangle, collector)?;
        }
        // A lower triangle at the limit itself still counts.
        let limit = self.planes.steps(collector.limit());
        self.range.exit = self.range.exit.min(limit);
        ControlFlow::Continue(())
    }
}

/// Passes every hit of the ray that the collector may want to it, each once, roughly front to back.
///
/// Algorithm 2 of Eleftheriades 2010 visits all children that the ray meets, in the order of storage. This walk visits the
/// child that the ray enters first, and skips nodes that the ray enters behind the last wanted hit. It still visits every node
/// that may contain an earlier hit.
#[inline]
pub(crate) fn walk<C: Collect, P: Probe>(
    bvh: &Bvh,
    mut ray: PreparedRay,
    collector: &mut C,
    probe: &mut P,
) {
    let nodes = bvh.nodes.as_slice();
    let mut stack = [Pending::default(); MAX_DEPTH];
    let mut pending = 0;
    let mut at = 0;
    loop {
        let next = match nodes[at as usize].view() {
            BvhNodeView::Leaf { first, count } => {
                probe.leaf(|| count);
                let triangles = &bvh.triangles[first as usize..][..count as usize];
                if ray.visit(triangles, &bvh.mesh, collector).is_break() {
                    return;
                }
                None
            }
            BvhNodeView::Interior { axis, second } => {
                probe.node();
                let first = at + 1;
                let spans = [first, second].map(|child| {
                    let bounds = nodes[child as usize].bounds();
                    ray.clip(&bounds, probe)
                });
                match spans {
                    [Some(in_first), Some(in_second)] => {
                        // If the ray enters both at once, as around its origin, the direction decides.
                        let is_second_nearer = in_second.enter < in_first.enter
                            || in_second.enter == in_first.enter
                                && ray.planes.is_downwards(axis.index());
                        let (near, node, enter) = if is_second_nearer {
                            (second, first, in_first.enter)
                        } else {
                            (first, second, in_second.enter)
                        };
                        stack[pending] = Pending { node, enter };
                        pending += 1;
                        Some(near)
                    }
                    [Some(_), None] => Some(first),
                    [None, Some(_)] => Some(second),
                    [None, None] => None,
                }
            }
        };
        at = if let Some(next) = next {
            next
        } else {
            loop {
                if pending == 0 {
                    return;
                }
                pending -= 1;
                let Pending { node, enter } = stack[pending];
                if enter <= ray.range.exit {
                    break node;
                }
            }
        };
    }
}
