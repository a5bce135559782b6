//! Rays through cells that are divided when a ray first enters them (W. Hunt, W. R. Mark, D. Fussell, *Fast and lazy
//! build of acceleration structures from scene hierarchies*, 2007).
//!
//! An implementation of [`LazyCells`] divides the cells; this module traverses them. Below some size a cell is a whole
//! [`PackedTree`]. Answers are those of [`brute_force`](crate::brute_force), however many cells have been divided before.

use kd_core::{Aabb, Axis, Hit, Ray};
use kd_simd::{max, min};

use crate::PackedTree;
use crate::binary::walk::PreparedRay;
use crate::collect::{Any, Closest, Collect, Ordered};
use crate::planes::Span;

/// A tree of cells, each divided when it is first entered.
pub trait LazyCells {
    /// A cell, divided or not.
    type Cell;

    /// The box around all triangles; empty if there are none.
    fn bounds(&self) -> Aabb;

    /// The root cell.
    fn root(&self) -> &Self::Cell;

    /// Returns the content of a cell, after dividing it if no ray has entered it before. The content never changes.
    ///
    /// Every ray that passes through a cell enters it. A subtree is at most [`MAX_DEPTH`](kd_core::MAX_DEPTH) cells below the
    /// root. The subtrees of all cells that a triangle is in refer to it, within the tolerance of
    /// [`Tree::check_coverage`](kd_core::Tree::check_coverage).
    fn enter<'a>(&'a self, cell: &'a Self::Cell) -> Entered<'a, Self::Cell>;
}

/// The content of a cell.
#[derive(Debug)]
pub enum Entered<'a, C> {
    /// A plane and two cells.
    Interior {
        /// The axis perpendicular to the plane.
        axis: Axis,
        /// The position of the plane on that axis, in scene units.
        split: f32,
        /// The lower and the upper cell.
        children: &'a [C; 2],
    },
    /// A finished tree over the triangles of the cell.
    Subtree(&'a PackedTree),
}

/// As [`intersect`](crate::intersect).
pub fn intersect(cells: &impl LazyCells, ray: &Ray) -> Option<Hit> {
    let mut closest = Closest::default();
    walk(cells, ray, &mut closest);
    closest.0
}

/// As [`occluded`](crate::occluded). Enters no cell after the first hit.
pub fn occluded(cells: &impl LazyCells, ray: &Ray) -> bool {
    let mut any = Any::default();
    walk(cells, ray, &mut any);
    any.0
}

/// As [`hits`](crate::hits).
pub fn hits(cells: &impl LazyCells, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
    Ordered::fill(out, max, |ordered| walk(cells, ray, ordered));
}

fn walk(cells: &impl LazyCells, ray: &Ray, collector: &mut impl Collect) {
    // One error bound for all cells, that of the whole box: triangles extend beyond their cells.
    if let Some((ray, span)) = PreparedRay::new(ray, &cells.bounds()) {
        descend(cells, cells.root(), &ray, span, collector);
    }
}

/// The loop of [`walk`](crate::binary::walk::walk), with the call stack in place of its own stack: few cells are above a
/// subtree.
fn descend<'a, L: LazyCells>(
    cells: &'a L,
    mut cell: &'a L::Cell,
    ray: &PreparedRay,
    mut span: Span,
    collector: &mut impl Collect,
) {
    loop {
        let (axis, split, [lower, upper]) = match cells.enter(cell) {
            Entered::Interior {
                axis,
                split,
                children,
            } => (axis, split, children),
            Entered::Subtree(tree) => {
                return tree.walk((ray, span), collector, &mut ());
            }
        };
        let crossing = ray.planes.crossing(axis.index(), split);
        let (near, far) = if crossing.near == 0 {
            (lower, upper)
        } else {
            (upper, lower)
        };
        // Both conditions are false for NaN, and they cannot both be true.
        cell = if span.exit < crossing.first {
            near
        } else if span.enter > crossing.last {
            far
        } else {
            let before = Span {
                exit: min(crossing.last, span.exit),
                ..span
            };
            descend(cells, near, ray, before, collector);
            let limit = ray.planes.steps(collector.limit());
            span = Span {
                enter: max(crossing.first, span.enter),
                exit: min(limit, span.exit),
            };
            // A lower triangle may be hit at the limit itself.
            if collector.is_done() || span.enter > limit {
                return;
            }
            far
        };
    }
}
