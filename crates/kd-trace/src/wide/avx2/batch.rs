//! A ray among others: many rays at one node, one step of a ray, and the rest of its way alone.

use std::arch::x86_64::*;

use kd_core::{Hit, Ray};
use kd_simd::Avx2;
use kd_wide::{Child, WIDTH, WideNode, WideTree};

use super::nodes::{NodeRay, Numbers, Prepared, enter_or_pop, meet, sees_less};
use super::single::{Any, Closest, Progress, Query, trace};
use crate::dispatch::hit_or_none;
use crate::planes::Frame;
use crate::wide::batch_ray::{BatchRay, Entry};
use crate::wide::stack::Pending;
use crate::wide::subtree::Subtree;

/// A usual ray, with its query.
pub(crate) struct Avx2BatchRay<Q: Query> {
    progress: Progress<Q::Ray>,
    query: Q,
}

/// A query of many rays.
pub(crate) trait BatchQuery: Query {
    type Answer;

    fn begin(simd: Avx2) -> Self;

    fn answer(&self, tree: &WideTree, progress: &Progress<Self::Ray>) -> Self::Answer;
}

impl BatchQuery for Closest {
    type Answer = Option<Hit>;

    #[inline(always)]
    fn begin(simd: Avx2) -> Self {
        Self::new(simd)
    }

    #[inline(always)]
    fn answer(&self, tree: &WideTree, progress: &Progress<Self::Ray>) -> Option<Hit> {
        hit_or_none(self.hit(tree.blocks(), progress, &mut ()))
    }
}

impl BatchQuery for Any {
    type Answer = bool;

    #[inline(always)]
    fn begin(simd: Avx2) -> Self {
        Self::new(simd)
    }

    #[inline(always)]
    fn answer(&self, _: &WideTree, _: &Progress<Self::Ray>) -> bool {
        self.is_hit
    }
}

impl<Q: BatchQuery> BatchRay<Avx2> for Avx2BatchRay<Q> {
    const ANY: bool = Q::ANY;
    type Answer = Q::Answer;
    type Nodes = NodeRay;

    #[inline(always)]
    fn begin(simd: Avx2, ray: &Ray, frame: &Frame) -> Option<(NodeRay, Self)> {
        // SAFETY: `simd` proves that the processor has AVX2.
        let nodes = unsafe { usual(ray, frame) }?;
        let ray = Self {
            progress: Progress::new(&nodes),
            query: Q::begin(simd),
        };
        Some((nodes, ray))
    }

    #[inline(always)]
    fn octant(nodes: &NodeRay) -> usize {
        // SAFETY: a `NodeRay` is made where there is an `Avx2`.
        unsafe { nodes.octant() }
    }

    #[inline(always)]
    fn limit(nodes: &NodeRay) -> f32 {
        nodes.end
    }

    #[inline(always)]
    fn divide(
        _: Avx2,
        rays: &[NodeRay],
        list: &[Entry],
        node: &WideNode,
        lists: &mut [Entry],
    ) -> [u32; WIDTH] {
        // SAFETY: there is an `Avx2`.
        unsafe { divide(rays, list, node, lists) }
    }

    #[inline(always)]
    fn enter_or_pop(nodes: &NodeRay, node: &WideNode, pending: &mut Pending<'_>) -> Child {
        // SAFETY: a `NodeRay` is made where there is an `Avx2`.
        unsafe {
            let most = _mm256_set1_ps(nodes.end);
            enter_or_pop(node, nodes.rows, &nodes.broadcast(), most, pending)
        }
    }

    #[inline(always)]
    fn trace_below(&mut self, nodes: &mut NodeRay, subtree: Subtree<'_>, ray: &Ray) {
        // SAFETY: `query` has an `Avx2`.
        unsafe { trace_below(self, nodes, subtree, ray) }
    }

    #[inline(always)]
    fn answer(&self, tree: &WideTree) -> Q::Answer {
        self.query.answer(tree, &self.progress)
    }
}

#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn usual(ray: &Ray, frame: &Frame) -> Option<NodeRay> {
    if sees_less(ray) {
        return None;
    }
    match NodeRay::usual(&Numbers::of(ray), frame) {
        Prepared::Usual(nodes) => Some(nodes),
        Prepared::Unusual => None,
    }
}

#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn trace_below<Q: Query>(
    ray: &mut Avx2BatchRay<Q>,
    nodes: &mut NodeRay,
    subtree: Subtree<'_>,
    numbers: &Ray,
) {
    let Avx2BatchRay { progress, query } = ray;
    trace(
        subtree,
        || Numbers::of(numbers),
        nodes,
        progress,
        query,
        &mut (),
    );
    nodes.end = progress.limit.steps;
}

/// See [`BatchRay::divide`]. Each ray is written to the end of all eight lists, and the lists of the children that it meets grow:
/// no branch depends on the ray.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn divide(rays: &[NodeRay], list: &[Entry], node: &WideNode, lists: &mut [Entry]) -> [u32; WIDTH] {
    let count = list.len();
    let (Some(first), true) = (list.first(), lists.len() >= WIDTH * count) else {
        assert!(count == 0, "there is room for eight lists");
        return [0; WIDTH];
    };
    let rows = rays[first.ray as usize].rows;
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let all = i32::try_from(WIDTH * count).expect("fewer than 2^28 rays");
    let each = _mm256_set1_epi32(all >> WIDTH.ilog2());
    let starts = _mm256_mullo_epi32(lanes, each);
    let mut ends = starts;
    let to = lists.as_mut_ptr();
    for entry in list {
        let ray = &rays[entry.ray as usize];
        let boxes = meet(node, rows, &ray.broadcast(), _mm256_set1_ps(ray.end));
        let number = _mm256_castsi256_ps(_mm256_set1_epi32(entry.ray.cast_signed()));
        // Lanes 0, 1, 4, 5 and lanes 2, 3, 6, 7 as entries.
        let low = _mm256_unpacklo_ps(boxes.enters, number);
        let high = _mm256_unpackhi_ps(boxes.enters, number);
        // In halves: a load of one number would wait for a store of all.
        let halves = [
            _mm256_castsi256_si128(ends),
            _mm256_extracti128_si256::<1>(ends),
        ];
        let entries = [
            [_mm256_castps256_ps128(low), _mm256_castps256_ps128(high)],
            [
                _mm256_extractf128_ps::<1>(low),
                _mm256_extractf128_ps::<1>(high),
            ],
        ];
        for (ends, entries) in halves.into_iter().zip(entries) {
            let pairs = [_mm_cvtsi128_si64(ends), _mm_extract_epi64::<1>(ends)];
            for (ends, entries) in pairs.into_iter().zip(entries) {
                let ends = ends.cast_unsigned();
                let entries = _mm_castps_pd(entries);
                let (first, second) = ((ends & 0xffff_ffff) as usize, (ends >> 32) as usize);
                // SAFETY: the end of a list is at most its start plus the number of rays before: within `lists`. An entry is two
                // numbers, and aligned as a double.
                unsafe { _mm_storel_pd(to.add(first).cast(), entries) };
                // SAFETY: the same.
                unsafe { _mm_storeh_pd(to.add(second).cast(), entries) };
            }
        }
        // A lane that is met is -1.
        ends = _mm256_sub_epi32(ends, _mm256_castps_si256(boxes.is_met));
    }
    bytemuck::must_cast(_mm256_sub_epi32(ends, starts))
}
