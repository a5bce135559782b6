//! Batches: coherent neighbors as tiles, then coherent rays among the [others](super::scattered) as tiles, and the rest as
//! [incoherent](super::incoherent) rays.
//!
//! Each of these ways is used while a [race](super::race) shows that it is faster than rays one by one.

use kd_core::{Hit, Ray};
use kd_wide::WideTree;

use super::batch_ray::BatchRay;
use super::incoherent::Incoherent;
use super::kept::{self, Identity};
use super::race::{Race, Stopwatch, Way};
use super::scattered::Scattered;
use super::subtree::Subtree;
use super::tile::{RAYS, TileMemory, Tiles};
use crate::collect::{Any, Closest, Collect};
use crate::dispatch::{TraceSimd, hit_or_none};

/// The fewest rays of a tile. Fewer take longer than one by one.
pub(super) const FEWEST: usize = 16;

/// Ways to trace coherent rays.
pub(super) const AS_TILES: &[Way] = &[Way::Together, Way::Alone];

/// Tiles until both ways are measured again. (Neighbors differ from one part of a picture to the next: with 512 tiles,
/// shadow rays took twice as long in one of seven scenes. `cargo xtask rays --scenes DIR`, 2026-11-30.)
const NEIGHBORS: [u32; 2] = [16, 64];

/// Rays that are sorted together.
const WINDOW: usize = 4096;

/// The largest difference of slopes from the central ray in a tile of neighbors. Neighbors that spread further are sorted first.
/// (A fortieth of it was as fast, and more.)
const SPREAD_OF_NEIGHBORS: f32 = 0.25;

/// A query, as the collector of its answer.
pub(crate) trait Query: Collect + Default + 'static {
    type Answer: Copy + Default;
    type InBatch<S: TraceSimd>: BatchRay<S, Answer = Self::Answer>;

    fn answer(&self) -> Self::Answer;

    /// Answers one ray alone.
    fn one<S: TraceSimd>(simd: S, tree: &WideTree, ray: &Ray) -> Self::Answer;

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
    fn one<S: TraceSimd>(simd: S, tree: &WideTree, ray: &Ray) -> Option<Hit> {
        hit_or_none(simd.closest(Subtree::whole(tree), ray, &mut ()))
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
    fn one<S: TraceSimd>(simd: S, tree: &WideTree, ray: &Ray) -> bool {
        simd.any(Subtree::whole(tree), ray, &mut ())
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
        incoherent,
        numbers,
        tile,
        ..
    } = &mut *kept;
    let mut batch = Batch {
        simd,
        tree,
        tiles: Tiles::new(simd, tree, tile),
        neighbors,
    };
    for (rays, answers) in rays.chunks(WINDOW).zip(answers.chunks_mut(WINDOW)) {
        numbers.clear();
        let starts = (0..).step_by(RAYS);
        for ((rays, answers), start) in rays.chunks(RAYS).zip(answers.chunks_mut(RAYS)).zip(starts)
        {
            let may_be_tile = rays.len() >= FEWEST && !batch.neighbors.skips(1);
            let clock = batch.neighbors.measures().then(Stopwatch::start);
            if may_be_tile && batch.tiles.gather(rays, SPREAD_OF_NEIGHBORS) {
                batch.trace_neighbors::<Q>(rays, answers, clock);
            } else {
                numbers.extend((start..).take(rays.len()));
            }
        }
        scattered.trace::<S, Q>(&mut batch, rays, numbers, answers);
        incoherent.trace(simd, tree, rays, numbers, answers);
    }
    kept::keep(kept);
}

/// What the next batch of this thread can use.
struct Kept<S: TraceSimd, Q: Query> {
    tree: Option<Identity>,
    /// Coherent neighbors as tiles.
    neighbors: Race,
    scattered: Scattered,
    incoherent: Incoherent<S, Q>,
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
            incoherent: Incoherent::new(),
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
        let races = [
            &mut self.neighbors,
            self.scattered.race(),
            self.incoherent.race(),
        ];
        for race in races {
            if is_same {
                race.resume();
            } else {
                race.restart();
            }
        }
    }
}

/// What the rays of a batch share.
pub(super) struct Batch<'a, S: TraceSimd> {
    simd: S,
    tree: &'a WideTree,
    pub(super) tiles: Tiles<'a, S>,
    neighbors: &'a mut Race,
}

impl<S: TraceSimd> Batch<'_, S> {
    /// Traces the rays that are gathered in a tile: as a tile, or one by one. `clock` was started before they were gathered, if
    /// the time is measured.
    #[inline(always)]
    fn trace_neighbors<Q: Query>(
        &mut self,
        rays: &[Ray],
        answers: &mut [Q::Answer],
        clock: Option<Stopwatch>,
    ) {
        let way = self.neighbors.next();
        // Rays alone need not be gathered.
        let clock = if way == Way::Alone {
            clock.map(|_| Stopwatch::start())
        } else {
            clock
        };
        self.trace_gathered::<Q>(way, rays, answers);
        if let Some(clock) = clock {
            self.neighbors.learn(clock.per_ray(rays.len()));
        }
    }

    /// Traces the rays that are gathered in a tile.
    #[inline(always)]
    pub(super) fn trace_gathered<Q: Query>(
        &mut self,
        way: Way,
        rays: &[Ray],
        answers: &mut [Q::Answer],
    ) {
        if way == Way::Together {
            Q::trace(&mut self.tiles, rays, answers);
            return;
        }
        for (ray, answer) in rays.iter().zip(answers) {
            *answer = Q::one(self.simd, self.tree, ray);
        }
    }
}
