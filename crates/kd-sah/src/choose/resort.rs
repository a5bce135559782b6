//! SAH by a sweep over events that are sorted in every cell: O(N log² N) (slides; Wald and Havran 2006 §4.2).

use super::Memoryless;
use crate::cell::Cell;
use crate::events::{events_of, sweep};
use crate::plane::{BestPlane, CellCost, Plane};

/// It keeps no data between cells, and is the oracle for the splicing in [`Sweep`](super::Sweep).
#[derive(Debug)]
pub(crate) struct Resort;

impl Memoryless for Resort {
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, _: bool) -> Option<Plane> {
        let mut best = BestPlane::new(cost);
        for &axis in cost.considered {
            let mut events = events_of(cell.prims, axis);
            events.sort_unstable();
            sweep(&events, axis, (0, cell.prims.len()), 1, &mut best);
        }
        best.found()
    }
}
