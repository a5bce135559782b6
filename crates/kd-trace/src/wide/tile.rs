//! Tiles: up to 64 coherent rays that traverse together.
//!
//! A tile has one traversal ([`trace`]). At each node its frustum is tested against eight children at once, and for each child
//! that it meets, the frusta of its groups of eight rays are tested against that child. The triangles of a leaf are prepared once
//! for all rays, and tested against groups before single rays ([`leaf`]). During the traversal, each ray keeps the triangle
//! that it hits first according to f32; at the end eight rays at a time are [decided](super::eight) with their triangles. Where
//! f32 cannot order two triangles, they are decided at once. Few remaining rays go on one by one ([`alone`]).
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

use super::eight;
use super::limits::fits;
use crate::collect::keep_first;
use crate::dispatch::TraceSimd;
use alone::Alone;
use frustum::Frustum;
use leaf::{Edges, MOST_SPREAD, Range, TERMS, TERMS_FROM_APEX, View};
use trace::Tracer;
use waiting::Waiting;

/// The largest number of rays of a tile.
pub(crate) const RAYS: usize = 64;
/// Groups of eight rays.
const GROUPS: usize = RAYS / LANES;
/// A value for each ray, by groups.
type PerRay<T> = [[T; LANES]; GROUPS];

/// The number of a ray without a triangle.
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

/// The state of up to 64 rays.
#[derive(Debug)]
struct Tile {
    view: View,
    /// Whether all rays start at the apex.
    is_apex: bool,
    turned: Turned,
    /// The differences of rays from the central ray.
    terms: [PerRay<f32>; TERMS],
    /// The depths of rays at `t = 0`.
    from: PerRay<f32>,
    /// The depths between which a hit counts: the begin of the ray, and its end or a certain hit.
    start: PerRay<f32>,
    limit: PerRay<f32>,
    /// Depth per unit of `t`.
    speed: PerRay<f32>,
    /// The triangle that the ray hits first, or [`NOTHING`]: eight times its block plus its lane.
    place: PerRay<u32>,
    /// The least depth of that hit.
    nearest: PerRay<f32>,
    groups: Frustum<[f32; LANES]>,
    ranges: [Range; TERMS],
    /// The frustum of all rays, in all lanes.
    whole: Frustum<[f32; LANES]>,
    /// The stack. It grows on demand and never shrinks.
    pending: Vec<Pending>,
    edges: Edges,
}

/// A child to visit later.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    /// Eight times the index of the node, plus the lane.
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
    fn turned_group(&self, group: usize) -> eight::Rays<'_> {
        let turned = &self.turned;
        eight::Rays {
            axes: self.view.axes,
            origin: turned.origin.each_ref().map(|rows| &rows[group]),
            direction: turned.direction.each_ref().map(|rows| &rows[group]),
            t_min: &turned.t_min[group],
            t_max: &turned.t_max[group],
        }
    }

    /// Keeps a decided hit.
    #[inline(always)]
    fn take(&mut self, number: usize, hit: Hit, hits: &mut [Option<Hit>]) {
        let (group, lane) = (number / LANES, number % LANES);
        keep_first(&mut hits[number], hit);
        // Rounded three times, so increased.
        let depth = self.from[group][lane] + hit.t * self.speed[group][lane];
        let limit = &mut self.limit[group][lane];
        *limit = min(depth * (1.0 + 4.0 * f32::EPSILON), *limit);
    }
}

/// Traces tiles through a tree, one after another.
pub(crate) struct Tiles<'a, S: TraceSimd> {
    simd: S,
    tree: &'a WideTree,
    /// Whether the tree is within the limits of tiles.
    fits: bool,
    tile: &'a mut Tile,
    alone: &'a mut Alone,
}

/// The memory of a tile, for one after another.
pub(crate) struct TileMemory {
    tile: Tile,
    alone: Alone,
}

impl TileMemory {
    pub(crate) fn new() -> Self {
        Self {
            tile: Tile::new(),
            alone: Alone::new(),
        }
    }
}

impl<'a, S: TraceSimd> Tiles<'a, S> {
    /// No rays yet.
    #[inline(always)]
    pub(crate) fn new(simd: S, tree: &'a WideTree, memory: &'a mut TileMemory) -> Self {
        Self {
            simd,
            tree,
            fits: fits(tree.frame()),
            tile: &mut memory.tile,
            alone: &mut memory.alone,
        }
    }

    /// Gathers up to [`RAYS`] rays, which are traced next; false if they are not coherent: if their directions are largest on
    /// different axes or signs, or if a slope differs by more than `most_spread`, at most [`MOST_SPREAD`], from the central one.
    #[inline(always)]
    pub(crate) fn gather(&mut self, rays: &[Ray], most_spread: f32) -> bool {
        self.fits
            && self
                .tile
                .gather(self.simd, rays, most_spread, self.tree.frame())
    }

    /// [`gather`](Self::gather) for rays that were not neighbors.
    #[inline(always)]
    pub(crate) fn gather_sorted(&mut self, rays: &[Ray]) -> bool {
        self.alone.expect_divergence();
        self.gather(rays, MOST_SPREAD)
    }

    /// The closest hits of the gathered rays.
    #[inline(always)]
    pub(crate) fn closest(&mut self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        hits.fill(None);
        self.trace::<false>(rays, hits);
        self.simd.apart(Waiting {
            blocks: self.tree.blocks(),
            tile: self.tile,
            hits,
        });
    }

    /// Whether each gathered ray hits anything.
    #[inline(always)]
    pub(crate) fn any(&mut self, rays: &[Ray], occluded: &mut [bool]) {
        self.trace::<true>(rays, &mut []);
        let limits = self.tile.limit.as_flattened();
        for (occluded, limit) in occluded.iter_mut().zip(limits) {
            *occluded = *limit == OVER;
        }
    }

    /// With the number of terms that the rays need.
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
            tile: self.tile,
            alone: self.alone,
            hits,
        });
    }
}
