//! Packets: many rays through the hierarchy together.
//!
//! I. Wald, S. Boulos, P. Shirley, *Ray Tracing Deformable Scenes Using Dynamic Bounding Volume Hierarchies*, 2007;
//! Eleftheriades 2010, section 2.2.3. A packet enters a node as soon as one of its rays is found that meets it:
//!
//! - *early hit test*: that is the first one that met the parent, most of the time, and no other is looked at;
//! - *early miss exit*: if not, bounds of all rays are compared with the box, and if they miss it so do the rays;
//! - *first active ray tracking*: else the others are tried in turn, and those before the first that meets the box are not
//!   looked at again below;
//! - in leaves each ray that is left is compared with the box before the triangles.
//!
//! The bounds need rays that go the same way on every axis. Of others, each octant makes a packet of its own.

use kd_core::{Hit, MAX_DEPTH, Mesh, Ray};
use kd_trace::kit::{Any, Closest, Collect, PacketPlanes, Span};

use crate::bvh::Bvh;
use crate::counts::{BvhCounts, Probe};
use crate::node::{BvhNode, BvhNodeView};
use crate::walk::{PreparedRay, walk};

/// The most rays of a packet (Wald et al. trace 16 × 16).
const MOST: usize = 256;
/// Fewer than that are traced one by one.
const LEAST: usize = 4;
/// Around no ranges.
const NOWHERE: Span = Span {
    enter: f32::INFINITY,
    exit: f32::NEG_INFINITY,
};

impl Bvh {
    /// [`intersect`](Self::intersect) for many rays, up to 256 at a time. Answers are the same, bit for bit.
    ///
    /// Made for rays that lie close together, as those of a tile of a picture; put neighbours next to each other. Rays that
    /// lie further apart than triangles are large take longer than one by one: each leaf is entered for a few of them, and
    /// compared with many. Rays of different octants may be mixed, and are sorted out.
    ///
    /// # Panics
    ///
    /// If the slices differ in length; as [`intersect`](Self::intersect).
    pub fn intersect_packet(&self, mesh: &Mesh, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.closest_of_each(mesh, rays, hits, &mut ());
    }

    /// [`intersect_packet`](Self::intersect_packet), and what it took. Slower.
    ///
    /// # Panics
    ///
    /// As [`intersect_packet`](Self::intersect_packet).
    pub fn intersect_packet_counted(
        &self,
        mesh: &Mesh,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
    ) -> BvhCounts {
        let mut counts = BvhCounts::default();
        self.closest_of_each(mesh, rays, hits, &mut counts);
        counts
    }

    /// [`occluded`](Self::occluded) for many rays, as by [`intersect_packet`](Self::intersect_packet).
    ///
    /// # Panics
    ///
    /// If the slices differ in length; as [`intersect`](Self::intersect).
    pub fn occluded_packet(&self, mesh: &Mesh, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        occluded.fill(false);
        let answer = |number: usize, any: &Any| occluded[number] = any.0;
        trace(self, mesh, rays, &mut (), answer);
    }

    fn closest_of_each(
        &self,
        mesh: &Mesh,
        rays: &[Ray],
        hits: &mut [Option<Hit>],
        probe: &mut impl Probe,
    ) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        hits.fill(None);
        let answer = |number: usize, closest: &Closest| hits[number] = closest.0;
        trace(self, mesh, rays, probe, answer);
    }
}

/// A ray of a packet.
struct Member<C> {
    /// Which of all rays it is.
    number: usize,
    ray: PreparedRay,
    collector: C,
    /// Whether the collector wants no more.
    is_done: bool,
}

/// Traces rays in packets, and tells what was collected for each of those that meet the root.
fn trace<C: Collect + Default, P: Probe>(
    bvh: &Bvh,
    mesh: &Mesh,
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
            trace_octant(bvh, mesh, members, probe);
            for member in members.drain(..) {
                answer(member.number, &member.collector);
            }
        }
    }
}

/// Traces rays of one octant.
fn trace_octant<C: Collect, P: Probe>(
    bvh: &Bvh,
    mesh: &Mesh,
    members: &mut [Member<C>],
    probe: &mut P,
) {
    let together = members.len() >= LEAST;
    let planes = || PacketPlanes::new(members.iter().map(|member| member.ray.planes()));
    let Some(planes) = together.then(planes).flatten() else {
        for member in members {
            walk(bvh, mesh, member.ray, &mut member.collector, probe);
        }
        return;
    };
    let mut packet = Packet {
        bvh,
        mesh,
        planes,
        range: NOWHERE,
        members,
    };
    packet.update_range();
    packet.walk(probe);
}

/// Rays that go through the hierarchy together.
struct Packet<'a, C> {
    bvh: &'a Bvh,
    mesh: &'a Mesh,
    planes: PacketPlanes,
    /// Around the ranges of all members.
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
        // On each level of a path two children are put here, and one of them is taken out.
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
                    let mut children = [second, at + 1];
                    if self.members[first].ray.planes().is_downwards(axis.index()) {
                        children.reverse();
                    }
                    // The nearer one is taken first.
                    for node in children {
                        stack[pending] = Pending { node, first };
                        pending += 1;
                    }
                }
            }
        }
    }

    /// The first member, from `first` on, that meets a node's box.
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

    /// Compares the members from `first` on, which is known to meet it, with a leaf and its triangles.
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
                probe.triangles(count);
                let before = member.ray.range().exit;
                let visited = member
                    .ray
                    .visit(triangles, self.mesh, &mut member.collector);
                member.is_done = visited.is_break();
                is_changed |= member.is_done || member.ray.range().exit < before;
            }
        }
        if is_changed {
            self.update_range();
        }
    }

    /// Once a member has found something, less may be of interest to all.
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
