//! Many rays: neighbours that are alike as tiles, then those of the others that are alike, and the rest in turn.

use kd_core::{Hit, Ray};

use super::WideTree;
use super::queue;
use super::scattered::{Scattered, Steps};
use super::tile::{RAYS, Tiles};
use super::walk::{WideRay, walk};
use crate::collect::{Any, Closest, Collect};
use crate::lanes::Simd;

/// Fewer rays take longer as a tile than one by one.
pub(super) const FEWEST: usize = 16;

/// Fewer rays take as long in turn as one by one, or longer: at the end there are few on their way.
const FEWEST_IN_TURN: usize = 64;

/// So many rays are looked at together.
const WINDOW: usize = 4096;

/// Neighbours whose slopes are further from their central one are sorted first. (A fortieth of it was as fast, and more.)
const SPREAD_OF_NEIGHBOURS: f32 = 0.25;

/// The closest hit of each ray.
#[inline(always)]
pub(crate) fn closest<S: Simd, R: WideRay>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
    prepare: impl Fn(&Ray) -> Option<R>,
) {
    trace::<_, _, Closest>(simd, tree, rays, hits, prepare);
}

/// Whether each ray hits anything.
#[inline(always)]
pub(crate) fn any<S: Simd, R: WideRay>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    occluded: &mut [bool],
    prepare: impl Fn(&Ray) -> Option<R>,
) {
    trace::<_, _, Any>(simd, tree, rays, occluded, prepare);
}

/// What is asked of each ray, told by what collects it.
pub(super) trait Query: Collect + Default {
    type Answer: Copy + Default;

    fn answer(self) -> Self::Answer;

    /// The answers for the rays that have been gathered.
    fn trace<S: Simd, R: WideRay, P: Fn(&Ray) -> Option<R>>(
        tiles: &mut Tiles<'_, S, R, P>,
        rays: &[Ray],
        answers: &mut [Self::Answer],
    );
}

impl Query for Closest {
    type Answer = Option<Hit>;

    fn answer(self) -> Option<Hit> {
        self.0
    }

    #[inline(always)]
    fn trace<S: Simd, R: WideRay, P: Fn(&Ray) -> Option<R>>(
        tiles: &mut Tiles<'_, S, R, P>,
        rays: &[Ray],
        answers: &mut [Option<Hit>],
    ) {
        tiles.closest(rays, answers);
    }
}

impl Query for Any {
    type Answer = bool;

    fn answer(self) -> bool {
        self.0
    }

    #[inline(always)]
    fn trace<S: Simd, R: WideRay, P: Fn(&Ray) -> Option<R>>(
        tiles: &mut Tiles<'_, S, R, P>,
        rays: &[Ray],
        answers: &mut [bool],
    ) {
        tiles.any(rays, answers);
    }
}

#[inline(always)]
fn trace<S: Simd, R: WideRay, Q: Query>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    answers: &mut [Q::Answer],
    prepare: impl Fn(&Ray) -> Option<R>,
) {
    let mut tiles = Tiles::new(simd, tree, &prepare);
    let mut scattered = Scattered::default();
    let mut others = Vec::new();
    for (rays, answers) in rays.chunks(WINDOW).zip(answers.chunks_mut(WINDOW)) {
        others.clear();
        let starts = (0..).step_by(RAYS);
        for ((rays, answers), start) in rays.chunks(RAYS).zip(answers.chunks_mut(RAYS)).zip(starts)
        {
            if rays.len() >= FEWEST && tiles.gather(rays, SPREAD_OF_NEIGHBOURS) {
                Q::trace(&mut tiles, rays, answers);
            } else {
                others.extend((start..).take(rays.len()));
            }
        }
        let alone = |ray: &Ray, steps: &mut Steps| {
            let mut query = Q::default();
            if let Some(ray) = prepare(ray) {
                walk(tree, &ray, &mut query, steps);
            }
            query.answer()
        };
        scattered.trace::<S, R, Q, _>(&mut tiles, rays, &mut others, answers, alone);
        trace_rest::<R, Q>(tree, rays, &others, answers, &prepare);
    }
}

/// Traces rays each by itself.
#[inline(always)]
fn trace_rest<R: WideRay, Q: Query>(
    tree: &WideTree,
    rays: &[Ray],
    numbers: &[u32],
    answers: &mut [Q::Answer],
    prepare: impl Fn(&Ray) -> Option<R>,
) {
    let numbers = numbers.iter().map(|number| *number as usize);
    if numbers.len() >= FEWEST_IN_TURN {
        queue::trace(tree, rays, numbers, prepare, |number, query: Q| {
            answers[number] = query.answer();
        });
        return;
    }
    for number in numbers {
        let mut query = Q::default();
        if let Some(ray) = prepare(&rays[number]) {
            walk(tree, &ray, &mut query, &mut ());
        }
        answers[number] = query.answer();
    }
}
