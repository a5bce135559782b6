//! SAH by a sweep over events sorted anew in every cell: O(N log² N) (slides; Wald and Havran 2006 §4.2).

use kd_core::{Axis, CostModel};

use super::ChoosePlane;
use crate::cell::{Cell, Division};
use crate::events::{events_of, sweep};
use crate::plane::{BestPlane, Plane};

/// Keeps nothing from cell to cell: the oracle of the splicing in [`Exact`](super::Exact).
#[derive(Debug)]
pub(crate) struct Resort<'a> {
    pub(crate) model: &'a CostModel,
}

impl ChoosePlane for Resort<'_> {
    type Kept = ();

    fn begin(&self, _: &Cell) {}

    fn choose(&self, cell: &Cell, (): &()) -> Option<Plane> {
        let mut best = BestPlane::new(self.model, &cell.bounds);
        for axis in Axis::ALL {
            let mut events = events_of(&cell.prims, axis);
            events.sort_unstable();
            sweep(&events, axis, cell.prims.len(), &mut best);
        }
        best.found()
    }

    fn divide(&self, (): (), _: &Division) -> [(); 2] {
        [(), ()]
    }
}
