//! The traversal of a tile.

use kd_core::{Hit, Ray};
use kd_simd::{F32x8, LANES, Mask, Number, Task, max_lane, min};
use kd_wide::{Block, Child, WIDTH, WideNode, WideTree};

use super::alone::Alone;
use super::frustum::{Boxes, meet, meet_each};
use super::leaf::{self, TERMS_FROM_APEX};
use super::{OVER, Pending, Tile};
use crate::dispatch::{TraceSimd, hit_or_none};
use crate::wide::eight::{BlockLane, decide};
use crate::wide::subtree::Subtree;

/// At most this number of rays is faster one by one. (With 4, primary rays of a scan took 1.2 times as long from one camera, and those
/// of five other scenes as long; with 16, those of a room took 1.08 times as long. Throw-away program, 2026-11-30. The mean over the
/// scenes of `cargo xtask rays --scenes DIR` is the same with 4.)
const FEW: u32 = 8;

/// Traces the rays that were gathered in a tile: up to 64.
pub(super) struct Tracer<'a, S: TraceSimd, const ANY: bool, const TERMS: usize> {
    pub(super) simd: S,
    pub(super) tree: &'a WideTree,
    pub(super) rays: &'a [Ray],
    pub(super) tile: &'a mut Tile,
    pub(super) alone: &'a mut Alone,
    /// The hits that are decided so far.
    pub(super) hits: &'a mut [Option<Hit>],
}

impl<S: TraceSimd, const ANY: bool, const TERMS: usize> Task<S> for Tracer<'_, S, ANY, TERMS> {
    type Output = ();

    #[inline(always)]
    fn run(mut self, _: S) {
        self.walk();
    }
}

impl<S: TraceSimd, const ANY: bool, const TERMS: usize> Tracer<'_, S, ANY, TERMS> {
    #[inline(always)]
    fn walk(&mut self) {
        let nodes = self.tree.nodes();
        let mut child = self.tree.root();
        let mut groups = u32::MAX >> (u32::BITS as usize - self.rays.len().div_ceil(LANES));
        let mut len = 0;
        self.alone.begin();
        loop {
            if child.is_leaf() {
                self.visit(child, groups);
            } else {
                let node = &nodes[child.index()];
                len = self.enter(node, child.index(), groups, len);
            }
            loop {
                if len == 0 {
                    self.alone.end();
                    return;
                }
                len -= 1;
                let Pending { place, enter } = self.tile.pending[len];
                if enter > self.tile.whole.limit[0] {
                    continue;
                }
                let (node, lane) = (&nodes[place / WIDTH], place % WIDTH);
                groups = self.groups_in(node, lane);
                if groups == 0 {
                    continue;
                }
                if self.alone.is_wary() {
                    let rays = self.rays_in(node, lane, groups);
                    if rays.count_ones() <= FEW {
                        let simd = self.simd;
                        simd.apart(Diverged {
                            tracer: self,
                            place,
                            rays,
                        });
                        self.update_limits(groups);
                        continue;
                    }
                }
                child = node.children[lane];
                break;
            }
        }
    }

    /// The rays of some groups that may meet a child, a bit for each.
    #[inline(always)]
    fn rays_in(&self, node: &WideNode, lane: usize, groups: u32) -> u64 {
        let simd = self.simd;
        let tile = &*self.tile;
        let boxes = Boxes::of_child(simd, &tile.view, node, lane);
        let mut rays = 0;
        let mut left = groups;
        while left != 0 {
            let group = left.trailing_zeros() as usize;
            left &= left - 1;
            let [a, b, c, d, _] = &tile.terms;
            let at = if TERMS > TERMS_FROM_APEX {
                [simd.load(&c[group]), simd.load(&d[group])]
            } else {
                [simd.splat(0.0); 2]
            };
            let [x, y] = tile.view.slope;
            let slope = [
                simd.load(&a[group]) + simd.splat(x),
                simd.load(&b[group]) + simd.splat(y),
            ];
            let range = [simd.load(&tile.start[group]), simd.load(&tile.limit[group])];
            let is_met = meet_each(simd, &tile.view, at, slope, range, &boxes);
            rays |= u64::from(is_met.bits()) << (group * LANES);
        }
        rays
    }

    /// Traces rays one by one below a child.
    #[inline(always)]
    fn trace_alone(&mut self, place: usize, rays: u64) {
        let mut left = rays;
        while left != 0 {
            let number = left.trailing_zeros() as usize;
            left &= left - 1;
            let (group, lane) = (number / LANES, number % LANES);
            let tile = &mut *self.tile;
            let (from, speed) = (tile.from[group][lane], tile.speed[group][lane]);
            let limit = &mut tile.limit[group][lane];
            // The limit was rounded, and so are these operations: increased.
            let more = 1.0 + 4.0 * f32::EPSILON;
            let t = (*limit * more - from) / speed * more;
            let mut ray = self.rays[number];
            ray.t_max = min(t, ray.t_max);
            let subtree = Subtree::at(self.tree, place);
            if ANY {
                if self.simd.any(subtree, &ray, &mut ()) {
                    *limit = OVER;
                }
                continue;
            }
            if let Some(hit) = hit_or_none(self.simd.closest(subtree, &ray, &mut ())) {
                tile.take(number, hit, self.hits);
            }
        }
    }

    /// Pushes the children that the groups may meet, the nearest last.
    #[inline(always)]
    fn enter(&mut self, node: &WideNode, index: usize, groups: u32, mut len: usize) -> usize {
        let simd = self.simd;
        let tile = &mut *self.tile;
        // The frustum of one group is narrower than that of all.
        let frustum = if groups.is_power_of_two() {
            tile.groups.splat(simd, groups.trailing_zeros() as usize)
        } else {
            tile.whole.load(simd)
        };
        let view = &tile.view;
        let boxes = Boxes::of_children(simd, view, node);
        let (is_met, enters) = meet(simd, &view.apex, &frustum, &boxes);
        let met = is_met.bits();
        let mut enter = [0.0; LANES];
        enters.store(&mut enter);
        let order = node.orders[view.octant];
        if tile.pending.len() < len + WIDTH {
            make_room(&mut tile.pending);
        }
        for place in 0..WIDTH {
            let lane = (order >> (3 * place)) as usize % WIDTH;
            tile.pending[len] = Pending {
                place: index * WIDTH + lane,
                enter: enter[lane],
            };
            len += (met >> lane & 1) as usize;
        }
        len
    }

    /// The groups that may meet a child.
    #[inline(always)]
    fn groups_in(&self, node: &WideNode, lane: usize) -> u32 {
        let simd = self.simd;
        let view = &self.tile.view;
        let boxes = Boxes::of_child(simd, view, node, lane);
        let (is_met, _) = meet(simd, &view.apex, &self.tile.groups.load(simd), &boxes);
        is_met.bits()
    }

    #[inline(always)]
    fn visit(&mut self, leaf: Child, groups: u32) {
        let simd = self.simd;
        let blocks = self.tree.blocks();
        let mut has_changed = false;
        self.alone.work(groups.count_ones());
        for index in leaf.blocks() {
            let block = &blocks[index];
            leaf::prepare::<S, TERMS>(simd, &self.tile.view, block, &mut self.tile.edges);
            // A bit for each pair of a group and a triangle, so that one loop visits all: fewer mispredicted branches.
            let mut pairs = 0_u64;
            let mut left = groups;
            while left != 0 {
                let group = left.trailing_zeros() as usize;
                left &= left - 1;
                let tile = &*self.tile;
                let range = [tile.groups.start[group], tile.groups.limit[group]];
                let lanes =
                    leaf::may_be_hit::<S, TERMS>(simd, &tile.edges, &tile.ranges, group, range);
                pairs |= u64::from(lanes) << (group * LANES);
            }
            while pairs != 0 {
                let pair = pairs.trailing_zeros() as usize;
                pairs &= pairs - 1;
                has_changed |= self.meet(pair / LANES, block, index, pair % LANES);
            }
        }
        if has_changed {
            self.update_limits(groups);
        }
    }

    /// A group and a triangle; whether the limit of a ray has changed.
    #[inline(always)]
    fn meet(&mut self, group: usize, block: &Block, index: usize, lane: usize) -> bool {
        let simd = self.simd;
        let tile = &mut *self.tile;
        let mut terms = [simd.splat(0.0); TERMS];
        for (term, rows) in terms.iter_mut().zip(&tile.terms) {
            *term = simd.load(&rows[group]);
        }
        let (start, limit) = (simd.load(&tile.start[group]), simd.load(&tile.limit[group]));
        let Some(sight) = leaf::sight(simd, &tile.edges, lane, &terms, [start, limit]) else {
            return false;
        };
        if sight.may_hit.bits() == 0 {
            return false;
        }
        let is_between = start.lt(sight.nearest) & sight.farthest.lt(limit);
        let is_sure = sight.is_inside & is_between & sight.may_hit;
        let unclear = if ANY {
            simd.splat(OVER)
                .store_where(is_sure, &mut tile.limit[group]);
            sight.may_hit & !is_sure
        } else {
            sight.farthest.store_where(is_sure, &mut tile.limit[group]);
            let nearest = simd.load(&tile.nearest[group]);
            // Infinite without a triangle.
            let is_first =
                simd.splat(f32::MAX).lt(nearest) | (is_sure & sight.farthest.lt(nearest));
            let is_kept = sight.may_hit & is_first;
            sight.nearest.store_where(is_kept, &mut tile.nearest[group]);
            let place = BlockLane::number(index, lane);
            S::F32::put(is_kept, place, &mut tile.place[group]);
            sight.may_hit & !is_first
        };
        let unclear = unclear.bits();
        let is_decided = unclear != 0
            && simd.apart(Unclear {
                tracer: self,
                group,
                place: BlockLane { block, lane },
                rays: unclear,
            });
        is_sure.bits() != 0 || is_decided
    }

    /// Decides for the rays of a group whose bits are set; whether the limit of a ray has changed.
    #[inline(always)]
    fn decide_at_once(&mut self, group: usize, place: BlockLane<'_>, unclear: u32) -> bool {
        let tile = &mut *self.tile;
        let decided = decide(self.simd, &tile.turned_group(group), place);
        let mut left = decided.is_hit & unclear;
        let has_changed = left != 0;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            if ANY {
                tile.limit[group][lane] = OVER;
                continue;
            }
            let hit = decided.hit(lane, place.triangle());
            tile.take(group * LANES + lane, hit, self.hits);
        }
        has_changed
    }

    /// Updates the limits of groups from those of their rays.
    #[inline(always)]
    fn update_limits(&mut self, groups: u32) {
        let tile = &mut *self.tile;
        let mut left = groups;
        while left != 0 {
            let group = left.trailing_zeros() as usize;
            left &= left - 1;
            tile.groups.limit[group] = max_lane(&tile.limit[group]);
        }
        tile.whole.limit = [max_lane(&tile.groups.limit); LANES];
    }
}

/// Rays that go on one by one below a child.
struct Diverged<'t, T> {
    tracer: &'t mut T,
    place: usize,
    rays: u64,
}

impl<S: TraceSimd, const ANY: bool, const TERMS: usize> Task<S>
    for Diverged<'_, Tracer<'_, S, ANY, TERMS>>
{
    type Output = ();

    #[inline(always)]
    fn run(self, _: S) {
        self.tracer.trace_alone(self.place, self.rays);
    }
}

/// Rays of a group that may hit a triangle.
struct Unclear<'t, 'b, T> {
    tracer: &'t mut T,
    group: usize,
    place: BlockLane<'b>,
    rays: u32,
}

impl<S: TraceSimd, const ANY: bool, const TERMS: usize> Task<S>
    for Unclear<'_, '_, Tracer<'_, S, ANY, TERMS>>
{
    /// Whether the limit of a ray has changed.
    type Output = bool;

    #[inline(always)]
    fn run(self, _: S) -> bool {
        self.tracer
            .decide_at_once(self.group, self.place, self.rays)
    }
}

/// Grows the stack by at least eight entries.
#[cold]
#[inline(never)]
fn make_room(pending: &mut Vec<Pending>) {
    pending.resize(2 * (pending.len() + WIDTH), Pending::default());
}
