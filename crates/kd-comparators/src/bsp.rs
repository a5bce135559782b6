//! A BSP tree whose planes are those of triangles (Eleftheriades 2010 §2.3.3).

mod build;
mod fragments;
mod line;
mod plane;

use std::ops::ControlFlow;
use std::sync::Arc;

use kd_core::{Aabb, Hit, MAX_DEPTH, Mesh, Ray};
use kd_trace::delegate_ray_query;
use kd_trace::kit::{Collect, Frame, RayPlanes, Span, TriangleTest, max, min};
use smallvec::SmallVec;

use crate::query::{Walk, Walked};
use crate::{CellOptions, CellStats, ComparatorError};
use line::RayLine;
use plane::Plane;

/// A BSP tree over a mesh whose planes are those of its triangles, with the queries of [`RayQuery`](kd_trace::RayQuery).
///
/// In each cell the plane of one triangle divides the others into those in front and those behind. Triangles in the plane are
/// listed at the node. (Eleftheriades, *kd-tree merging*, 2010, §2.3.3; H. Fuchs, Z. M. Kedem and B. F. Naylor, *On visible
/// surface generation by a priori tree structures*, SIGGRAPH 1980, who call it auto-partition.)
///
/// A triangle on both sides is cut in two fragments. Whole triangles on both sides would be cheaper to sort, but later planes
/// would sort them by regions outside the cell, so that lists would hold triangles that do not overlap their cells. Fragments
/// exist only during the build. Rays are tested against the triangles.
///
/// Such trees suit walls and floors. Every plane of a convex surface has all of the surface on one side, so that its tree is a
/// list.
///
/// Time of a ray is that of the cells along it and of the triangles in planes that it crosses. A query allocates nothing.
#[derive(Clone, Debug)]
pub struct PolygonBsp {
    mesh: Arc<Mesh>,
    bounds: Aabb,
    root: Subtree,
    nodes: Vec<Node>,
    refs: Vec<u32>,
    leaves: usize,
    /// Divisions above the deepest leaf or list at a plane.
    depth: u32,
    large_leaves: usize,
}

/// A divided cell.
#[derive(Clone, Copy, Debug)]
struct Node {
    plane: Plane,
    /// The largest distance of a hit on the wrong side of the plane, in scene units: sides are known up to a tolerance, and a hit
    /// is off its triangle by up to 2⁻²⁵ of the triangle's size.
    slack: f64,
    /// Triangles in the plane.
    on: List,
    /// The cell behind the plane, then that in front.
    children: [Subtree; 2],
}

/// A cell and everything below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Subtree {
    Divided(u32),
    /// An empty leaf has an empty list.
    Leaf(List),
}

/// A range of the references.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct List {
    first: u32,
    count: u32,
}

/// A subtree or a list to visit later, with the range of the ray in it, in units of `t`.
#[derive(Clone, Copy, Debug)]
struct Pending {
    subtree: Subtree,
    span: Span,
}

/// The default limit of depth.
const DEPTH: u32 = 64;

/// Stack of a walk at that depth, which is also the largest: the list and the far child of each node on a path.
const STACK: usize = 256;
const _: () = assert!(STACK > 2 * MAX_DEPTH, "a walk allocates nothing");

impl PolygonBsp {
    /// Builds the BSP tree of a mesh.
    ///
    /// The candidates for the plane of a cell are eight triangles, evenly spaced in the cell's list. The candidate that cuts the
    /// fewest triangles and leaves the most even sides wins. Takes O(N · depth) time, and memory in proportion to references.
    /// Triangles that are nearly a line have no reliable plane; a cell that holds no others is a leaf.
    ///
    /// # Errors
    ///
    /// [`ComparatorError`] if an option is out of range.
    pub fn build(
        mesh: impl Into<Arc<Mesh>>,
        options: &CellOptions,
    ) -> Result<Self, ComparatorError> {
        options.check()?;
        Ok(build::bsp(mesh.into(), options))
    }

    /// The mesh that the tree is over.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// Counts and bytes, in constant time.
    pub fn stats(&self) -> CellStats {
        CellStats {
            nodes: self.nodes.len() + self.leaves,
            leaves: self.leaves,
            references: self.refs.len(),
            depth: self.depth as usize,
            large_leaves: self.large_leaves,
            bytes: size_of_val(&self.nodes[..]) + size_of_val(&self.refs[..]),
        }
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for PolygonBsp: single;
    bsp => Walked(bsp),
}

impl Walk for PolygonBsp {
    fn walk<C: Collect>(&self, ray: &Ray, collector: &mut C) {
        if self.bounds.is_empty() || !ray.can_hit() {
            return;
        }
        let faces = RayPlanes::new(ray, &Frame::new(&self.bounds));
        let Some(span) = span_in_box(ray, &faces, &self.bounds) else {
            return;
        };
        let test = TriangleTest::new(ray, faces.reach());
        let line = RayLine::new(ray, &self.bounds);
        let mut stack = SmallVec::<[Pending; STACK]>::new();
        stack.push(Pending {
            subtree: self.root,
            span,
        });
        while let Some(Pending { subtree, mut span }) = stack.pop() {
            let limit = collector.limit();
            // A lower triangle at the limit itself still counts.
            if span.enter > limit {
                continue;
            }
            match subtree {
                Subtree::Divided(node) => {
                    span.exit = min(limit, span.exit);
                    let node = &self.nodes[node as usize];
                    node.push(&line, span, &mut stack);
                }
                Subtree::Leaf(list) => {
                    let refs = &self.refs[list.first as usize..][..list.count as usize];
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

/// The range in which the ray may hit something in the box, in units of `t`.
///
/// `t = 1` is a power of two in steps, so that the division is exact, or rounds to infinity or to zero as `t` would.
fn span_in_box(ray: &Ray, faces: &RayPlanes, bounds: &Aabb) -> Option<Span> {
    let whole = ray.with_range(f32::NEG_INFINITY, f32::INFINITY);
    let span = faces.clip(&whole, bounds)?;
    let per_t = faces.steps(1.0);
    let (enter, exit) = (
        max(span.enter / per_t, ray.t_min),
        min(span.exit / per_t, ray.t_max),
    );
    (enter <= exit).then_some(Span { enter, exit })
}

impl Node {
    /// Pushes what the ray may meet, so that it is popped front to back: the near cell, the triangles in the plane, the far
    /// cell.
    #[inline]
    fn push(&self, line: &RayLine, span: Span, stack: &mut SmallVec<[Pending; STACK]>) {
        let crossing = line.crossing(&self.plane, self.slack);
        let near = crossing.near as usize;
        let enter = max(crossing.first, span.enter);
        let exit = min(crossing.last, span.exit);
        let mut push = |subtree, enter, exit| {
            if enter <= exit && subtree != Subtree::Leaf(List::default()) {
                let span = Span { enter, exit };
                stack.push(Pending { subtree, span });
            }
        };
        push(self.children[near ^ 1], enter, span.exit);
        push(Subtree::Leaf(self.on), enter, exit);
        push(self.children[near], span.enter, exit);
    }
}
