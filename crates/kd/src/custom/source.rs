//! Primitives as builders of kd-trees see them.

use kd_core::{Aabb, PrimSource};
use kd_trace::Primitives;

/// The primitives that have a box, numbered without the others.
pub(super) struct WithBoxes<'a, P> {
    pub(super) primitives: &'a P,
    /// Of all primitives, those without one included.
    pub(super) boxes: &'a [Aabb],
    /// Those that have a box.
    pub(super) numbers: &'a [u32],
}

impl<P> WithBoxes<'_, P> {
    fn bounds_of(&self, primitive: u32) -> Aabb {
        self.boxes[primitive as usize]
    }
}

impl<P: Primitives> PrimSource for WithBoxes<'_, P> {
    /// The number of a primitive among all.
    type Shape = u32;

    #[allow(
        clippy::cast_possible_truncation,
        reason = "no more than there are primitives"
    )]
    fn count(&self) -> u32 {
        self.numbers.len() as u32
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        self.bounds_of(self.shape(primitive))
    }

    fn shape(&self, primitive: u32) -> u32 {
        self.numbers[primitive as usize]
    }

    /// A box of the primitive that is not in the cell, or not finite, is replaced by the part of its whole box in the cell.
    fn clipped_bounds(&self, primitive: &u32, cell: &Aabb) -> Option<Aabb> {
        let whole = self.bounds_of(*primitive).intersection(cell);
        let clipped = self.primitives.clipped_bounds(*primitive, cell)?;
        let is_inside = clipped.min.cmpge(whole.min).all() && clipped.max.cmple(whole.max).all();
        let clipped = if is_inside { clipped } else { whole };
        (!clipped.is_empty()).then_some(clipped)
    }
}
