//! The seam between the driver and the ways to choose a plane: one file each.

mod binned;
mod exact;
mod hybrid;
mod median;
mod naive;
mod resort;
mod sampled;
mod sweep;

pub(crate) use median::Median;
pub(crate) use naive::Naive;

use binned::Binned;
use exact::Exact;
use hybrid::Hybrid;
use resort::Resort;
use sampled::Sampled;
use sweep::Sweep;

use crate::cell::Cell;
use crate::options::{BuildOptions, Method};
use crate::plane::{CellCost, Plane};

/// A way to choose planes. The driver does everything else: when to stop, dividing cells, making nodes, tasks.
pub(crate) trait ChoosePlane: Sync {
    /// Whether the planes carry a cost that the driver may stop by.
    const BY_COST: bool = true;

    /// What the chooser keeps for a cell, beside the cell itself.
    type Kept: Send;

    /// Whether [`divide`](Self::divide) looks at the primitives of the divided cell; they are not kept otherwise.
    const LOOKS_BACK: bool = false;

    /// What to keep for the root.
    fn begin(&self, root: Cell<'_>) -> Self::Kept;

    /// The plane for a cell of at least one primitive; `None` if nothing divides it. `cost` is that of planes in this
    /// cell. Several threads may be used if `parallel`; the plane must not depend on it.
    fn choose(
        &self,
        cell: Cell<'_>,
        kept: &Self::Kept,
        cost: &CellCost,
        parallel: bool,
    ) -> Option<Plane>;

    /// What to keep for the lower and the upper part of a divided cell, which has no primitives here unless
    /// [`LOOKS_BACK`](Self::LOOKS_BACK) asks for them.
    fn divide(
        &self,
        kept: Self::Kept,
        cell: Cell<'_>,
        plane: &Plane,
        parts: [Cell<'_>; 2],
        parallel: bool,
    ) -> [Self::Kept; 2];
}

/// Choosers that look at the cell alone, and keep nothing from cell to cell.
pub(crate) trait Memoryless: Sync {
    /// See [`ChoosePlane::BY_COST`].
    const BY_COST: bool = true;

    /// See [`ChoosePlane::choose`].
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, parallel: bool) -> Option<Plane>;
}

impl<C: Memoryless> ChoosePlane for C {
    const BY_COST: bool = C::BY_COST;

    type Kept = ();

    fn begin(&self, _: Cell<'_>) {}

    fn choose(&self, cell: Cell<'_>, (): &(), cost: &CellCost, parallel: bool) -> Option<Plane> {
        self.plane(cell, cost, parallel)
    }

    fn divide(&self, (): (), _: Cell<'_>, _: &Plane, _: [Cell<'_>; 2], _: bool) -> [(); 2] {
        [(), ()]
    }
}

/// What is to be done with a chooser, whichever it is.
pub(crate) trait WithChooser {
    /// What comes of it.
    type Outcome;

    /// Does it.
    fn with(self, chooser: &impl ChoosePlane) -> Self::Outcome;
}

/// Does `work` with the chooser that the options ask for.
pub(crate) fn with_chooser_of<W: WithChooser>(options: &BuildOptions, work: W) -> W::Outcome {
    let binned = |bins: u16| Binned {
        bins: bins.into(),
        adjust_below: options.plane_adjustment,
    };
    match options.method {
        Method::Median => work.with(&Median),
        Method::Naive => work.with(&Naive),
        Method::Resort => work.with(&Resort),
        Method::Sweep => work.with(&Sweep),
        Method::Exact => work.with(&Exact),
        Method::Binned { bins } => work.with(&binned(bins)),
        Method::Sampled { all_axes } => work.with(&Sampled { all_axes }),
        Method::Hybrid { bins, exact_below } => work.with(&Hybrid {
            above: binned(bins),
            exact_below,
        }),
    }
}
