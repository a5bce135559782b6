//! A BSP tree whose planes are those of triangles (Eleftheriades 2010 §2.3.3).

mod build;
mod fragments;
mod line;
mod plane;

use std::ops::ControlFlow;

use kd_core::{Aabb, Hit, MAX_DEPTH, Mesh, Ray};
use kd_trace::kit::{Collect, Frame, RayPlanes, Span, TriangleTest, max, min};
use smallvec::SmallVec;

use crate::query::{self, Walk};
use crate::{BuildError, Options, Stats};
use line::RayLine;
use plane::Plane;

/// A BSP tree over a mesh whose planes are those of its triangles: a comparator, to be measured beside the kd-tree.
///
/// In each cell one triangle's plane divides the others into those in front and those behind. Triangles in the plane are
/// listed at the node. (Eleftheriades, *kd-tree merging*, 2010, §2.3.3; H. Fuchs, Z. M. Kedem and B. F. Naylor, *On visible
/// surface generation by a priori tree structures*, SIGGRAPH 1980, who call it auto-partition.)
///
/// A triangle on both sides is cut in two fragments. Whole triangles on both sides would be cheaper to sort, but would be
/// sorted by parts of them that are elsewhere, again and again: lists would hold what never reaches into their cells.
/// Fragments exist only while the tree is built. What rays are tested against is the triangle.
///
/// Such trees suit walls and floors. The planes of a convex surface have all of it on one side, so that its tree is a list.
#[derive(Clone, Debug)]
pub struct PolygonBsp {
    bounds: Aabb,
    root: Place,
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
    /// How far from the wrong side of the plane a hit may lie, in scene units: sides were told up to a tolerance, and a hit
    /// lies beside its triangle by up to 2⁻²⁵ of that one's size.
    slack: f64,
    /// Triangles in the plane.
    on: List,
    /// The cell behind the plane, then that in front.
    children: [Place; 2],
}

/// A cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Divided(u32),
    /// An empty leaf is the list of nothing.
    Leaf(List),
}

/// Some of the references.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct List {
    first: u32,
    count: u32,
}

/// A cell or a list to visit later, with the part of the ray in it, here in units of `t`.
#[derive(Clone, Copy, Debug)]
struct Pending {
    place: Place,
    span: Span,
}

/// The depth that is not exceeded unless it is asked for.
const DEPTH: u32 = 64;

/// Room for a walk at that depth, the most there is: the list and the far child of each node on a path.
const STACK: usize = 256;
const _: () = assert!(STACK > 2 * MAX_DEPTH, "nothing is allocated");

impl PolygonBsp {
    /// Builds the BSP tree of a mesh.
    ///
    /// A cell's plane is that of the candidate that cuts the fewest triangles and leaves the sides most alike, of eight
    /// triangles evenly spaced in the cell's list. Takes O(N · depth) time and memory in proportion to references. Triangles
    /// that are nearly a line have no plane that can be trusted; a cell with no others is a leaf.
    ///
    /// # Errors
    ///
    /// [`BuildError`]: an option out of range.
    pub fn build(mesh: &Mesh, options: &Options) -> Result<Self, BuildError> {
        options.check()?;
        Ok(build::bsp(mesh, options))
    }

    /// The closest hit, the lower triangle among equals, or `None`: equal to
    /// [`kd_trace::brute_force::intersect`] bit for bit.
    ///
    /// Time is that of the cells along the ray and of the triangles in planes that it crosses. Nothing is allocated.
    ///
    /// # Panics
    ///
    /// If `mesh` is not the one that the tree was built from, and has fewer triangles.
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

    /// Counts and bytes, in constant time.
    pub fn stats(&self) -> Stats {
        Stats {
            nodes: self.nodes.len() + self.leaves,
            leaves: self.leaves,
            references: self.refs.len(),
            depth: self.depth as usize,
            large_leaves: self.large_leaves,
            bytes: size_of_val(&self.nodes[..]) + size_of_val(&self.refs[..]),
        }
    }
}

impl Walk for PolygonBsp {
    fn walk<C: Collect>(&self, mesh: &Mesh, ray: &Ray, collector: &mut C) {
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
            place: self.root,
            span,
        });
        while let Some(Pending { place, mut span }) = stack.pop() {
            let limit = collector.limit();
            // At the limit itself a lower triangle may lie.
            if span.enter > limit {
                continue;
            }
            match place {
                Place::Divided(node) => {
                    span.exit = min(limit, span.exit);
                    let node = &self.nodes[node as usize];
                    node.push(&line, span, &mut stack);
                }
                Place::Leaf(list) => {
                    let refs = &self.refs[list.first as usize..][..list.count as usize];
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

/// The part of the ray's range in which it may hit something in the box, in units of `t`.
///
/// `t = 1` is a power of two in steps, so that dividing by it is exact, or rounds to infinity or to zero as `t` would.
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
    /// Puts what the ray may meet on the stack, so that it comes off front to back: the near cell, the triangles in the
    /// plane, the far cell.
    #[inline]
    fn push(&self, line: &RayLine, span: Span, stack: &mut SmallVec<[Pending; STACK]>) {
        let crossing = line.crossing(&self.plane, self.slack);
        let near = crossing.near as usize;
        let enter = max(crossing.first, span.enter);
        let exit = min(crossing.last, span.exit);
        let mut push = |place, enter, exit| {
            if enter <= exit && place != Place::Leaf(List::default()) {
                let span = Span { enter, exit };
                stack.push(Pending { place, span });
            }
        };
        push(self.children[near ^ 1], enter, span.exit);
        push(Place::Leaf(self.on), enter, exit);
        push(self.children[near], span.enter, exit);
    }
}
