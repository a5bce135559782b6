//! Neighbouring rays that go much the same way, in tiles of up to 64.
//!
//! A tile goes down the tree as one ([`trace`]): at each node its frustum is tested against eight children at once, and where
//! it meets one, the frusta of its groups of eight rays against that one. Where a leaf is met, its triangles are prepared once
//! for all rays, and tested against groups before single rays ([`leaf`]). Nothing here decides what is a hit: rays keep the
//! triangle that they hit first as far as f32 can tell, and in the end eight rays at a time are decided with theirs
//! ([`decide`]). Where f32 cannot tell, a triangle is decided at once. Where few rays of a tile are left, they go on one by
//! one ([`alone`]).
//!
//! (After A. Reshetov, A. Soupikov, J. Hurley, *Multi-Level Ray Tracing Algorithm*, 2005; I. Wald, S. Boulos, P. Shirley,
//! *Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies*, 2007; A. Reshetov, *Faster Ray Packets -
//! Triangle Intersection through Vertex Culling*, 2007.)

mod alone;
mod frustum;
mod gather;
mod leaf;
mod trace;
mod waiting;

use kd_core::{Hit, Ray};
use kd_simd::{LANES, min};
use kd_wide::WideTree;

use super::decide;
use super::usual::fits;
use crate::collect::keep_first;
use crate::dispatch::TraceSimd;
use alone::Alone;
use frustum::Frustum;
use leaf::{Edges, MOST_SPREAD, Range, TERMS, TERMS_FROM_APEX, View};
use trace::Tracer;
use waiting::Waiting;

/// Rays in a tile, at most.
pub(crate) const RAYS: usize = 64;
/// Groups of as many rays as there are lanes.
const GROUPS: usize = RAYS / LANES;
/// A number for each ray, by groups.
type PerRay<T> = [[T; LANES]; GROUPS];

/// Stands where a ray has no triangle.
const NOTHING: u32 = u32::MAX;
/// A depth that no ray reaches.
const OVER: f32 = f32::NEG_INFINITY;

/// Rays, their axes in the order across, across and along.
#[derive(Clone, Copy, Debug, Default)]
struct Turned {
    origin: [PerRay<f32>; 3],
    direction: [PerRay<f32>; 3],
    t_min: PerRay<f32>,
    t_max: PerRay<f32>,
}

/// What is known of up to 64 rays while they are traced.
#[derive(Debug)]
struct Tile {
    view: View,
    /// Whether all rays start at the apex.
    is_apex: bool,
    turned: Turned,
    /// What tells rays from the central one.
    terms: [PerRay<f32>; TERMS],
    /// Depths where rays are at `t = 0`.
    from: PerRay<f32>,
    /// Depths between which a hit counts: where the ray starts, and where it ends or surely hits something.
    start: PerRay<f32>,
    limit: PerRay<f32>,
    /// How much deeper the ray is at `t + 1`.
    speed: PerRay<f32>,
    /// The triangle that is met first, where no other is as near, as eight times its block and its lane.
    place: PerRay<u32>,
    /// Where, at the nearest.
    nearest: PerRay<f32>,
    groups: Frustum<[f32; LANES]>,
    ranges: [Range; TERMS],
    /// The frustum of all rays, in all lanes.
    whole: Frustum<[f32; LANES]>,
    /// A stack: as long as it has been needed so far.
    pending: Vec<Pending>,
    edges: Edges,
}

/// A child to visit later.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    /// Eight times the index of the node, and the lane.
    place: usize,
    enter: f32,
}

impl Tile {
    /// No rays.
    fn new() -> Self {
        Self {
            view: View::default(),
            is_apex: true,
            turned: Turned::default(),
            terms: Default::default(),
            from: Default::default(),
            start: Default::default(),
            limit: Default::default(),
            speed: Default::default(),
            place: Default::default(),
            nearest: Default::default(),
            groups: Frustum::default(),
            ranges: Default::default(),
            whole: Frustum::default(),
            pending: Vec::new(),
            edges: Edges::default(),
        }
    }

    /// The rays of a group.
    #[inline(always)]
    fn turned_group(&self, group: usize) -> decide::Rays<'_> {
        let turned = &self.turned;
        decide::Rays {
            axes: self.view.axes,
            origin: turned.origin.each_ref().map(|rows| &rows[group]),
            direction: turned.direction.each_ref().map(|rows| &rows[group]),
            t_min: &turned.t_min[group],
            t_max: &turned.t_max[group],
        }
    }

    /// Takes a hit that has been decided.
    #[inline(always)]
    fn take(&mut self, number: usize, hit: Hit, hits: &mut [Option<Hit>]) {
        let (group, lane) = (number / LANES, number % LANES);
        keep_first(&mut hits[number], hit);
        // Rounded three times; rounded on.
        let depth = self.from[group][lane] + hit.t * self.speed[group][lane];
        let limit = &mut self.limit[group][lane];
        *limit = min(depth * (1.0 + 4.0 * f32::EPSILON), *limit);
    }
}

/// What traces tiles through a tree, one after the other.
pub(crate) struct Tiles<'a, S: TraceSimd> {
    simd: S,
    tree: &'a WideTree,
    /// Whether there can be tiles at all.
    fits: bool,
    tile: Tile,
    alone: Alone<S>,
}

impl<'a, S: TraceSimd> Tiles<'a, S> {
    /// No rays yet.
    #[inline(always)]
    pub(crate) fn new(simd: S, tree: &'a WideTree) -> Self {
        Self {
            simd,
            tree,
            fits: fits(tree.frame()),
            tile: Tile::new(),
            alone: Alone::new(),
        }
    }

    /// Takes up to [`RAYS`] rays, to be traced next; false if they are not alike enough: if they do not go to the same side, or
    /// if their slopes are further than `most_spread`, at most [`MOST_SPREAD`], from the central one.
    #[inline(always)]
    pub(crate) fn gather(&mut self, rays: &[Ray], most_spread: f32) -> bool {
        self.fits
            && self
                .tile
                .gather(self.simd, rays, most_spread, self.tree.frame())
    }

    /// As [`gather`](Self::gather), for rays that were no neighbours.
    #[inline(always)]
    pub(crate) fn gather_sorted(&mut self, rays: &[Ray]) -> bool {
        self.alone.expect_parting();
        self.gather(rays, MOST_SPREAD)
    }

    /// What the last tile took, roughly in boxes that groups of eight rays were tested against.
    pub(crate) fn effort(&self) -> u32 {
        self.alone.effort()
    }

    /// The closest hits of the rays that have been gathered.
    #[inline(always)]
    pub(crate) fn closest(&mut self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        hits.fill(None);
        self.trace::<false>(rays, hits);
        self.simd.apart(Waiting {
            blocks: self.tree.blocks(),
            tile: &self.tile,
            hits,
        });
    }

    /// Whether the rays that have been gathered hit anything.
    #[inline(always)]
    pub(crate) fn any(&mut self, rays: &[Ray], occluded: &mut [bool]) {
        self.trace::<true>(rays, &mut []);
        let limits = self.tile.limit.as_flattened();
        for (occluded, limit) in occluded.iter_mut().zip(limits) {
            *occluded = *limit == OVER;
        }
    }

    /// With as many terms as are needed.
    #[inline(always)]
    fn trace<const ANY: bool>(&mut self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        if self.tile.is_apex {
            self.trace_with::<ANY, TERMS_FROM_APEX>(rays, hits);
        } else {
            self.trace_with::<ANY, TERMS>(rays, hits);
        }
    }

    #[inline(always)]
    fn trace_with<const ANY: bool, const TERMS: usize>(
        &mut self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) {
        self.simd.apart(Tracer::<S, ANY, TERMS> {
            simd: self.simd,
            tree: self.tree,
            rays,
            tile: &mut self.tile,
            alone: &mut self.alone,
            hits,
        });
    }
}
