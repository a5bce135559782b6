//! Batches: coherent neighbors as tiles, then coherent rays among the others as tiles, and the rest as a stream; or one by one,
//! where a [race](super::race) shows that this is faster.

use kd_core::{Hit, Ray};
use kd_wide::WideTree;

use super::batch_ray::BatchRay;
use super::kept::{self, Identity};
use super::queue::Queue;
use super::race::{Race, Stopwatch, Way};
use super::scattered::Scattered;
use super::stream::Stream;
use super::subtree::Subtree;
use super::tile::{RAYS, TileMemory, Tiles};
use crate::collect::{Any, Closest};
use crate::dispatch::{Search, TraceSimd};

/// The fewest rays of a tile. Fewer take longer than one by one.
pub(super) const FEWEST: usize = 16;

/// The rays of a stream, and the fewest. More rays share more nodes, and need more memory.
/// (As few under Miri, which is slow, so that a small batch is traced in all ways.)
const IN_STREAM: usize = if cfg!(miri) { FEWEST_IN_STREAM } else { 1024 };
const FEWEST_IN_STREAM: usize = 64;

/// Rays in turns or alone that are measured: enough to compare them.
const SHORT: usize = if cfg!(miri) { FEWEST_IN_STREAM } else { 256 };

/// Ways of tiles, and of other rays.
pub(super) const AS_TILES: &[Way] = &[Way::Together, Way::Alone];
const TOGETHER_OR_IN_TURNS: &[Way] = &[Way::Together, Way::InTurns, Way::Alone];

/// Groups until all ways are measured again, at most. (Neighbors differ from one part of a picture to the next: with 512 tiles,
/// shadow rays took twice as long in one of seven scenes. `cargo xtask rays --scenes DIR`, 2026-11-30.)
const NEIGHBORS: u32 = 64;
const OTHERS: u32 = 128;

/// Rays that are sorted together.
const WINDOW: usize = 4096;

/// The largest difference of slopes from the central ray in a tile of neighbors. Neighbors that spread further are sorted first.
/// (A fortieth of it was as fast, and more.)
const SPREAD_OF_NEIGHBORS: f32 = 0.25;

/// A query, as the collector of its answer.
pub(crate) trait Query: Search + 'static {
    type Answer: Copy + Default;
    type InBatch<S: TraceSimd>: BatchRay<S, Answer = Self::Answer>;

    fn answer(&self) -> Self::Answer;

    /// Answers the rays that are gathered in a tile.
    fn trace<S: TraceSimd>(tiles: &mut Tiles<'_, S>, rays: &[Ray], answers: &mut [Self::Answer]);
}

impl Query for Closest {
    type Answer = Option<Hit>;
    type InBatch<S: TraceSimd> = S::ClosestInBatch;

    #[inline(always)]
    fn answer(&self) -> Option<Hit> {
        self.0
    }

    #[inline(always)]
    fn trace<S: TraceSimd>(tiles: &mut Tiles<'_, S>, rays: &[Ray], answers: &mut [Option<Hit>]) {
        tiles.closest(rays, answers);
    }
}

impl Query for Any {
    type Answer = bool;
    type InBatch<S: TraceSimd> = S::AnyInBatch;

    #[inline(always)]
    fn answer(&self) -> bool {
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
    let mut kept = kept::take::<Kept<S, Q>>().unwrap_or_default();
    kept.begin(tree);
    let Kept {
        neighbors,
        scattered,
        others,
        stream,
        queue,
        numbers,
        tile,
        ..
    } = &mut *kept;
    let mut batch = Batch::<S, Q> {
        simd,
        tree,
        tiles: Tiles::new(simd, tree, tile),
        neighbors,
        others,
        stream,
        queue,
    };
    for (rays, answers) in rays.chunks(WINDOW).zip(answers.chunks_mut(WINDOW)) {
        numbers.clear();
        let starts = (0..).step_by(RAYS);
        for ((rays, answers), start) in rays.chunks(RAYS).zip(answers.chunks_mut(RAYS)).zip(starts)
        {
            let may_be_tile = rays.len() >= FEWEST && !batch.neighbors.skips(1);
            let clock = batch.neighbors.measures().then(Stopwatch::start);
            if may_be_tile && batch.tiles.gather(rays, SPREAD_OF_NEIGHBORS) {
                batch.trace_neighbors(rays, answers, clock);
            } else {
                numbers.extend((start..).take(rays.len()));
            }
        }
        scattered.trace(&mut batch, rays, numbers, answers);
        batch.trace_rest(rays, numbers, answers);
    }
    kept::keep(kept);
}

/// What the next batch of this thread can use.
struct Kept<S: TraceSimd, Q: Query> {
    tree: Option<Identity>,
    /// Coherent neighbors as tiles.
    neighbors: Race,
    scattered: Scattered,
    /// Other rays as streams, or in turns.
    others: Race,
    stream: StreamOf<S, Q>,
    queue: QueueOf<S, Q>,
    /// Rays of a window that are in no tile of neighbors.
    numbers: Vec<u32>,
    tile: TileMemory,
}

impl<S: TraceSimd, Q: Query> Default for Kept<S, Q> {
    fn default() -> Self {
        Self {
            tree: None,
            neighbors: Race::new(AS_TILES, NEIGHBORS),
            scattered: Scattered::new(),
            others: Race::new(TOGETHER_OR_IN_TURNS, OTHERS),
            stream: Stream::new(),
            queue: Queue::new(),
            numbers: Vec::new(),
            tile: TileMemory::new(),
        }
    }
}

impl<S: TraceSimd, Q: Query> Kept<S, Q> {
    /// Begins a batch. What races have learned holds for the same tree.
    fn begin(&mut self, tree: &WideTree) {
        let tree = Some(Identity::of(tree));
        let is_same = self.tree == tree;
        self.tree = tree;
        for race in [&mut self.neighbors, &mut self.others, self.scattered.race()] {
            if is_same {
                race.resume();
            } else {
                race.restart();
            }
        }
    }
}

/// What the rays of a batch share.
pub(super) struct Batch<'a, S: TraceSimd, Q: Query> {
    simd: S,
    tree: &'a WideTree,
    pub(super) tiles: Tiles<'a, S>,
    neighbors: &'a mut Race,
    others: &'a mut Race,
    stream: &'a mut StreamOf<S, Q>,
    queue: &'a mut QueueOf<S, Q>,
}

type StreamOf<S, Q> = Stream<NodesOf<S, Q>, <Q as Query>::InBatch<S>>;
type QueueOf<S, Q> = Queue<NodesOf<S, Q>, <Q as Query>::InBatch<S>>;
/// What a ray of a query needs at nodes.
type NodesOf<S, Q> = <<Q as Query>::InBatch<S> as BatchRay<S>>::Nodes;

impl<S: TraceSimd, Q: Query> Batch<'_, S, Q> {
    /// Answers one ray.
    #[inline(always)]
    fn answer(&self, ray: &Ray) -> Q::Answer {
        one::<S, Q>(self.simd, self.tree, ray)
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
            Way::InTurns | Way::Alone => Stopwatch::start(),
        });
        self.trace_gathered(way, rays, answers);
        if let Some(clock) = clock {
            self.neighbors.learn(clock.per_ray(rays.len()));
        }
    }

    /// Traces the rays that are gathered in a tile.
    #[inline(always)]
    pub(super) fn trace_gathered(&mut self, way: Way, rays: &[Ray], answers: &mut [Q::Answer]) {
        match way {
            Way::Together => Q::trace(&mut self.tiles, rays, answers),
            Way::InTurns | Way::Alone => {
                for (ray, answer) in rays.iter().zip(answers) {
                    *answer = self.answer(ray);
                }
            }
        }
    }

    /// Traces rays that are in no tile: as streams, or one by one.
    #[inline(always)]
    fn trace_rest(&mut self, rays: &[Ray], numbers: &[u32], answers: &mut [Q::Answer]) {
        let mut left = numbers;
        while !left.is_empty() {
            let is_race = left.len() >= FEWEST_IN_STREAM;
            let clock = (is_race && self.others.measures()).then(Stopwatch::start);
            let way = if is_race {
                self.others.next()
            } else {
                Way::Alone
            };
            let is_short = clock.is_some() && way != Way::Together;
            let most = if is_short { SHORT } else { IN_STREAM };
            let (numbers, others) = left.split_at(most.min(left.len()));
            left = others;
            let (simd, tree) = (self.simd, self.tree);
            let mut take = |number: u32, answer: Option<Q::Answer>| {
                let number = number as usize;
                answers[number] = answer.unwrap_or_else(|| one::<S, Q>(simd, tree, &rays[number]));
            };
            match way {
                Way::Together => self.stream.trace(simd, tree, rays, numbers, take),
                Way::InTurns => self.queue.trace(simd, tree, rays, numbers, take),
                Way::Alone => numbers.iter().for_each(|number| take(*number, None)),
            }
            if let Some(clock) = clock {
                self.others.learn(clock.per_ray(numbers.len()));
            }
        }
    }
}

/// Answers one ray.
#[inline(always)]
fn one<S: TraceSimd, Q: Query>(simd: S, tree: &WideTree, ray: &Ray) -> Q::Answer {
    let mut query = Q::default();
    query.search(simd, Subtree::whole(tree), ray, &mut ());
    query.answer()
}
