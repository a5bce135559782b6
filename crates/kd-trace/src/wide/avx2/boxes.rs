//! One ray through wide nodes over boxes: the loop of a ray alone, with the boxes of eight items in place of a block of triangles.

use std::arch::x86_64::*;
use std::ops::ControlFlow;

use kd_core::{Culling, Ray};
use kd_simd::min;
use kd_wide::{Block, WIDTH, WideBoxes, WideTree};

use super::ROW;
use super::nodes::{Faces, NodeRay, Numbers, Prepared, faces_by_octant, slabs};
use super::opaque;
use super::single::{BlockRay, Limit, Place, Progress, Query, trace};
use crate::items::{Items, VisitItem};
use crate::planes::Frame;
use crate::probe::Probe;
use crate::wide::boxes::visit_lanes;
use crate::wide::portable::PortableRay;
use crate::wide::subtree::Subtree;
use crate::wide::walk::walk;

/// Where the faces of the boxes of a block are, by octant: corner a is the lowest one, corner b the highest.
static FACES: [Faces; 8] = faces_by_octant(ROW, 3 * ROW);

/// Lets the visitor visit the items whose boxes the ray may meet.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline(never)]
pub(super) fn visit<V: VisitItem>(boxes: &WideBoxes, frame: &Frame, ray: &Ray, visitor: &mut V) {
    if ray.mask == 0 || ray.culling == Culling::BOTH {
        return;
    }
    let numbers = Numbers::one_by_one(ray);
    let subtree = Subtree::whole(boxes.as_wide());
    match NodeRay::usual(&numbers, frame) {
        Prepared::Unusual => visit_unusual(subtree, frame, ray, visitor),
        Prepared::Usual(nodes) => {
            let mut progress = Progress::new(&nodes);
            let mut query = MeetItems {
                faces: &FACES[nodes.octant()],
                nodes: &nodes,
                visitor,
            };
            let probe = &mut ();
            trace(
                subtree,
                || numbers,
                &nodes,
                &mut progress,
                &mut query,
                probe,
            );
        }
    }
}

#[cold]
#[inline(never)]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn visit_unusual<V: VisitItem>(subtree: Subtree<'_>, frame: &Frame, ray: &Ray, visitor: &mut V) {
    if let Some(ray) = PortableRay::new(ray, frame) {
        walk(subtree, &ray, &mut Items(visitor), &mut ());
    }
}

/// Every item whose box the ray meets.
struct MeetItems<'a, V> {
    nodes: &'a NodeRay,
    faces: &'static Faces,
    visitor: &'a mut V,
}

/// A ray that the loop does not prepare for what is in a block: boxes are met as those of nodes are.
pub(super) struct Unprepared;

impl BlockRay for Unprepared {
    #[inline(always)]
    fn prepare(_: &Numbers, _: &WideTree, _: &mut Limit) -> Self {
        Self
    }
}

impl<V: VisitItem> Query for MeetItems<'_, V> {
    const ANY: bool = V::ANY;
    type Ray = Unprepared;

    #[inline(always)]
    fn visit<P: Probe, Caller>(
        &mut self,
        _: &Unprepared,
        place: Place<'_>,
        limit: &mut Limit,
        _: &mut P,
    ) -> ControlFlow<()> {
        // SAFETY: a `NodeRay` is made where there is an `Avx2`.
        unsafe { self.visit(place.block, limit) }
    }
}

impl<V: VisitItem> MeetItems<'_, V> {
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn visit(&mut self, block: &Block, limit: &mut Limit) -> ControlFlow<()> {
        let Self {
            nodes,
            faces,
            visitor,
        } = self;
        let end = limit.steps;
        let axes = opaque(*nodes).broadcast();
        let base: *const u8 = (&raw const *block).cast();
        // SAFETY: `FACES` has the offsets of rows of a block, which is aligned as a node is.
        let boxes = unsafe { slabs(base, faces, &axes, _mm256_set1_ps(end)) };
        // What overflows is met. A lane without an item, which is NaN, is not.
        // SAFETY: the first row of a block, which is aligned.
        let some_row = unsafe { _mm256_load_ps(base.cast()) };
        let is_item = _mm256_cmp_ps::<_CMP_ORD_Q>(some_row, some_row);
        let met = _mm256_movemask_ps(_mm256_and_ps(boxes.is_met, is_item)).cast_unsigned();
        if met == 0 {
            return ControlFlow::Continue(());
        }
        let mut enters = [0.0; WIDTH];
        // SAFETY: there are eight numbers.
        unsafe { _mm256_storeu_ps(enters.as_mut_ptr(), boxes.enters) };
        let steps = |visitor: &V| min(visitor.limit(), end);
        visit_lanes(block, &enters, met, *visitor, steps)?;
        if !V::ANY {
            limit.steps = steps(visitor);
        }
        ControlFlow::Continue(())
    }
}
