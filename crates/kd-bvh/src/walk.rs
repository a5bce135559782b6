//! One ray through the hierarchy.

use std::ops::ControlFlow;

use kd_core::{Aabb, MAX_DEPTH, Mesh, Ray};
use kd_trace::kit::{Collect, RayPlanes, Span, TriangleTest};

use crate::bvh::Bvh;
use crate::counts::Probe;
use crate::node::BvhNodeView;

/// A ray, ready to be asked about boxes and triangles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedRay {
    planes: RayPlanes,
    test: TriangleTest,
    /// Where hits are of interest.
    range: Span,
}

/// A node to visit later.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    node: u32,
    enter: f32,
}

impl PreparedRay {
    /// `None` if it misses all of the hierarchy.
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

    /// Where the ray may hit something in a box.
    #[inline]
    pub(crate) fn clip(&self, bounds: &Aabb, probe: &mut impl Probe) -> Option<Span> {
        probe.ray_box();
        self.planes.clip_span(self.range, bounds)
    }

    /// Gives the collector the hits of some triangles. Breaks if it does; else only what it wants still is of interest from
    /// here on.
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
        // At the limit itself a lower triangle may lie.
        let limit = self.planes.steps(collector.limit());
        self.range.exit = self.range.exit.min(limit);
        ControlFlow::Continue(())
    }
}

/// Gives the collector every hit of the ray that it may want, each once, roughly front to back.
///
/// Algorithm 2 of Eleftheriades 2010 visits the children of a node in the order in which they lie, and all that the ray
/// meets. Here the child that the ray enters first is visited first, and what it enters after the last hit that is of
/// interest is passed over; which is still every node in which there may be an earlier hit.
#[inline]
pub(crate) fn walk<C: Collect, P: Probe>(
    bvh: &Bvh,
    mesh: &Mesh,
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
                probe.triangles(count);
                let triangles = &bvh.triangles[first as usize..][..count as usize];
                if ray.visit(triangles, mesh, collector).is_break() {
                    return;
                }
                None
            }
            BvhNodeView::Interior { axis, second } => {
                let first = at + 1;
                let spans = [first, second].map(|child| {
                    let bounds = nodes[child as usize].bounds();
                    ray.clip(&bounds, probe)
                });
                match spans {
                    [Some(in_first), Some(in_second)] => {
                        // Where both begin at once, as around the ray's origin, direction tells.
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
