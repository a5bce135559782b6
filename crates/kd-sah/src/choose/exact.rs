//! SAH by a sweep over events sorted once: O(N log N) (Wald and Havran 2006 §4.3).

use kd_core::{Axis, CostModel};

use super::ChoosePlane;
use crate::cell::{Cell, Division, Moved, Prim};
use crate::events::{Event, events_of, push_events, sweep};
use crate::plane::{BestPlane, Plane};

/// Sorts the root's events, and from then on splices: events of primitives on one side stay in order, only those of
/// primitives that the plane cut are made anew, sorted and merged in.
#[derive(Debug)]
pub(crate) struct Exact<'a> {
    pub(crate) model: &'a CostModel,
}

impl ChoosePlane for Exact<'_> {
    /// Sorted events of the cell, per axis.
    type Kept = [Vec<Event>; 3];

    fn begin(&self, root: &Cell) -> Self::Kept {
        Axis::ALL.map(|axis| {
            let mut events = events_of(&root.prims, axis);
            events.sort_unstable();
            events
        })
    }

    fn choose(&self, cell: &Cell, kept: &Self::Kept) -> Option<Plane> {
        let mut best = BestPlane::new(self.model, &cell.bounds);
        for axis in Axis::ALL {
            sweep(&kept[axis.index()], axis, cell.prims.len(), &mut best);
        }
        best.found()
    }

    fn divide(&self, kept: Self::Kept, division: &Division) -> [Self::Kept; 2] {
        let mut lower = [const { Vec::new() }; 3];
        let mut upper = [const { Vec::new() }; 3];
        for (axis, events) in Axis::ALL.into_iter().zip(kept) {
            let (kept_lower, kept_upper) = split(&events, division);
            drop(events);
            let made = |prims: &[Prim], cut: &[u32]| made_anew(prims, cut, axis);
            let new_lower = made(&division.lower.prims, &division.cut_lower);
            let new_upper = made(&division.upper.prims, &division.cut_upper);
            lower[axis.index()] = merge(kept_lower, &new_lower);
            upper[axis.index()] = merge(kept_upper, &new_upper);
        }
        [lower, upper]
    }
}

/// The events of primitives that went to one side, renumbered. Numbers keep their order, so events do.
fn split(events: &[Event], division: &Division) -> (Vec<Event>, Vec<Event>) {
    let mut lower = Vec::with_capacity(2 * division.lower.prims.len());
    let mut upper = Vec::with_capacity(2 * division.upper.prims.len());
    for event in events {
        match division.moved[event.prim() as usize] {
            Moved::Lower(prim) => lower.push(event.renumbered(prim)),
            Moved::Upper(prim) => upper.push(event.renumbered(prim)),
            Moved::Cut => {}
        }
    }
    (lower, upper)
}

/// The events of primitives that were cut, sorted. Only about √N of N are (Wald and Havran 2006 §4.3).
fn made_anew(prims: &[Prim], cut: &[u32], axis: Axis) -> Vec<Event> {
    let mut events = Vec::with_capacity(2 * cut.len());
    for &prim in cut {
        push_events(&mut events, axis, prim, &prims[prim as usize]);
    }
    events.sort_unstable();
    events
}

/// Merges two sorted lists, from the back, within the first one's memory.
fn merge(mut kept: Vec<Event>, new: &[Event]) -> Vec<Event> {
    let mut from_kept = kept.len();
    let mut from_new = new.len();
    kept.extend_from_slice(new);
    while from_new > 0 {
        let to = from_kept + from_new - 1;
        if from_kept > 0 && kept[from_kept - 1] > new[from_new - 1] {
            from_kept -= 1;
            kept[to] = kept[from_kept];
        } else {
            from_new -= 1;
            kept[to] = new[from_new];
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn merging_is_sorting(a: Vec<(i8, bool)>, b: Vec<(i8, bool)>) {
            let events = |list: &[(i8, bool)]| {
                let mut events = Vec::new();
                for (prim, (at, flat)) in (0_u32..).zip(list) {
                    let start = Vec3::splat(f32::from(*at));
                    let end = if *flat { start } else { start + 1.0 };
                    push_events(&mut events, Axis::X, prim, &Prim { slot: 0, bounds: Aabb { min: start, max: end } });
                }
                events.sort_unstable();
                events
            };
            let (kept, new) = (events(&a), events(&b));
            let mut all = [kept.clone(), new.clone()].concat();
            all.sort_unstable();
            prop_assert_eq!(merge(kept, &new), all);
        }
    }
}
