//! Rays through wide nodes over boxes: which items they may meet.
//!
//! The nodes are traversed as those over triangles. In a leaf, a ray is compared with the boxes of eight items at a time, by the same
//! bounds.

use std::ops::ControlFlow;

use kd_core::Ray;
use kd_simd::min;
use kd_wide::{Block, WIDTH, WideBoxes};

use super::portable::PortableRay;
use super::walk::VisitBlocks;
use crate::dispatch::items_of_one;
use crate::items::{Items, VisitItem};
use crate::planes::Frame;
use crate::probe::Probe;

/// Calls [`visit`](VisitItem::visit) for every item whose box the ray may meet between `t_min` and `t_max`, and not beyond
/// [`limit`](VisitItem::limit): each once, roughly from near to far.
///
/// Boxes are widened by the bound between planes and hits that `planes.rs` of kd-trace derives. `frame` sets it: [`WideBoxes::frame`],
/// or that of a box which contains that one, or one with a larger bound. With it, an item is visited if any `t` in this range is that of
/// a point, computed without rounding, that is at most 2⁻²¹ Q beside its box on each axis, where Q is the largest distance from the
/// ray's origin to a face of the frame on that axis. Items are visited that are farther beside their boxes, too.
///
/// A ray that [cannot hit](Ray::can_hit) anything visits nothing. The culling of other rays is for the visitor.
///
/// ```
/// use std::ops::ControlFlow;
///
/// use kd_core::{Aabb, Ray};
/// use kd_trace::kit::{VisitItem, WideBoxes, walk_boxes};
///
/// /// All items.
/// struct All(Vec<u32>);
///
/// impl VisitItem for All {
///     fn limit(&self) -> f32 {
///         f32::INFINITY
///     }
///
///     fn visit(&mut self, item: u32) -> ControlFlow<()> {
///         self.0.push(item);
///         ControlFlow::Continue(())
///     }
/// }
///
/// let unit = |x: f32| Aabb { min: [x, 0.0, 0.0].into(), max: [x + 1.0, 1.0, 1.0].into() };
/// let boxes = WideBoxes::new(&[unit(0.0), unit(5.0), unit(2.0)], false, None)?;
/// let mut all = All(Vec::new());
/// let ray = Ray::new([9.0, 0.5, 0.5], [-1.0, 0.0, 0.0]).with_range(0.0, 6.5);
/// walk_boxes(&boxes, boxes.frame(), &ray, &mut all);
/// assert_eq!(all.0, [1, 2], "from near to far, in range");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn walk_boxes<V: VisitItem>(boxes: &WideBoxes, frame: &Frame, ray: &Ray, visitor: &mut V) {
    items_of_one(boxes, frame, ray, visitor);
}

impl<V: VisitItem> VisitBlocks for Items<'_, V> {
    const ANY: bool = V::ANY;

    #[inline(always)]
    fn visit<P: Probe>(
        &mut self,
        ray: &PortableRay,
        blocks: &[Block],
        _: &mut P,
    ) -> ControlFlow<()> {
        for block in blocks {
            let limit = |visitor: &V| min(ray.steps(visitor.limit()), ray.end);
            let [enters, exits] = ray.meet_items(block, limit(self.0));
            let mut met = 0;
            for lane in 0..block.count() as usize {
                met |= u32::from(enters[lane] <= exits[lane]) << lane;
            }
            visit_lanes(block, &enters, met, self.0, limit)?;
        }
        ControlFlow::Continue(())
    }
}

/// Visits the items in some lanes, in which a ray `enters` their boxes, from near to far and not beyond the limit. `limit` is that of the
/// visitor in the units of `enters`.
#[inline(always)]
pub(crate) fn visit_lanes<V: VisitItem>(
    block: &Block,
    enters: &[f32; WIDTH],
    mut lanes: u32,
    visitor: &mut V,
    limit: impl Fn(&V) -> f32,
) -> ControlFlow<()> {
    while lanes != 0 {
        let mut next = lanes.trailing_zeros() as usize % WIDTH;
        lanes &= lanes - 1;
        if !V::ANY && lanes != 0 {
            next = swap_for_nearest(enters, next, &mut lanes);
        }
        if !V::ANY && enters[next] > limit(visitor) {
            // All others are at least as far.
            break;
        }
        visitor.visit(block.triangles[next])?;
    }
    ControlFlow::Continue(())
}

/// The nearest of a lane and some others; the first among equals. The lane takes its place among the others.
#[inline(always)]
fn swap_for_nearest(enters: &[f32; WIDTH], lane: usize, others: &mut u32) -> usize {
    let mut nearest = lane;
    let mut rest = *others;
    while rest != 0 {
        let other = rest.trailing_zeros() as usize % WIDTH;
        rest &= rest - 1;
        if enters[other] < enters[nearest] {
            nearest = other;
        }
    }
    *others = (*others | 1 << lane) & !(1 << nearest);
    nearest
}
