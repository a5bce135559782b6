//! The seam between the driver and the ways to choose a plane: one file each.

mod exact;
mod median;
mod naive;
mod resort;

pub(crate) use exact::Exact;
pub(crate) use median::Median;
pub(crate) use naive::Naive;
pub(crate) use resort::Resort;

use crate::cell::{Cell, Division};
use crate::plane::Plane;

/// A way to choose planes. The driver does everything else: when to stop, dividing cells, making nodes, tasks.
pub(crate) trait ChoosePlane: Sync {
    /// Whether the planes carry a cost that the driver may stop by.
    const BY_COST: bool = true;

    /// What the chooser keeps for a cell, beside the cell itself.
    type Kept: Send;

    /// What to keep for the root.
    fn begin(&self, root: &Cell) -> Self::Kept;

    /// The plane for a cell of at least one primitive; `None` if nothing divides it.
    fn choose(&self, cell: &Cell, kept: &Self::Kept) -> Option<Plane>;

    /// What to keep for the lower and the upper part of a divided cell.
    fn divide(&self, kept: Self::Kept, division: &Division) -> [Self::Kept; 2];
}
