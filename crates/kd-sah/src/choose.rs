//! The interface between the driver and the methods that choose planes. Each method has one file.

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

/// A method that chooses planes. The driver does everything else: it stops the recursion, divides cells, writes nodes and
/// starts tasks.
pub(crate) trait ChoosePlane: Sync {
    /// Whether planes have a cost, by which the driver may stop.
    const BY_COST: bool = true;

    /// Data that the chooser keeps for a cell, in addition to the cell itself.
    type Kept: Send;

    /// Whether [`divide`](Self::divide) needs the primitives of the divided cell; the driver copies them only then.
    const NEEDS_PARENT: bool = false;

    /// The data to keep for the root.
    fn begin(&self, root: Cell<'_>) -> Self::Kept;

    /// The plane for a cell of at least one primitive; `None` if no plane divides it. `cost` is the cost of planes in this
    /// cell. If `parallel`, the method may use several threads. The plane must not depend on it.
    fn choose(
        &self,
        cell: Cell<'_>,
        kept: &Self::Kept,
        cost: &CellCost,
        parallel: bool,
    ) -> Option<Plane>;

    /// The data to keep for the lower and the upper child of a divided cell. `cell` has no primitives unless
    /// [`NEEDS_PARENT`](Self::NEEDS_PARENT) is set.
    fn divide(
        &self,
        kept: Self::Kept,
        cell: Cell<'_>,
        plane: &Plane,
        children: [Cell<'_>; 2],
        parallel: bool,
    ) -> [Self::Kept; 2];
}

/// A chooser that uses only the cell and keeps no data between cells.
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

/// A generic operation on a chooser of any type.
pub(crate) trait WithChooser {
    /// The result of the operation.
    type Outcome;

    /// Runs the operation.
    fn with(self, chooser: &impl ChoosePlane) -> Self::Outcome;
}

/// Runs `work` with the chooser that the options select.
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
