//! The spatial median: the middle of the cell, with alternating axes (slides, "Naive algorithm").

use kd_core::Axis;

use super::Memoryless;
use crate::cell::Cell;
use crate::plane::{CellCost, Plane, Side};

/// The axis is the depth modulo 3, the position is the middle of the cell. Unlike the slides, an axis on which the cell is
/// flat is skipped, since no plane there divides the cell.
#[derive(Debug)]
pub(crate) struct Median;

impl Memoryless for Median {
    const BY_COST: bool = false;

    fn plane(&self, cell: Cell<'_>, _: &CellCost, _: bool) -> Option<Plane> {
        let center = cell.place.bounds.center();
        let in_turn = (0..3).map(|step| Axis::ALL[(cell.place.depth as usize + step) % 3]);
        in_turn
            .map(|axis| (axis, center[axis.index()]))
            .find(|&(axis, middle)| {
                let axis = axis.index();
                cell.place.bounds.min[axis] < middle && middle < cell.place.bounds.max[axis]
            })
            .map(|(axis, position)| Plane {
                axis,
                position,
                planar_side: Side::Lower,
                cost: 0.0,
            })
    }
}
