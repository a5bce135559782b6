//! SAH by counting all primitives for every candidate: O(N²) (slides; Wald and Havran 2006 §4.1).

use kd_core::Axis;

use super::Memoryless;
use crate::cell::Cell;
use crate::plane::{BestPlane, CellCost, Counts, Plane};

/// The slowest and simplest builder, with which the others must agree. It shares with them the cost of a candidate and the
/// order of ties ([`BestPlane`]), but not the counting of primitives.
#[derive(Debug)]
pub(crate) struct Naive;

impl Memoryless for Naive {
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, _: bool) -> Option<Plane> {
        let mut best = BestPlane::new(cost);
        for &axis in cost.considered {
            for prim in cell.prims {
                for position in [prim.start(axis), prim.end(axis)] {
                    // -0.0 and 0.0 are the same plane: make both 0.0.
                    let position = position + 0.0;
                    best.offer(axis, position, count(cell, axis, position));
                }
            }
        }
        best.found()
    }
}

fn count(cell: Cell<'_>, axis: Axis, position: f32) -> Counts {
    let mut counts = Counts {
        lower: 0,
        planar: 0,
        upper: 0,
    };
    for prim in cell.prims {
        let (start, end) = (prim.start(axis), prim.end(axis));
        counts.lower += usize::from(start < position);
        counts.planar += usize::from(start == position && end == position);
        counts.upper += usize::from(end > position);
    }
    counts
}
