//! An octree: boxes divided in the middle of each axis (Eleftheriades 2010 §2.3.2).

mod build;

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::Vec3;
use kd_core::{Aabb, Hit, Mesh, Ray};
use kd_trace::delegate_ray_query;
use kd_trace::kit::{Collect, Frame, RayPlanes, Span, TriangleTest, max, min};
use smallvec::SmallVec;

use crate::query::{Walk, Walked};
use crate::{CellOptions, CellStats, ComparatorError};

/// An octree over a mesh, with the queries of [`RayQuery`](kd_trace::RayQuery).
///
/// The root is the scene's box. A cell of more triangles than [`with_small_leaf`](CellOptions::with_small_leaf) is divided in
/// the middle of each axis into eight octants, and each triangle goes to every octant that it overlaps. Empty octants are not
/// stored. (Eleftheriades, *kd-tree merging*, 2010, §2.3.2.)
///
/// The paper's traversal finds the next cell by the side at which the ray leaves the last one. This traversal descends from the
/// root and visits the octants of each cell in ray order: exit sides are uncertain where planes are crossed in an interval, and
/// empty octants need no neighbors.
///
/// Expected time of a ray is that of the cells along it. A query allocates nothing up to the default depth.
#[derive(Clone, Debug)]
pub struct Octree {
    mesh: Arc<Mesh>,
    bounds: Aabb,
    /// The root is the first node; empty without triangles.
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
        /// Position of the dividing plane on each axis.
        middle: Vec3,
        /// Index of the first child. Children are stored in ascending order of octants.
        first: u32,
        /// The octants that have a child, as bits. Octant `o` is above the middle of axis `k` if bit `k` of `o` is set.
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

/// The default limit of depth.
const DEPTH: u32 = 16;

/// Stack of a walk at that depth: all children of each node on a path but the one on the path. The stack grows if the depth
/// limit is larger.
const STACK: usize = 128;
const _: () = assert!(STACK > 7 * DEPTH as usize, "a walk allocates nothing");

impl Octree {
    /// Builds the octree of a mesh.
    ///
    /// Takes O(N · depth) time for triangles that are small beside their cells.
    /// [`CellOptions::with_max_refs`] bounds the time of others: leaves are no more than references, and divided cells no more than
    /// the depth times the leaves. A cell is not divided if each non-empty child would hold all of its triangles, as with
    /// coincident triangles.
    ///
    /// # Errors
    ///
    /// [`ComparatorError`] if an option is out of range or nodes exceed 32-bit indices.
    pub fn build(
        mesh: impl Into<Arc<Mesh>>,
        options: &CellOptions,
    ) -> Result<Self, ComparatorError> {
        options.check()?;
        build::octree(mesh.into(), options)
    }

    /// The mesh that the octree is over.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// Counts and bytes. Linear in the number of nodes.
    pub fn stats(&self) -> CellStats {
        let is_leaf = |node: &&Node| matches!(node, Node::Leaf { .. });
        CellStats {
            nodes: self.nodes.len(),
            leaves: self.nodes.iter().filter(is_leaf).count(),
            references: self.refs.len(),
            depth: self.depth as usize,
            large_leaves: self.large_leaves,
            bytes: size_of_val(&self.nodes[..]) + size_of_val(&self.refs[..]),
        }
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for Octree: single;
    octree => Walked(octree),
}

impl Walk for Octree {
    fn walk<C: Collect>(&self, ray: &Ray, collector: &mut C) {
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
            // A lower triangle at the limit itself still counts.
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
                    let asked = triangles.try_for_each(|&t| test.ask(&self.mesh, t, collector));
                    if asked == ControlFlow::Break(()) {
                        return;
                    }
                }
            }
        }
    }
}

/// The octants of one cell, in ray order.
struct Octants {
    /// Start of the far half along each axis.
    first: [f32; 3],
    /// End of the near half along each axis.
    last: [f32; 3],
    /// The octant of the near half on each axis.
    nearest: u8,
    /// The octants that have a child.
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

    /// Pushes the octants that the ray may meet, so that they are popped front to back.
    ///
    /// Bit `k` of an octant's rank in this order is set if the octant is far on axis `k`. A ray changes from near to far on one
    /// axis after the other, so that ranks only grow along the ray.
    #[inline]
    fn push(&self, children: u32, span: Span, stack: &mut SmallVec<[Pending; STACK]>) {
        for rank in (0..8_u8).rev() {
            let octant = rank ^ self.nearest;
            if self.present & (1 << octant) == 0 {
                continue;
            }
            let Span {
                mut enter,
                mut exit,
            } = span;
            for axis in 0..3 {
                if rank & (1 << axis) == 0 {
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

    /// The octants of the cube [-1, 1]³ that a ray meets, in the order of visits.
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
