//! SAH by counting over everything for every candidate: O(N²) (slides; Wald and Havran 2006 §4.1).

use kd_core::{Axis, CostModel};

use super::ChoosePlane;
use crate::cell::{Cell, Division};
use crate::plane::{BestPlane, Counts, Plane};

/// The slowest builder, and the plainest: what the others must agree with. It shares with them what a candidate costs
/// and how ties end ([`BestPlane`]), and nothing of how primitives are counted.
#[derive(Debug)]
pub(crate) struct Naive<'a> {
    pub(crate) model: &'a CostModel,
}

impl ChoosePlane for Naive<'_> {
    type Kept = ();

    fn begin(&self, _: &Cell) {}

    fn choose(&self, cell: &Cell, (): &()) -> Option<Plane> {
        let mut best = BestPlane::new(self.model, &cell.bounds);
        for axis in Axis::ALL {
            for prim in &cell.prims {
                for position in [prim.bounds.min[axis.index()], prim.bounds.max[axis.index()]] {
                    // -0.0 and 0.0 are one plane; whichever a primitive has, name it 0.0.
                    let position = position + 0.0;
                    best.offer(axis, position, count(cell, axis, position));
                }
            }
        }
        best.found()
    }

    fn divide(&self, (): (), _: &Division) -> [(); 2] {
        [(), ()]
    }
}

fn count(cell: &Cell, axis: Axis, position: f32) -> Counts {
    let mut counts = Counts {
        lower: 0,
        planar: 0,
        upper: 0,
    };
    for prim in &cell.prims {
        let (start, end) = (prim.bounds.min[axis.index()], prim.bounds.max[axis.index()]);
        counts.lower += usize::from(start < position);
        counts.planar += usize::from(start == position && end == position);
        counts.upper += usize::from(end > position);
    }
    counts
}
