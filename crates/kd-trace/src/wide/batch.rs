//! Batches: coherent neighbors as tiles, then coherent rays among the others as tiles, and the rest in a queue.

use kd_core::{Hit, Ray};
use kd_wide::WideTree;

use super::queue;
use super::scattered::{Scattered, Steps};
use super::subtree::Subtree;
use super::tile::{RAYS, Tiles};
use crate::collect::{Any, Closest};
use crate::dispatch::{Search, TraceSimd};
use crate::probe::Probe;

/// The fewest rays of a tile. Fewer take longer than one by one.
pub(super) const FEWEST: usize = 16;

/// The fewest rays of a queue. Fewer take as long as one by one or longer: near the end few rays are active.
const FEWEST_IN_TURN: usize = 64;

/// Rays that are sorted together.
const WINDOW: usize = 4096;

/// The largest difference of slopes from the central ray in a tile of neighbors. Neighbors that spread further are sorted first.
/// (A fortieth of it was as fast, and more.)
const SPREAD_OF_NEIGHBORS: f32 = 0.25;

/// A query, as the collector of its answer.
pub(crate) trait Query: Search {
    type Answer: Copy + Default;

    fn answer(self) -> Self::Answer;

    /// Answers the rays that are gathered in a tile.
    fn trace<S: TraceSimd>(tiles: &mut Tiles<'_, S>, rays: &[Ray], answers: &mut [Self::Answer]);
}

impl Query for Closest {
    type Answer = Option<Hit>;

    fn answer(self) -> Option<Hit> {
        self.0
    }

    #[inline(always)]
    fn trace<S: TraceSimd>(tiles: &mut Tiles<'_, S>, rays: &[Ray], answers: &mut [Option<Hit>]) {
        tiles.closest(rays, answers);
    }
}

impl Query for Any {
    type Answer = bool;

    fn answer(self) -> bool {
        self.0
    }

    #[inline(always)]
    fn trace<S: TraceSimd>(tiles: &mut Tiles<'_, S>, rays: &[Ray], answers: &mut [bool]) {
        tiles.any(rays, answers);
    }
}

/// Answers each ray, in order.
#[inline(always)]
pub(crate) fn trace<S: TraceSimd, Q: Query>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    answers: &mut [Q::Answer],
) {
    let mut tiles = Tiles::new(simd, tree);
    let mut scattered = Scattered::default();
    let mut others = Vec::new();
    for (rays, answers) in rays.chunks(WINDOW).zip(answers.chunks_mut(WINDOW)) {
        others.clear();
        let starts = (0..).step_by(RAYS);
        for ((rays, answers), start) in rays.chunks(RAYS).zip(answers.chunks_mut(RAYS)).zip(starts)
        {
            if rays.len() >= FEWEST && tiles.gather(rays, SPREAD_OF_NEIGHBORS) {
                Q::trace(&mut tiles, rays, answers);
            } else {
                others.extend((start..).take(rays.len()));
            }
        }
        let alone = |ray: &Ray, steps: &mut Steps| answer::<S, Q, _>(simd, tree, ray, steps);
        scattered.trace::<S, Q>(&mut tiles, rays, &mut others, answers, alone);
        trace_rest::<S, Q>(simd, tree, rays, &others, answers);
    }
}

/// Answers one ray.
#[inline(always)]
fn answer<S: TraceSimd, Q: Query, P: Probe>(
    simd: S,
    tree: &WideTree,
    ray: &Ray,
    probe: &mut P,
) -> Q::Answer {
    let mut query = Q::default();
    query.search(simd, Subtree::whole(tree), ray, probe);
    query.answer()
}

/// Traces rays that are in no tile.
#[inline(always)]
fn trace_rest<S: TraceSimd, Q: Query>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    numbers: &[u32],
    answers: &mut [Q::Answer],
) {
    let numbers = numbers.iter().map(|number| *number as usize);
    if numbers.len() >= FEWEST_IN_TURN {
        queue::trace(simd, tree, rays, numbers, |number, query: Q| {
            answers[number] = query.answer();
        });
        return;
    }
    for number in numbers {
        answers[number] = answer::<S, Q, _>(simd, tree, &rays[number], &mut ());
    }
}
