//! A packet: eight rays together, a lane for each.
//!
//! Rays whose directions are largest on the same axis, with the same signs on all axes, form a group and traverse together:
//! each box that meets the [beam] around the group is tested against all rays, and so is each triangle of a leaf. One or two
//! remaining rays go on alone ([`walk`](super::walk)).
//!
//! (I. Wald, P. Slusallek, C. Benthin, M. Wagner, *Interactive Rendering with Coherent Ray Tracing*, 2001.)
#![allow(
    unsafe_code,
    reason = "children are followed without a check of their indices: see `WideTree::node`"
)]

mod beam;
mod slabs;
mod triangles;

use kd_core::{Hit, RayPacket8};
use kd_simd::{F32x8, LANES, Mask, Number, Simd, max_lane, min};
use kd_wide::{Child, WIDTH, WideNode, WideTree};

use super::limits::{LEAST_DIRECTION, MOST_COORDINATE, MOST_DIRECTION, fits};
use super::subtree::Subtree;
use crate::collect::Collect;
use crate::dispatch::{Search, TraceSimd};
use beam::Beam;
use slabs::Slabs;
use triangles::Triangles;

/// At most this number of rays is faster one by one.
const FEW: u32 = 2;

/// The entry distance of a ray that misses the box.
const NEVER: f32 = f32::INFINITY;
/// The limit of a ray that is done.
const OVER: f32 = f32::NEG_INFINITY;

/// Traces the ray of each lane, with its own collector.
#[inline(always)]
pub(crate) fn trace<S: TraceSimd, C: Search>(
    simd: S,
    tree: &WideTree,
    packet: &RayPacket8,
) -> [C; LANES] {
    let mut found = Found {
        collectors: std::array::from_fn(|_| C::default()),
        limits: [OVER; LANES],
    };
    let mut left = usual(simd, tree, packet).bits();
    let mut others = u32::MAX >> (u32::BITS as usize - LANES) & !left;
    while left != 0 {
        let group = Group::of_first(simd, packet, left);
        left &= !group.lanes;
        if group.lanes.count_ones() <= FEW {
            others |= group.lanes;
            continue;
        }
        found.begin(packet, group.lanes);
        let mut tracer = Tracer {
            simd,
            tree,
            packet,
            found: &mut found,
        };
        tracer.trace(&group);
    }
    for lane in Bits(others) {
        let ray = packet.ray(lane);
        found.collectors[lane].search(simd, Subtree::whole(tree), &ray, &mut ());
    }
    found.collectors
}

/// The lanes of the set bits, in order. (A loop over these is compiled for the level. A closure for each of them was not, and
/// took eight times as long.)
struct Bits(u32);

impl Iterator for Bits {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize % LANES;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

/// The collectors of all rays, and how far each ray still goes.
struct Found<C> {
    collectors: [C; LANES],
    /// Or [`OVER`].
    limits: [f32; LANES],
}

impl<C: Collect> Found<C> {
    /// Begins the rays of some lanes.
    #[inline(always)]
    fn begin(&mut self, packet: &RayPacket8, lanes: u32) {
        self.limits = [OVER; LANES];
        for lane in Bits(lanes) {
            self.limits[lane] = min(packet.t_max[lane], f32::MAX);
        }
    }

    #[inline(always)]
    fn take(&mut self, lane: usize, hit: Hit) {
        // The collector knows whether the ray is done.
        let _ = self.collectors[lane].take(hit);
        self.update(lane);
    }

    /// After a collector has taken hits.
    #[inline(always)]
    fn update(&mut self, lane: usize) {
        let collector = &self.collectors[lane];
        self.limits[lane] = if collector.is_done() {
            OVER
        } else {
            min(collector.limit(), self.limits[lane])
        };
    }
}

/// The lanes whose rays can hit something, on either side, and are within the [limits](super::limits).
#[inline(always)]
fn usual<S: Simd>(simd: S, tree: &WideTree, packet: &RayPacket8) -> <S::F32 as Number>::Mask {
    let [x, y, z] = &packet.origin;
    let (x, y, z) = (simd.load(x).abs(), simd.load(y).abs(), simd.load(z).abs());
    let most = simd.splat(if fits(tree.frame()) {
        MOST_COORDINATE
    } else {
        OVER
    });
    let is_near = x.le(most) & y.le(most) & z.le(most);
    let [x, y, z] = &packet.direction;
    let (x, y, z) = (simd.load(x).abs(), simd.load(y).abs(), simd.load(z).abs());
    let most = simd.splat(MOST_DIRECTION);
    let largest = x.max(y).max(z);
    // Each component separately: the larger of a number and NaN may be the number.
    let is_usual = x.le(most)
        & y.le(most)
        & z.le(most)
        & simd.splat(LEAST_DIRECTION).le(largest)
        & simd.load(&packet.t_min).le(simd.load(&packet.t_max));
    let mut sees = [0.0; LANES];
    for (lane, sees) in sees.iter_mut().enumerate() {
        let sees_both = (packet.mask[lane] != 0) & packet.culling[lane].is_none();
        *sees = f32::from(u8::from(sees_both));
    }
    is_near & is_usual & simd.splat(1.0).le(simd.load(&sees))
}

/// Coherent rays.
struct Group {
    /// A bit for each ray.
    lanes: u32,
    /// Across, across, and along, the axis of the largest components.
    axes: [usize; 3],
    /// As in the orders of nodes.
    octant: usize,
}

impl Group {
    /// The rays that are coherent with the first one.
    #[inline(always)]
    fn of_first<S: Simd>(simd: S, packet: &RayPacket8, among: u32) -> Self {
        let [x, y, z] = &packet.direction;
        let (x, y, z) = (simd.load(x), simd.load(y), simd.load(z));
        let first = among.trailing_zeros();
        let mut lanes = among;
        let mut octant = 0;
        let zero = simd.splat(0.0);
        let is_down = [x.lt(zero).bits(), y.lt(zero).bits(), z.lt(zero).bits()];
        for (axis, is_down) in is_down.into_iter().enumerate() {
            let is_first_down = is_down >> first & 1;
            lanes &= if is_first_down != 0 {
                is_down
            } else {
                !is_down
            };
            octant |= (is_first_down as usize) << axis;
        }
        let (x, y, z) = (x.abs(), y.abs(), z.abs());
        let is_x = (y.le(x) & z.le(x)).bits();
        let is_y = !is_x & z.le(y).bits();
        let along = [is_x, is_y, !is_x & !is_y];
        let along = along.iter().position(|lanes| lanes >> first & 1 != 0);
        let along = along.unwrap_or(2);
        lanes &= [is_x, is_y, !is_x & !is_y][along];
        Self {
            lanes,
            axes: [(along + 1) % 3, (along + 2) % 3, along],
            octant,
        }
    }
}

/// A child to visit later.
#[derive(Clone, Copy)]
struct Pending {
    child: Child,
    /// The distance at which each ray enters its box, or [`NEVER`].
    enters: [f32; LANES],
}

/// Traces a group.
struct Tracer<'a, S: TraceSimd, C> {
    simd: S,
    tree: &'a WideTree,
    packet: &'a RayPacket8,
    found: &'a mut Found<C>,
}

impl<S: TraceSimd, C: Search> Tracer<'_, S, C> {
    #[inline(always)]
    fn trace(&mut self, group: &Group) {
        let simd = self.simd;
        let tree = self.tree;
        let slabs = Slabs::new(simd, self.tree.frame(), self.packet, group.octant);
        let beam = Beam::new(simd, self.packet, &slabs, group.lanes);
        let triangles = Triangles::new(simd, self.packet, group.axes, slabs.reach());
        let mut stack = smallvec::SmallVec::<[Pending; 64]>::new();
        stack.push(Pending {
            child: tree.root(),
            enters: slabs.starts(),
        });
        while let Some(next) = stack.pop() {
            let lanes = simd
                .load(&next.enters)
                .le(simd.load(&self.found.limits))
                .bits();
            if lanes == 0 {
                continue;
            }
            if lanes.count_ones() <= FEW {
                self.go_on_alone(next.child, lanes);
                continue;
            }
            if next.child.is_leaf() {
                // SAFETY: the root or a child of a node; and a leaf.
                let blocks = unsafe { tree.leaf(next.child) };
                for block in blocks {
                    triangles.visit(simd, block, &beam, lanes, self.found);
                }
                continue;
            }
            // SAFETY: the root or a child of a node; and no leaf.
            let node = unsafe { tree.node(next.child) };
            let met = beam.meets(simd, node, max_lane(&self.found.limits)).bits();
            let order = node.orders[group.octant];
            for place in 0..WIDTH {
                let lane = (order >> (3 * place)) as usize % WIDTH;
                if met >> lane & 1 != 0 {
                    push(simd, &slabs, node, lane, &self.found.limits, &mut stack);
                }
            }
        }
    }

    /// Traces some rays one by one below a child.
    #[inline(always)]
    fn go_on_alone(&mut self, child: Child, lanes: u32) {
        for lane in Bits(lanes) {
            let mut ray = self.packet.ray(lane);
            ray.t_max = self.found.limits[lane];
            // SAFETY: the root or a child of a node of the tree.
            let subtree = unsafe { Subtree::below(self.tree, child) };
            self.found.collectors[lane].search(self.simd, subtree, &ray, &mut ());
            self.found.update(lane);
        }
    }
}

/// Pushes a child if a ray may meet its box.
#[inline(always)]
fn push<S: Simd>(
    simd: S,
    slabs: &Slabs<S::F32>,
    node: &WideNode,
    lane: usize,
    limits: &[f32; LANES],
    stack: &mut smallvec::SmallVec<[Pending; 64]>,
) {
    let (enters, leaves) = slabs.span(simd, node, lane);
    let is_met = enters.le(leaves.min(simd.load(limits)));
    if is_met.bits() == 0 {
        return;
    }
    let mut pending = Pending {
        child: node.children[lane],
        enters: [NEVER; LANES],
    };
    enters.store_where(is_met, &mut pending.enters);
    stack.push(pending);
}
