//! Incoherent rays: as [streams](super::stream), in turns in a [queue](super::queue), or one by one.
//!
//! Which is fastest depends on the rays, the tree and the caches, so a [race](super::race) measures it.

use kd_core::Ray;
use kd_wide::WideTree;

use super::batch::Query;
use super::batch_ray::BatchRay;
use super::queue::Queue;
use super::race::{Race, Stopwatch, Way};
use super::stream::Stream;
use crate::dispatch::TraceSimd;

const WAYS: &[Way; 3] = &[Way::Together, Way::InTurns, Way::Alone];

/// Of consecutive rays that are measured, those that are traced as a stream, in turns and alone.
const SHARES: [usize; 3] = [64, 16, 16];

/// The fewest rays that are not traced one by one: enough for a share of each way.
const FEWEST: usize = SHARES[0] + SHARES[1] + SHARES[2];

/// The rays of a stream: more rays share more nodes, and need more memory. (As few as possible under Miri, which is slow, so that a
/// small batch is traced in all ways.)
const IN_STREAM: usize = if cfg!(miri) { FEWEST } else { 1024 };

/// The rays of a measurement.
const MEASURED: usize = if cfg!(miri) { FEWEST } else { 16 * FEWEST };

/// Streams until all ways are measured again.
const PAUSES: [u32; 2] = [16, 128];

/// Traces the rays of batches that are in no tile.
pub(super) struct Incoherent<S: TraceSimd, Q: Query> {
    race: Race,
    stream: Stream<NodesOf<S, Q>, Q::InBatch<S>>,
    queue: Queue<NodesOf<S, Q>, Q::InBatch<S>>,
    /// Rays that are measured, by the way in which they are traced.
    shares: [Vec<u32>; WAYS.len()],
}

/// What a ray of a query needs at nodes.
type NodesOf<S, Q> = <<Q as Query>::InBatch<S> as BatchRay<S>>::Nodes;

/// The tree and the rays of a batch.
type Rays<'a, S> = (S, &'a WideTree, &'a [Ray]);

impl<S: TraceSimd, Q: Query> Incoherent<S, Q> {
    pub(super) fn new() -> Self {
        Self {
            race: Race::new(WAYS, PAUSES),
            stream: Stream::new(),
            queue: Queue::new(),
            shares: Default::default(),
        }
    }

    pub(super) fn race(&mut self) -> &mut Race {
        &mut self.race
    }

    /// Traces the rays of these numbers: as streams, in turns or one by one.
    #[inline(always)]
    pub(super) fn trace(
        &mut self,
        simd: S,
        tree: &WideTree,
        rays: &[Ray],
        numbers: &[u32],
        answers: &mut [Q::Answer],
    ) {
        let batch = (simd, tree, rays);
        let mut left = numbers;
        while !left.is_empty() {
            let is_measured = left.len() >= FEWEST && self.race.measures();
            let most = if is_measured { MEASURED } else { IN_STREAM };
            let (numbers, rest) = left.split_at(most.min(left.len()));
            left = rest;
            if is_measured {
                self.measure(batch, numbers, answers);
                continue;
            }
            let way = if numbers.len() < FEWEST {
                Way::Alone
            } else {
                self.race.next()
            };
            self.trace_by(way, batch, numbers, answers);
        }
    }

    /// Traces some rays in each way, to measure them. Rays differ from one part of a picture to the next, so each way gets some of
    /// each part; and what is traced first loads nodes for the others, so the order alternates.
    #[inline(always)]
    fn measure(&mut self, batch: Rays<'_, S>, numbers: &[u32], answers: &mut [Q::Answer]) {
        self.shares.iter_mut().for_each(Vec::clear);
        for run in numbers.chunks(SHARES.iter().sum()) {
            let mut left = run;
            for (share, of_run) in self.shares.iter_mut().zip(SHARES) {
                let (first, rest) = left.split_at(of_run.min(left.len()));
                share.extend_from_slice(first);
                left = rest;
            }
        }
        let mut times = [0.0; SHARES.len()];
        let is_backwards = !self.race.rounds().is_multiple_of(2);
        for i in 0..times.len() {
            let i = if is_backwards { times.len() - 1 - i } else { i };
            let share = std::mem::take(&mut self.shares[i]);
            let clock = Stopwatch::start();
            self.trace_by(WAYS[i], batch, &share, answers);
            times[i] = clock.per_ray(share.len());
            self.shares[i] = share;
        }
        times.into_iter().for_each(|time| self.race.learn(time));
    }

    /// Traces the rays of these numbers.
    #[inline(always)]
    fn trace_by(
        &mut self,
        way: Way,
        (simd, tree, rays): Rays<'_, S>,
        numbers: &[u32],
        answers: &mut [Q::Answer],
    ) {
        if way == Way::Alone {
            for number in numbers {
                answers[*number as usize] = Q::one(simd, tree, &rays[*number as usize]);
            }
            return;
        }
        let take = |number: u32, answer: Option<Q::Answer>| {
            let number = number as usize;
            answers[number] = answer.unwrap_or_else(|| Q::one(simd, tree, &rays[number]));
        };
        if way == Way::Together {
            self.stream.trace(simd, tree, rays, numbers, take);
        } else {
            self.queue.trace(simd, tree, rays, numbers, take);
        }
    }
}
