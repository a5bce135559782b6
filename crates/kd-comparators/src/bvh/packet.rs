//! Packets: many rays through the hierarchy together.
//!
//! I. Wald, S. Boulos, P. Shirley, *Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies*, 2007;
//! Eleftheriades 2010, section 2.2.3. A packet enters a node as soon as one of its rays meets the box:
//!
//! - *early hit test*: the first ray that met the parent is tested first, and mostly decides;
//! - *early miss exit*: otherwise the bounds of all rays are compared with the box; if they miss, all rays miss;
//! - *first active ray tracking*: otherwise the other rays are tested in turn, and those before the first that meets the box
//!   are skipped below;
//! - in leaves each remaining ray is compared with the box before the triangles.
//!
//! The bounds require rays of one octant of directions. Rays of several octants become several packets.

use kd_core::{Hit, MAX_DEPTH, Ray};
use kd_trace::kit::{Any, Closest, Collect, PacketPlanes, Probe, Span};

use super::walk::{PreparedRay, walk};
use super::{Bvh, BvhCounts, BvhNode, BvhNodeView};

/// Largest number of rays of a packet (Wald et al. trace 16 × 16).
const MOST: usize = 256;
/// Fewer rays are traced one by one.
const LEAST: usize = 4;
/// The union of no ranges.
const NOWHERE: Span = Span {
    enter: f32::INFINITY,
    exit: f32::NEG_INFINITY,
};

impl Bvh {
    /// [`intersect_batch`](kd_trace::RayQuery::intersect_batch), with its counts. Slower.
    ///
    /// Both trace packets of up to 256 rays. They suit rays that are close together, as those of a tile of a picture, with
    /// neighbors next to each other. Rays further apart than triangles are large take longer than one by one: each leaf is
    /// entered for a few rays, and compared with many. Rays of several octants may be mixed.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch_counted(&self, rays: &[Ray], hits: &mut [Option<Hit>]) -> BvhCounts {
        let mut counts = BvhCounts::default();
        self.intersect_packets(rays, hits, &mut counts);
        counts
    }

    pub(super) fn intersect_packets(
        &self,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        probe: &mut impl Probe,
    ) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        hits.fill(None);
        let answer = |number: usize, closest: &Closest| hits[number] = closest.0;
        trace(self, rays, probe, answer);
    }

    pub(super) fn occluded_packets(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        occluded.fill(false);
        let answer = |number: usize, any: &Any| occluded[number] = any.0;
        trace(self, rays, &mut (), answer);
    }
}

/// A ray of a packet.
struct Member<C> {
    /// Index of the ray in the batch.
    number: usize,
    ray: PreparedRay,
    collector: C,
    /// Whether the collector wants no more hits.
    is_done: bool,
}

/// Traces rays in packets, and calls `answer` with the collector of each ray that meets the root.
fn trace<C: Collect + Default, P: Probe>(
    bvh: &Bvh,
    rays: &[Ray],
    probe: &mut P,
    mut answer: impl FnMut(usize, &C),
) {
    let mut octants: [Vec<Member<C>>; 8] = Default::default();
    for (first, rays) in (0..).step_by(MOST).zip(rays.chunks(MOST)) {
        for (number, ray) in (first..).zip(rays) {
            if let Some(ray) = PreparedRay::new(ray, bvh, probe) {
                let planes = ray.planes();
                let octant = (0..3).map(|axis| usize::from(planes.is_downwards(axis)) << axis);
                octants[octant.sum::<usize>()].push(Member {
                    number,
                    ray,
                    collector: C::default(),
                    is_done: false,
                });
            }
        }
        for members in &mut octants {
            trace_octant(bvh, members, probe);
            for member in members.drain(..) {
                answer(member.number, &member.collector);
            }
        }
    }
}

/// Traces rays of one octant.
fn trace_octant<C: Collect, P: Probe>(bvh: &Bvh, members: &mut [Member<C>], probe: &mut P) {
    let together = members.len() >= LEAST;
    let planes = || PacketPlanes::new(members.iter().map(|member| member.ray.planes()));
    let Some(planes) = together.then(planes).flatten() else {
        for member in members {
            walk(bvh, member.ray, &mut member.collector, probe);
        }
        return;
    };
    let mut packet = Packet {
        bvh,
        planes,
        range: NOWHERE,
        members,
    };
    packet.update_range();
    packet.walk(probe);
}

/// Rays that are traced together.
struct Packet<'a, C> {
    bvh: &'a Bvh,
    planes: PacketPlanes,
    /// The union of the ranges of all members.
    range: Span,
    members: &'a mut [Member<C>],
}

/// A node to visit later, and the first member that met its parent.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    node: u32,
    first: usize,
}

impl<C: Collect> Packet<'_, C> {
    fn walk<P: Probe>(&mut self, probe: &mut P) {
        let bvh = self.bvh;
        // On each level of a path two children are pushed and one is popped.
        let mut stack = [Pending::default(); MAX_DEPTH + 1];
        let mut pending = 1;
        while pending > 0 && self.range.enter <= self.range.exit {
            pending -= 1;
            let Pending { node: at, first } = stack[pending];
            let node = &bvh.nodes[at as usize];
            let Some(first) = self.first_in(node, first, probe) else {
                continue;
            };
            match node.view() {
                BvhNodeView::Leaf { .. } => self.visit(node, first, probe),
                BvhNodeView::Interior { axis, second } => {
                    probe.node();
                    let mut children = [second, at + 1];
                    if self.members[first].ray.planes().is_downwards(axis.index()) {
                        children.reverse();
                    }
                    // The nearer child is popped first.
                    for node in children {
                        stack[pending] = Pending { node, first };
                        pending += 1;
                    }
                }
            }
        }
    }

    /// The first member, from `first` on, that meets the box of a node.
    fn first_in<P: Probe>(&self, node: &BvhNode, first: usize, probe: &mut P) -> Option<usize> {
        let bounds = node.bounds();
        let meets = |member: &Member<C>, probe: &mut P| {
            !member.is_done && member.ray.clip(&bounds, probe).is_some()
        };
        if meets(&self.members[first], probe) {
            return Some(first);
        }
        probe.packet_box();
        if self.planes.all_miss(self.range, &bounds) {
            return None;
        }
        let others = self.members.iter().enumerate().skip(first + 1);
        let mut meeting = others.filter(|(_, member)| meets(member, probe));
        meeting.next().map(|(place, _)| place)
    }

    /// Compares the members from `first` on with a leaf and its triangles. `first` is known to meet the box.
    fn visit<P: Probe>(&mut self, leaf: &BvhNode, first: usize, probe: &mut P) {
        let BvhNodeView::Leaf {
            first: start,
            count,
        } = leaf.view()
        else {
            return;
        };
        let triangles = &self.bvh.triangles[start as usize..][..count as usize];
        let bounds = leaf.bounds();
        let mut is_changed = false;
        for (place, member) in self.members.iter_mut().enumerate().skip(first) {
            let meets =
                place == first || !member.is_done && member.ray.clip(&bounds, probe).is_some();
            if meets {
                probe.leaf(|| count);
                let before = member.ray.range().exit;
                let visited = member
                    .ray
                    .visit(triangles, &self.bvh.mesh, &mut member.collector);
                member.is_done = visited.is_break();
                is_changed |= member.is_done || member.ray.range().exit < before;
            }
        }
        if is_changed {
            self.update_range();
        }
    }

    /// A hit of one member may shorten the range of the packet.
    fn update_range(&mut self) {
        let active = self.members.iter().filter(|member| !member.is_done);
        self.range = active.fold(NOWHERE, |all, member| {
            let range = member.ray.range();
            Span {
                enter: all.enter.min(range.enter),
                exit: all.exit.max(range.exit),
            }
        });
    }
}
