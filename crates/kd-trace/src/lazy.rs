//! Rays through cells that are divided when a ray first enters them (W. Hunt, W. R. Mark, D. Fussell, *Fast and lazy
//! build of acceleration structures from scene hierarchies*, 2007).
//!
//! Who divides the cells, and how, is up to whoever implements [`LazyCells`]; here is how rays find their way. Below
//! some size a cell is a whole [`PackedTree`], and walked like any other. Answers are those of
//! [`brute_force`](crate::brute_force), whatever has been divided before.

use kd_core::{Aabb, Axis, Hit, Ray};
use kd_simd::{max, min};

use crate::PackedTree;
use crate::collect::{Any, Closest, Collect, Ordered};
use crate::planes::Span;
use crate::walk::PreparedRay;

/// A tree of cells, of which those are divided that somebody has entered.
pub trait LazyCells {
    /// A cell, divided or not.
    type Cell;

    /// The box around all triangles; empty if there are none.
    fn bounds(&self) -> Aabb;

    /// The cell of everything.
    fn root(&self) -> &Self::Cell;

    /// Divides a cell, if that has not been done yet, and tells what is in it: always the same.
    ///
    /// A cell is entered anew for every ray that passes through it. Between the root and a subtree lie at most
    /// [`MAX_DEPTH`](kd_core::MAX_DEPTH) cells, and every part of every triangle is in a subtree in whose cell it lies,
    /// within what [`Tree::check_coverage`](kd_core::Tree::check_coverage) tolerates.
    fn enter<'a>(&'a self, cell: &'a Self::Cell) -> Entered<'a, Self::Cell>;
}

/// What is in a cell.
#[derive(Debug)]
pub enum Entered<'a, C> {
    /// A plane and two cells.
    Interior {
        /// Which axis the plane is perpendicular to.
        axis: Axis,
        /// Where the plane lies on that axis, in scene units.
        split: f32,
        /// The lower and the upper cell.
        children: &'a [C; 2],
    },
    /// A finished tree over all that is in the cell.
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
    out.clear();
    if max > 0 {
        walk(cells, ray, &mut Ordered { max, out });
    }
}

fn walk(cells: &impl LazyCells, ray: &Ray, collector: &mut impl Collect) {
    // One bound of errors for all cells, that of the whole box: triangles reach out of the cells they are in.
    if let Some((ray, span)) = PreparedRay::new(ray, &cells.bounds()) {
        descend(cells, cells.root(), &ray, span, collector);
    }
}

/// What the loop of [`walk`](crate::walk::walk) does, with the call stack in place of its own: there are few cells above
/// a subtree.
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
            // At the limit itself a lower triangle may lie.
            if collector.is_done() || span.enter > limit {
                return;
            }
            far
        };
    }
}
