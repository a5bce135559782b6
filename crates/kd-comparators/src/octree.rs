//! An octree: boxes divided in the middle of each axis (Eleftheriades 2010 §2.3.2).

mod build;

use std::ops::ControlFlow;

use glam::Vec3;
use kd_core::{Aabb, Hit, Mesh, Ray};
use kd_trace::kit::{Collect, Frame, RayPlanes, Span, TriangleTest, max, min};
use smallvec::SmallVec;

use crate::query::{self, Walk};
use crate::{BuildError, Options, Stats};

/// An octree over a mesh: a comparator, to be measured beside the kd-tree.
///
/// It begins with the scene's box. A cell with more than [a few](Options::with_small_leaf) triangles is divided in the
/// middle of each axis into eight, and each triangle goes to every octant that it reaches into. Empty octants are not
/// stored. (Eleftheriades, *kd-tree merging*, 2010, §2.3.2.)
///
/// There, a ray finds the next cell by the side at which it leaves the last one. Here it goes down from the root and
/// passes the octants of each cell in the ray's order: sides are not certain where planes are crossed in an interval, and
/// empty octants need no neighbours.
#[derive(Clone, Debug)]
pub struct Octree {
    bounds: Aabb,
    /// The root is the first; there is none without triangles.
    nodes: Vec<Node>,
    refs: Vec<u32>,
    /// Divisions above the deepest leaf.
    depth: u32,
    large_leaves: usize,
}

/// A cell that is not empty.
#[derive(Clone, Copy, Debug)]
enum Node {
    /// A divided cell.
    Divided {
        /// Where it is divided, on each axis.
        middle: Vec3,
        /// The first of its children, which lie one after the other in ascending order of octants.
        first: u32,
        /// Which octants have a child. Bit `o` is octant `o`, which is above the middle of axis `k` if its bit `k` is set.
        octants: u8,
    },
    /// A list of triangles.
    Leaf { first: u32, count: u32 },
}

/// A node to visit later.
#[derive(Clone, Copy, Debug)]
struct Pending {
    node: u32,
    span: Span,
}

/// The depth that is not exceeded unless it is asked for.
const DEPTH: u32 = 16;

/// Room for a walk at that depth: all children of each node on a path but the one it goes on with. It grows where more was
/// asked for.
const STACK: usize = 128;
const _: () = assert!(STACK > 7 * DEPTH as usize, "nothing is allocated");

impl Octree {
    /// Builds the octree of a mesh.
    ///
    /// Takes O(N · depth) time for triangles that are small beside their cells. What bounds the others is
    /// [`Options::with_max_refs`]: there are no more leaves than references, and no more divided cells than the depth times
    /// the leaves. A cell is not divided either where all of its children that are not empty would hold as much as it does,
    /// as with triangles that coincide.
    ///
    /// # Errors
    ///
    /// [`BuildError`]: an option out of range, or more nodes than have an index.
    pub fn build(mesh: &Mesh, options: &Options) -> Result<Self, BuildError> {
        options.check()?;
        build::octree(mesh, options)
    }

    /// The closest hit, the lower triangle among equals, or `None`: equal to
    /// [`kd_trace::brute_force::intersect`] bit for bit.
    ///
    /// Expected time is that of the cells along the ray. Nothing is allocated up to the default depth.
    ///
    /// # Panics
    ///
    /// If `mesh` is not the one that the octree was built from, and has fewer triangles.
    pub fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        query::intersect(self, mesh, ray)
    }

    /// Whether there is any hit. Stops at the first one that is found.
    ///
    /// # Panics
    ///
    /// As [`intersect`](Self::intersect).
    pub fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool {
        query::occluded(self, mesh, ray)
    }

    /// The first `max` hits in `out`, which is cleared before: ordered by `t`, then by triangle, each triangle once.
    ///
    /// # Panics
    ///
    /// As [`intersect`](Self::intersect).
    pub fn hits(&self, mesh: &Mesh, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        query::hits(self, mesh, ray, max, out);
    }

    /// Counts and bytes. Takes time in proportion to the nodes.
    pub fn stats(&self) -> Stats {
        let is_leaf = |node: &&Node| matches!(node, Node::Leaf { .. });
        Stats {
            nodes: self.nodes.len(),
            leaves: self.nodes.iter().filter(is_leaf).count(),
            references: self.refs.len(),
            depth: self.depth as usize,
            large_leaves: self.large_leaves,
            bytes: size_of_val(&self.nodes[..]) + size_of_val(&self.refs[..]),
        }
    }
}

impl Walk for Octree {
    fn walk<C: Collect>(&self, mesh: &Mesh, ray: &Ray, collector: &mut C) {
        if self.nodes.is_empty() || !ray.can_hit() {
            return;
        }
        let planes = RayPlanes::new(ray, &Frame::new(&self.bounds));
        let Some(span) = planes.clip(ray, &self.bounds) else {
            return;
        };
        let test = TriangleTest::new(ray, planes.reach());
        let mut stack = SmallVec::<[Pending; STACK]>::new();
        stack.push(Pending { node: 0, span });
        while let Some(Pending { node, mut span }) = stack.pop() {
            let limit = planes.steps(collector.limit());
            // At the limit itself a lower triangle may lie.
            if span.enter > limit {
                continue;
            }
            match self.nodes[node as usize] {
                Node::Divided {
                    middle,
                    first,
                    octants,
                } => {
                    span.exit = min(limit, span.exit);
                    let octants = Octants::new(&planes, middle, octants);
                    octants.push(first, span, &mut stack);
                }
                Node::Leaf { first, count } => {
                    let refs = &self.refs[first as usize..][..count as usize];
                    let mut triangles = refs.iter();
                    let asked = triangles.try_for_each(|&t| test.ask(mesh, t, collector));
                    if asked == ControlFlow::Break(()) {
                        return;
                    }
                }
            }
        }
    }
}

/// The octants of one cell, as a ray meets them.
struct Octants {
    /// Where the far half along each axis starts.
    first: [f32; 3],
    /// Where the near half ends.
    last: [f32; 3],
    /// The octant that is near on each axis.
    nearest: u8,
    /// Those with a child.
    present: u8,
}

impl Octants {
    #[inline]
    fn new(planes: &RayPlanes, middle: Vec3, present: u8) -> Self {
        let crossings = [0, 1, 2].map(|axis| planes.crossing(axis, middle[axis]));
        Self {
            first: crossings.map(|crossing| crossing.first),
            last: crossings.map(|crossing| crossing.last),
            nearest: (0..3).fold(0, |bits, axis| {
                bits | u8::from(planes.is_downwards(axis)) << axis
            }),
            present,
        }
    }

    /// Puts the octants that the ray may meet on the stack, so that they come off front to back.
    ///
    /// Bit `k` of an octant's place in this order tells whether it is far on axis `k`. A ray goes from near to far on one
    /// axis after the other, so that places only grow along it.
    #[inline]
    fn push(&self, children: u32, span: Span, stack: &mut SmallVec<[Pending; STACK]>) {
        for place in (0..8_u8).rev() {
            let octant = place ^ self.nearest;
            if self.present & (1 << octant) == 0 {
                continue;
            }
            let Span {
                mut enter,
                mut exit,
            } = span;
            for axis in 0..3 {
                if place & (1 << axis) == 0 {
                    exit = min(self.last[axis], exit);
                } else {
                    enter = max(self.first[axis], enter);
                }
            }
            if enter <= exit {
                let before = self.present & ((1 << octant) - 1);
                stack.push(Pending {
                    node: children + before.count_ones(),
                    span: Span { enter, exit },
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The octants that a ray meets in the cube [-1, 1]³, in the order in which they are visited.
    fn visited(ray: &Ray, present: u8) -> Vec<u32> {
        let bounds = Aabb::around([Vec3::NEG_ONE, Vec3::ONE]);
        let planes = RayPlanes::new(ray, &Frame::new(&bounds));
        let span = planes.clip(ray, &bounds).expect("it meets the cube");
        let mut stack = SmallVec::new();
        Octants::new(&planes, Vec3::ZERO, present).push(0, span, &mut stack);
        stack.iter().rev().map(|pending| pending.node).collect()
    }

    #[test]
    fn octants_come_front_to_back() {
        let up = Ray::new([-2.0, -1.9, -1.8], [1.0, 1.0, 1.0]);
        assert_eq!(visited(&up, 0xff), [0, 4, 6, 7], "z, then y, then x");
        let down = Ray::new([2.0, 1.9, 1.8], [-1.0, -1.0, -1.0]);
        assert_eq!(visited(&down, 0xff), [7, 3, 1, 0], "the other way");
        let mixed = Ray::new([-2.0, 0.5, 1.7], [1.0, 0.0, -1.0]);
        assert_eq!(visited(&mixed, 0xff), [6, 2, 3], "y stays");
    }

    #[test]
    fn children_are_numbered_without_the_absent_ones() {
        let up = Ray::new([-2.0, -1.9, -1.8], [1.0, 1.0, 1.0]);
        assert_eq!(visited(&up, 0b1101_0010), [1, 2, 3], "octants 4, 6 and 7");
    }

    #[test]
    fn rays_in_a_plane_meet_both_sides() {
        let along = Ray::new([-2.0, 0.5, 0.0], [1.0, 0.0, 0.0]);
        assert_eq!(visited(&along, 0xff), [2, 3, 6, 7], "both halves of z");
    }
}
