//! One ray alone: one loop, with its state in registers.
//!
//! It differs from [`walk`](crate::wide::walk), which is for rays that are prepared already, in this:
//!
//! - The ray is prepared for triangles when it meets its first leaf. Many rays meet none.
//! - The closest hit is decided in f64 once, at the end. On the way each candidate is known by the
//!   [interval of its depth](candidates), and the nearest one that is surely hit ends the ray. Candidates are decided at once only
//!   where intervals overlap, or where a hit is not sure.
//! - The hit is returned in registers.
//!
//! A ray with a culling traverses in the same loop, and decides every candidate.

use std::arch::x86_64::*;
use std::ops::ControlFlow;

use kd_core::{Hit, Ray};
use kd_simd::{Avx2, min};
use kd_wide::{Block, WIDTH, WideTree};

use super::nodes::{NodeRay, Numbers, Prepared, enter, sees_less};
use super::opaque;
use super::triangles::{Lanes, TriangleRay, candidates};
use crate::collect::{self, Collect};
use crate::decision::{BothSides, Sees};
use crate::dispatch::NO_HIT;
use crate::probe::Probe;
use crate::wide::eight::BlockLane;
use crate::wide::portable::PortableRay;
use crate::wide::stack::Stack;
use crate::wide::subtree::Subtree;
use crate::wide::walk::walk;

/// The number of no triangle.
const NOTHING: u32 = u32::MAX;

/// The closest hit, or [`NO_HIT`].
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline(never)]
pub(super) fn closest<P: Probe>(simd: Avx2, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> Hit {
    if sees_less(ray) {
        return unusual::<collect::Closest, P>(simd, subtree, ray, probe)
            .0
            .unwrap_or(NO_HIT);
    }
    let numbers = Numbers::one_by_one(ray);
    match NodeRay::usual(&numbers, subtree.tree().frame()) {
        Prepared::Unusual => unusual::<collect::Closest, P>(simd, subtree, ray, probe)
            .0
            .unwrap_or(NO_HIT),
        Prepared::Usual(nodes) => {
            let mut progress = Progress::new(&nodes);
            let mut query = Closest::new(simd);
            trace(
                subtree,
                || numbers,
                &nodes,
                &mut progress,
                &mut query,
                probe,
            );
            query.hit(subtree.tree().blocks(), &progress, probe)
        }
    }
}

/// Whether there is a hit.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline(never)]
pub(super) fn any<P: Probe>(simd: Avx2, subtree: Subtree<'_>, ray: &Ray, probe: &mut P) -> bool {
    if sees_less(ray) {
        return unusual::<collect::Any, P>(simd, subtree, ray, probe).0;
    }
    let numbers = Numbers::one_by_one(ray);
    match NodeRay::usual(&numbers, subtree.tree().frame()) {
        Prepared::Unusual => unusual::<collect::Any, P>(simd, subtree, ray, probe).0,
        Prepared::Usual(nodes) => {
            let mut progress = Progress::new(&nodes);
            let mut query = Any::new(simd);
            trace(
                subtree,
                || numbers,
                &nodes,
                &mut progress,
                &mut query,
                probe,
            );
            query.is_hit
        }
    }
}

/// Gives the collector every hit that it may want, roughly front to back.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline(never)]
pub(super) fn collect<C: Collect, P: Probe>(
    simd: Avx2,
    subtree: Subtree<'_>,
    ray: &Ray,
    collector: &mut C,
    probe: &mut P,
) {
    if sees_less(ray) {
        return trace_unusual(simd, subtree, ray, collector, probe);
    }
    let numbers = Numbers::one_by_one(ray);
    match NodeRay::usual(&numbers, subtree.tree().frame()) {
        Prepared::Unusual => trace_unusual(simd, subtree, ray, collector, probe),
        Prepared::Usual(nodes) => {
            collect_usual(simd, subtree, numbers, &nodes, BothSides, collector, probe);
        }
    }
}

/// Gives the collector every hit of a usual ray that it may want, on the sides that the ray sees.
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
fn collect_usual<C: Collect, V: Sees, P: Probe>(
    simd: Avx2,
    subtree: Subtree<'_>,
    numbers: Numbers,
    nodes: &NodeRay,
    sees: V,
    collector: &mut C,
    probe: &mut P,
) {
    let mut query = Collecting {
        simd,
        sees,
        collector,
    };
    let mut progress = Progress::new(nodes);
    trace(subtree, || numbers, nodes, &mut progress, &mut query, probe);
}

/// The collector of the answer of a ray that is not usual.
#[cold]
#[inline(never)]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn unusual<C: Collect + Default, P: Probe>(
    simd: Avx2,
    subtree: Subtree<'_>,
    ray: &Ray,
    probe: &mut P,
) -> C {
    let mut collector = C::default();
    trace_unusual(simd, subtree, ray, &mut collector, probe);
    collector
}

#[cold]
#[inline(never)]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn trace_unusual<C: Collect, P: Probe>(
    simd: Avx2,
    subtree: Subtree<'_>,
    ray: &Ray,
    collector: &mut C,
    probe: &mut P,
) {
    if !ray.can_hit() {
        return;
    }
    if !ray.culling.is_none() {
        let numbers = Numbers::of(ray);
        if let Prepared::Usual(nodes) = NodeRay::usual(&numbers, subtree.tree().frame()) {
            let sees = ray.culling;
            collect_usual(simd, subtree, numbers, &nodes, sees, collector, probe);
            return;
        }
    }
    if let Some(ray) = PortableRay::new(ray, subtree.tree().frame()) {
        walk(subtree, &ray, collector, probe);
    }
}

/// What a usual ray looks for, and what it has found.
pub(crate) trait Query {
    /// Whether the first hit found ends the search.
    const ANY: bool;
    /// The ray as blocks need it.
    type Ray: BlockRay;

    /// Tests the triangles of a block up to a limit, and lowers the limit. Breaks if no other hit can matter. Each `Caller` gets a
    /// copy of its own, which the compiler inlines.
    fn visit<P: Probe, Caller>(
        &mut self,
        ray: &Self::Ray,
        place: Place<'_>,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()>;
}

/// A usual ray, prepared for what is in blocks.
pub(crate) trait BlockRay {
    /// At the first leaf of a ray.
    fn prepare(numbers: &Numbers, tree: &WideTree, limit: &mut Limit) -> Self;
}

impl BlockRay for TriangleRay {
    #[inline(always)]
    fn prepare(numbers: &Numbers, tree: &WideTree, limit: &mut Limit) -> Self {
        // SAFETY: `Numbers` are made where there is an `Avx2`.
        let ray = unsafe { Self::new(numbers, tree.frame()) };
        limit.depth = limit.steps * ray.speed;
        ray
    }
}

/// A block of a tree.
#[derive(Clone, Copy)]
pub(crate) struct Place<'a> {
    pub(super) block: &'a Block,
    index: usize,
    /// All blocks of the tree.
    blocks: &'a [Block],
}

/// No hit behind it matters.
pub(crate) struct Limit {
    pub(super) steps: f32,
    /// Unknown before the first leaf.
    depth: f32,
}

/// What changes while a ray traverses, whatever it looks for.
pub(crate) struct Progress<R> {
    pub(super) limit: Limit,
    /// The ray as it was prepared for blocks, if it met some.
    prepared: Option<R>,
}

impl<R> Progress<R> {
    /// At the start of a ray.
    #[inline(always)]
    pub(super) fn new(nodes: &NodeRay) -> Self {
        Self {
            limit: Limit {
                steps: nodes.end,
                depth: f32::INFINITY,
            },
            prepared: None,
        }
    }
}

/// The traversal loop. `numbers` are those of the ray, for its first leaf. Their closure has a type of its own in each caller, so each
/// caller gets a copy that the compiler inlines. (With a shared copy, rays for any hit took 1.4 times as long:
/// `cargo xtask rays --scenes DIR`, 2026-11-30.)
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
#[inline]
pub(super) fn trace<Q: Query, P: Probe, Caller: Fn() -> Numbers>(
    subtree: Subtree<'_>,
    numbers: Caller,
    nodes: &NodeRay,
    progress: &mut Progress<Q::Ray>,
    query: &mut Q,
    probe: &mut P,
) {
    let rows = nodes.rows;
    let Progress { limit, prepared } = progress;
    let mut stack = Stack::new();
    let mut pending = stack.pending();
    let tree = subtree.tree();
    let mut child = subtree.child();
    loop {
        if !child.is_leaf() {
            // Loaded again after each leaf: its triangles need the registers.
            let axes = opaque(nodes).broadcast();
            let most = _mm256_set1_ps(limit.steps);
            loop {
                probe.node();
                // SAFETY: the child of a subtree or of a node, and no leaf.
                let node = unsafe { tree.node(child) };
                let before = pending.len();
                let entered = if Q::ANY {
                    enter::<true>(node, rows, &axes, most, &mut pending)
                } else {
                    enter::<false>(node, rows, &axes, most, &mut pending)
                };
                let next = match entered {
                    None if Q::ANY => pending.pop_any(),
                    None => pending.pop(limit.steps),
                    next => {
                        // The one after `next`. (To load all of them took 2 to 5 % longer
                        // in eight scenes; throw-away program, 2026-11-30.)
                        if pending.len() > before {
                            tree.prefetch(pending.last());
                        }
                        next
                    }
                };
                let Some(next) = next else { return };
                child = next;
                if child.is_leaf() {
                    break;
                }
            }
        }
        // SAFETY: the child of a subtree or of a node, and a leaf.
        let blocks = unsafe { tree.leaf(child) };
        probe.leaf(|| blocks.iter().map(Block::count).sum());
        let ray = prepared.get_or_insert_with(|| Q::Ray::prepare(&numbers(), tree, limit));
        for (index, block) in (child.blocks().start..).zip(blocks) {
            probe.block();
            let place = Place {
                block,
                index,
                blocks: tree.blocks(),
            };
            // Each block loads the numbers of the ray again: in registers they would leave none for the triangles.
            let found = query.visit::<P, Caller>(opaque(ray), place, limit, probe);
            if found.is_break() {
                return;
            }
        }
        let next = if Q::ANY {
            pending.pop_any()
        } else {
            pending.pop(limit.steps)
        };
        let Some(next) = next else { return };
        child = next;
    }
}

/// The closest hit.
pub(crate) struct Closest {
    simd: Avx2,
    /// The [number](BlockLane::number) of a triangle that is surely hit, before `best` and at `first` or behind it; or [`NOTHING`].
    sure: u32,
    first: f32,
    /// The first decided hit, or [`NO_HIT`].
    best: Hit,
}

impl Query for Closest {
    const ANY: bool = false;
    type Ray = TriangleRay;

    #[inline(always)]
    fn visit<P: Probe, Caller>(
        &mut self,
        ray: &TriangleRay,
        place: Place<'_>,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // SAFETY: there is an `Avx2`.
        unsafe { self.visit::<P, Caller>(ray, place, limit, probe) };
        ControlFlow::Continue(())
    }
}

impl Closest {
    #[inline(always)]
    pub(super) fn new(simd: Avx2) -> Self {
        Self {
            simd,
            sure: NOTHING,
            first: f32::INFINITY,
            best: NO_HIT,
        }
    }

    /// The hit in the end, or [`NO_HIT`]. `blocks` are those of the tree.
    #[inline(always)]
    pub(super) fn hit<P: Probe>(
        &self,
        blocks: &[Block],
        progress: &Progress<TriangleRay>,
        probe: &mut P,
    ) -> Hit {
        match &progress.prepared {
            Some(ray) if self.sure != NOTHING => {
                probe.decision();
                let BlockLane { block, lane } = BlockLane::new(blocks, self.sure);
                ray.hit(block, lane)
            }
            _ => self.best,
        }
    }

    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn visit<P: Probe, Caller>(
        &mut self,
        ray: &TriangleRay,
        place: Place<'_>,
        limit: &mut Limit,
        probe: &mut P,
    ) {
        let Place {
            block,
            index,
            blocks,
        } = place;
        let Some(candidates) = candidates::<(Self, P, Caller)>(ray, block, limit.depth) else {
            return;
        };
        let candidates = candidates.in_front();
        let lanes = candidates.lanes;
        if lanes & (lanes - 1) == 0 {
            let lane = lanes.trailing_zeros();
            let [first, last] = candidates.interval(lane);
            let lane = lane as usize % WIDTH;
            if candidates.sure != 0 && last < self.first {
                self.sure = BlockLane::number(index, lane);
                self.first = first;
                limit.depth = last;
                // Two roundings: the bound between planes and hits has room for them.
                limit.steps = last * ray.per_depth;
                return;
            }
            let is_known = (first == self.first) & (last == limit.depth) & (self.sure != NOTHING)
                && BlockLane::new(blocks, self.sure).triangle() == block.triangles[lane];
            if is_known {
                return;
            }
        }
        probe.decision();
        if self.sure != NOTHING {
            let BlockLane { block, lane } = BlockLane::new(blocks, self.sure);
            self.best = first_of(self.best, ray.hit(block, lane));
        }
        self.best = decide_closest(self.simd, ray, self.best, block, lanes);
        self.sure = NOTHING;
        self.first = f32::INFINITY;
        // False for `NO_HIT`.
        if self.best.t <= limit.steps {
            limit.steps = self.best.t;
            limit.depth = min(limit.depth, self.best.t * ray.speed);
        }
    }
}

/// The first of two hits, of which the first may be [`NO_HIT`].
#[inline(always)]
fn first_of(best: Hit, hit: Hit) -> Hit {
    if best.t.is_nan() || hit.is_before(&best) {
        hit
    } else {
        best
    }
}

/// The first of a decided hit and some lanes of a block.
#[cold]
#[inline(never)]
#[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
fn decide_closest(simd: Avx2, ray: &TriangleRay, best: Hit, block: &Block, lanes: u32) -> Hit {
    let mut best = best;
    for lane in Lanes(lanes) {
        if let Some(hit) = ray.decide(simd, block, lane, BothSides) {
            best = first_of(best, hit);
        }
    }
    best
}

/// Any hit.
pub(crate) struct Any {
    simd: Avx2,
    pub(super) is_hit: bool,
}

impl Query for Any {
    const ANY: bool = true;
    type Ray = TriangleRay;

    #[inline(always)]
    fn visit<P: Probe, Caller>(
        &mut self,
        ray: &TriangleRay,
        place: Place<'_>,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // SAFETY: there is an `Avx2`.
        unsafe { self.visit::<P, Caller>(ray, place.block, limit, probe) }
    }
}

impl Any {
    #[inline(always)]
    pub(super) fn new(simd: Avx2) -> Self {
        Self {
            simd,
            is_hit: false,
        }
    }

    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn visit<P: Probe, Caller>(
        &mut self,
        ray: &TriangleRay,
        block: &Block,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let Some(candidates) = candidates::<(Self, P, Caller)>(ray, block, limit.depth) else {
            return ControlFlow::Continue(());
        };
        let mut any = collect::Any(candidates.sure != 0);
        if !any.0 {
            // What it returns is whether there is a hit.
            let _ = ray.take_each(
                self.simd,
                block,
                candidates.lanes,
                BothSides,
                &mut any,
                probe,
            );
        }
        if !any.0 {
            return ControlFlow::Continue(());
        }
        self.is_hit = true;
        limit.steps = f32::NEG_INFINITY;
        ControlFlow::Break(())
    }
}

/// Every hit that a collector may want, on the sides that the ray sees.
struct Collecting<'c, C, V> {
    simd: Avx2,
    sees: V,
    collector: &'c mut C,
}

impl<C: Collect, V: Sees> Query for Collecting<'_, C, V> {
    const ANY: bool = C::ANY;
    type Ray = TriangleRay;

    #[inline(always)]
    fn visit<P: Probe, Caller>(
        &mut self,
        ray: &TriangleRay,
        place: Place<'_>,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()> {
        // SAFETY: there is an `Avx2`.
        unsafe { self.visit::<P, Caller>(ray, place.block, limit, probe) }
    }
}

impl<C: Collect, V: Sees> Collecting<'_, C, V> {
    #[target_feature(enable = "avx2,fma,popcnt,lzcnt,bmi1")]
    #[inline]
    fn visit<P: Probe, Caller>(
        &mut self,
        ray: &TriangleRay,
        block: &Block,
        limit: &mut Limit,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let Some(candidates) = candidates::<(Self, P, Caller)>(ray, block, limit.depth) else {
            return ControlFlow::Continue(());
        };
        let Self {
            simd,
            sees,
            collector,
        } = self;
        ray.take_each(*simd, block, candidates.lanes, *sees, *collector, probe)?;
        limit.steps = min(self.collector.limit(), limit.steps);
        limit.depth = limit.steps * ray.speed;
        ControlFlow::Continue(())
    }
}
