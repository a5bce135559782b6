//! Batches: coherent neighbors as tiles, then coherent rays among the others as tiles, and the rest in a queue; or one by one,
//! where a [race](super::race) shows that this is faster.

use kd_core::{Hit, Ray};
use kd_wide::WideTree;

use super::queue::{self, Slots};
use super::race::{Race, Stopwatch, Way};
use super::scattered::Scattered;
use super::subtree::Subtree;
use super::tile::{RAYS, Tiles};
use crate::collect::{Any, Closest};
use crate::dispatch::{Search, TraceSimd};

/// The fewest rays of a tile. Fewer take longer than one by one.
pub(super) const FEWEST: usize = 16;

/// The rays of a queue, and the fewest. Near its end few rays are active.
const IN_TURN: usize = 512;
const FEWEST_IN_TURN: usize = 64;

/// Tiles and groups in turns until both ways are measured again, at most. (Neighbors differ from one part of a picture to the
/// next: with 512 tiles, shadow rays took twice as long in one of seven scenes. `cargo xtask rays --scenes DIR`, 2026-11-30.)
const NEIGHBORS: u32 = 64;
const TURNS: u32 = 256;

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
    let mut batch = Batch::<S, Q> {
        simd,
        tree,
        tiles: Tiles::new(simd, tree),
        neighbors: Race::new(NEIGHBORS),
        turns: Race::new(TURNS),
        slots: None,
    };
    let mut scattered = Scattered::new();
    let mut others = Vec::new();
    for (rays, answers) in rays.chunks(WINDOW).zip(answers.chunks_mut(WINDOW)) {
        others.clear();
        let starts = (0..).step_by(RAYS);
        for ((rays, answers), start) in rays.chunks(RAYS).zip(answers.chunks_mut(RAYS)).zip(starts)
        {
            let may_be_tile = rays.len() >= FEWEST && !batch.neighbors.skips(1);
            let clock = batch.neighbors.measures().then(Stopwatch::start);
            if may_be_tile && batch.tiles.gather(rays, SPREAD_OF_NEIGHBORS) {
                batch.trace_neighbors(rays, answers, clock);
            } else {
                others.extend((start..).take(rays.len()));
            }
        }
        scattered.trace(&mut batch, rays, &mut others, answers);
        batch.trace_rest(rays, &others, answers);
    }
}

/// What the rays of a batch share.
pub(super) struct Batch<'a, S: TraceSimd, Q: Query> {
    simd: S,
    tree: &'a WideTree,
    pub(super) tiles: Tiles<'a, S>,
    /// Coherent neighbors as tiles.
    neighbors: Race,
    /// Other rays in turns.
    turns: Race,
    slots: Option<Slots<S::Ray, Q>>,
}

impl<S: TraceSimd, Q: Query> Batch<'_, S, Q> {
    /// Answers one ray.
    #[inline(always)]
    pub(super) fn answer(&self, ray: &Ray) -> Q::Answer {
        let mut query = Q::default();
        query.search(self.simd, Subtree::whole(self.tree), ray, &mut ());
        query.answer()
    }

    /// Traces the rays that are gathered in a tile: as a tile, or one by one. `clock` was started before they were gathered, if
    /// the time is measured.
    #[inline(always)]
    fn trace_neighbors(
        &mut self,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        clock: Option<Stopwatch>,
    ) {
        let way = self.neighbors.next();
        // Rays alone need not be gathered.
        let clock = clock.map(|clock| match way {
            Way::Together => clock,
            Way::Alone => Stopwatch::start(),
        });
        self.trace_gathered(way, rays, answers);
        if let Some(clock) = clock {
            self.neighbors.learn(way, clock.per_ray(rays.len()));
        }
    }

    /// Traces the rays that are gathered in a tile.
    #[inline(always)]
    pub(super) fn trace_gathered(&mut self, way: Way, rays: &[Ray], answers: &mut [Q::Answer]) {
        match way {
            Way::Together => Q::trace(&mut self.tiles, rays, answers),
            Way::Alone => {
                for (ray, answer) in rays.iter().zip(answers) {
                    *answer = self.answer(ray);
                }
            }
        }
    }

    /// Traces rays that are in no tile: in turns, or one by one.
    #[inline(always)]
    fn trace_rest(&mut self, rays: &[Ray], numbers: &[u32], answers: &mut [Q::Answer]) {
        for numbers in numbers.chunks(IN_TURN) {
            let is_race = numbers.len() >= FEWEST_IN_TURN;
            let clock = (is_race && self.turns.measures()).then(Stopwatch::start);
            let way = if is_race {
                self.turns.next()
            } else {
                Way::Alone
            };
            let places = numbers.iter().map(|number| *number as usize);
            match way {
                Way::Together => {
                    let take = |number: usize, query: Q| answers[number] = query.answer();
                    let slots = self.slots.get_or_insert_with(Slots::new);
                    queue::trace(self.simd, self.tree, rays, places, slots, take);
                }
                Way::Alone => {
                    for number in places {
                        answers[number] = self.answer(&rays[number]);
                    }
                }
            }
            if let Some(clock) = clock {
                self.turns.learn(way, clock.per_ray(numbers.len()));
            }
        }
    }
}
