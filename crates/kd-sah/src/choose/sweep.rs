//! SAH by a sweep over events that are sorted once: O(N log N) (Wald and Havran 2006 §4.3).

use kd_core::Axis;

use super::ChoosePlane;
use crate::cell::{Cell, Lies};
use crate::events::{Event, events_of, push_events, sweep_in_chunks};
use crate::plane::{BestPlane, CellCost, Plane};
use crate::prim::Prim;

/// Sorts the events of the root, and splices them in each division: events of primitives on one side keep their order. Only
/// events of primitives that the plane cuts are computed again, sorted and merged in.
#[derive(Debug)]
pub(crate) struct Sweep;

impl ChoosePlane for Sweep {
    /// Sorted events of the cell, per axis.
    type Kept = [Vec<Event>; 3];

    const NEEDS_PARENT: bool = true;

    fn begin(&self, root: Cell<'_>) -> Self::Kept {
        Axis::ALL.map(|axis| {
            let mut events = events_of(root.prims, axis);
            events.sort_unstable();
            events
        })
    }

    fn choose(
        &self,
        cell: Cell<'_>,
        kept: &Self::Kept,
        cost: &CellCost,
        parallel: bool,
    ) -> Option<Plane> {
        let mut best = BestPlane::new(cost);
        for &axis in cost.considered {
            let events = &kept[axis.index()];
            sweep_in_chunks(events, axis, cell.prims.len(), &mut best, parallel);
        }
        best.found()
    }

    fn divide(
        &self,
        kept: Self::Kept,
        cell: Cell<'_>,
        plane: &Plane,
        children: [Cell<'_>; 2],
        parallel: bool,
    ) -> [Self::Kept; 2] {
        let destinations = Destinations::of(cell, plane, children);
        let axes = Axis::ALL.into_iter().zip(kept).collect();
        let mut lower = [const { Vec::new() }; 3];
        let mut upper = [const { Vec::new() }; 3];
        let divided = kd_tasks::map(axes, parallel, |(axis, events)| {
            (axis, destinations.divide(axis, events, children))
        });
        for (axis, [below, above]) in divided {
            lower[axis.index()] = below;
            upper[axis.index()] = above;
        }
        [lower, upper]
    }
}

/// The child that received a primitive of a divided cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Destination {
    /// The lower child, unchanged, with this number there.
    Lower(u32),
    /// The upper child, unchanged, with this number there.
    Upper(u32),
    /// Both children, or one of them, with a new box: the plane cuts the primitive.
    Cut,
}

/// The destinations of all primitives of a cell.
struct Destinations {
    moved: Vec<Destination>,
    /// The numbers of cut primitives in the lower and in the upper child.
    cut: [Vec<u32>; 2],
}

impl Destinations {
    fn of(cell: Cell<'_>, plane: &Plane, children: [Cell<'_>; 2]) -> Self {
        let mut numbers = [0_u32; 2];
        let mut cut = [const { Vec::new() }; 2];
        let moved = cell.prims.iter().map(|prim| match Lies::of(prim, plane) {
            Lies::Below => {
                numbers[0] += 1;
                Destination::Lower(numbers[0] - 1)
            }
            Lies::Above => {
                numbers[1] += 1;
                Destination::Upper(numbers[1] - 1)
            }
            Lies::Across => {
                // Children keep the order of the cell, but clipping may have removed the primitive from one of them.
                for ((number, cut), child) in numbers.iter_mut().zip(&mut cut).zip(children) {
                    let at = child.prims.get(*number as usize);
                    if at.is_some_and(|at| at.slot() == prim.slot()) {
                        cut.push(*number);
                        *number += 1;
                    }
                }
                Destination::Cut
            }
        });
        let moved = moved.collect();
        Self { moved, cut }
    }

    /// The events of both children on one axis.
    fn divide(&self, axis: Axis, events: Vec<Event>, children: [Cell<'_>; 2]) -> [Vec<Event>; 2] {
        let (kept_lower, kept_upper) = self.split(&events, children);
        drop(events);
        let [new_lower, new_upper] = [0, 1].map(|side: usize| {
            let prims = children[side].prims;
            events_of_cut(prims, &self.cut[side], axis)
        });
        [merge(kept_lower, &new_lower), merge(kept_upper, &new_upper)]
    }

    /// The events of uncut primitives by child, renumbered. Numbers keep their order, so events stay sorted.
    fn split(&self, events: &[Event], children: [Cell<'_>; 2]) -> (Vec<Event>, Vec<Event>) {
        let [mut lower, mut upper] =
            children.map(|child| Vec::with_capacity(2 * child.prims.len()));
        for event in events {
            match self.moved[event.prim() as usize] {
                Destination::Lower(prim) => lower.push(event.renumbered(prim)),
                Destination::Upper(prim) => upper.push(event.renumbered(prim)),
                Destination::Cut => {}
            }
        }
        (lower, upper)
    }
}

/// The sorted events of cut primitives, about √N of N primitives (Wald and Havran 2006 §4.3).
fn events_of_cut(prims: &[Prim], cut: &[u32], axis: Axis) -> Vec<Event> {
    let mut events = Vec::with_capacity(2 * cut.len());
    for &prim in cut {
        push_events(&mut events, axis, prim, &prims[prim as usize]);
    }
    events.sort_unstable();
    events
}

/// Merges two sorted lists from the back, in the memory of the first.
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
        fn merging_equals_sorting(a: Vec<(i8, bool)>, b: Vec<(i8, bool)>) {
            let events = |list: &[(i8, bool)]| {
                let mut events = Vec::new();
                for (number, (at, flat)) in (0_u32..).zip(list) {
                    let min = Vec3::splat(f32::from(*at));
                    let max = if *flat { min } else { min + 1.0 };
                    push_events(&mut events, Axis::X, number, &Prim::new(0, &Aabb { min, max }));
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
