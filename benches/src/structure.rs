//! What every structure under measurement can do, whoever wrote it.

use std::time::Instant;

use clap::ValueEnum;
use kd::tree::StatsOf;
use kd::{Hit, KdTree, Ray, RayPacket8};
use kd_trace::RayQuery;

use crate::memory::bytes_during;
use crate::record::Steps;

/// How a list of rays is traced.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum Manner {
    /// One ray at a time
    Single,
    /// The whole list at once
    Batch,
    /// Eight neighbors of the list at a time
    Packets,
}

/// A structure to measure. Queries take lists, so that one virtual call serves many rays.
pub(crate) trait Structure: Send + Sync {
    /// The closest hit of each ray.
    fn closest(&self, by: Manner, rays: &[Ray], hits: &mut [Option<Hit>]);
    /// Whether each ray hits anything.
    fn any(&self, by: Manner, rays: &[Ray], occluded: &mut [bool]);
    /// The closest hit of one ray and the steps it took, if the structure counts them.
    fn counted(&self, _: &Ray) -> Option<(Option<Hit>, Steps)> {
        None
    }
    fn shape(&self) -> Shape;
    /// A fault that can be found without rays.
    fn flaw(&self) -> Option<String> {
        None
    }
}

/// The closest hit of each ray.
pub(crate) fn closest<Q: RayQuery>(
    query: &Q,
    by: Manner,
    rays: &[Ray],
    hits: &mut [Option<Q::Hit>],
) {
    match by {
        Manner::Single => {
            for (ray, hit) in rays.iter().zip(hits) {
                *hit = query.intersect(ray);
            }
        }
        Manner::Batch => query.intersect_batch(rays, hits),
        Manner::Packets => {
            for (rays, hits) in rays.chunks(8).zip(hits.chunks_mut(8)) {
                let found = query.intersect8(&RayPacket8::new(rays));
                hits.copy_from_slice(&found[..hits.len()]);
            }
        }
    }
}

/// Whether each ray hits anything.
pub(crate) fn any<Q: RayQuery>(query: &Q, by: Manner, rays: &[Ray], occluded: &mut [bool]) {
    match by {
        Manner::Single => {
            for (ray, hit) in rays.iter().zip(occluded) {
                *hit = query.occluded(ray);
            }
        }
        Manner::Batch => query.occluded_batch(rays, occluded),
        Manner::Packets => {
            for (rays, hits) in rays.chunks(8).zip(occluded.chunks_mut(8)) {
                let found = query.occluded8(&RayPacket8::new(rays));
                hits.copy_from_slice(&found[..hits.len()]);
            }
        }
    }
}

/// A structure that counts no steps.
pub(crate) struct Queried<Q> {
    pub(crate) query: Q,
    pub(crate) shape: Box<dyn Fn(&Q) -> Shape + Send + Sync>,
}

impl<Q> Queried<Q> {
    pub(crate) fn new(query: Q, shape: impl Fn(&Q) -> Shape + Send + Sync + 'static) -> Self {
        let shape = Box::new(shape);
        Self { query, shape }
    }
}

impl<Q: RayQuery<Hit = Hit> + Send + Sync> Structure for Queried<Q> {
    fn closest(&self, by: Manner, rays: &[Ray], hits: &mut [Option<Hit>]) {
        closest(&self.query, by, rays, hits);
    }

    fn any(&self, by: Manner, rays: &[Ray], occluded: &mut [bool]) {
        any(&self.query, by, rays, occluded);
    }

    fn shape(&self) -> Shape {
        (self.shape)(&self.query)
    }
}

impl Structure for KdTree {
    fn closest(&self, by: Manner, rays: &[Ray], hits: &mut [Option<Hit>]) {
        closest(self, by, rays, hits);
    }

    fn any(&self, by: Manner, rays: &[Ray], occluded: &mut [bool]) {
        any(self, by, rays, occluded);
    }

    fn counted(&self, ray: &Ray) -> Option<(Option<Hit>, Steps)> {
        let (hit, counts) = self.intersect_counted(ray);
        let steps = Steps {
            node_steps: counts.nodes.into(),
            leaf_steps: counts.leaves.into(),
            triangle_tests: counts.triangles.into(),
        };
        Some((hit, steps))
    }

    fn shape(&self) -> Shape {
        let stats = self.stats();
        Shape {
            nodes: stats.nodes,
            leaves: stats.leaves,
            empty_leaves: stats.empty_leaves,
            refs: stats.references,
            depth: stats.depth,
            sah_cost_15_20: stats.sah_cost_15_20,
            sah_cost_own: stats.sah_cost_own,
            bytes_total: stats.bytes_kept(),
            text: stats.to_string(),
        }
    }

    fn flaw(&self) -> Option<String> {
        // Wide nodes that were made without a kd-tree are judged by their answers.
        if self.stats().of == StatsOf::WideNodes {
            return None;
        }
        let tree = self.kd_tree().map_err(|error| error.to_string());
        let covered = tree.and_then(|tree| {
            let covered = tree.check_coverage(self.mesh());
            covered.map_err(|missing| missing.to_string())
        });
        covered.err()
    }
}

/// Counts and costs of a structure; 0 where they are unknown.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub(crate) nodes: usize,
    pub(crate) leaves: usize,
    pub(crate) empty_leaves: usize,
    pub(crate) refs: usize,
    pub(crate) depth: usize,
    pub(crate) sah_cost_15_20: f64,
    pub(crate) sah_cost_own: f64,
    pub(crate) bytes_total: usize,
    /// All of it as text, for the report.
    pub(crate) text: String,
}

/// A structure, with the costs of its build.
pub(crate) struct Built {
    pub(crate) structure: Box<dyn Structure>,
    pub(crate) seconds: f64,
    /// The peak of allocated bytes, above the input; meaningful for a build on one thread.
    pub(crate) peak_bytes: usize,
}

impl Built {
    /// Runs `build`, the timed and counted part. `structure` wraps its result.
    pub(crate) fn of<T, E, S: Structure + 'static>(
        build: impl FnOnce() -> Result<T, E>,
        structure: impl FnOnce(T) -> S,
    ) -> Result<Self, E> {
        let start = Instant::now();
        let (value, bytes) = bytes_during(build);
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            structure: Box::new(structure(value?)),
            seconds,
            peak_bytes: bytes.peak,
        })
    }

    /// [`of`](Self::of) for a structure that counts no steps.
    pub(crate) fn queried<Q: RayQuery<Hit = Hit> + Send + Sync + 'static, E>(
        build: impl FnOnce() -> Result<Q, E>,
        shape: impl Fn(&Q) -> Shape + Send + Sync + 'static,
    ) -> Result<Self, E> {
        Self::of(build, |query| Queried::new(query, shape))
    }
}
