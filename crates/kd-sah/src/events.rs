//! Where primitives start and end along an axis, in order.

use kd_core::Axis;

use crate::cell::Prim;
use crate::plane::{BestPlane, Counts};

/// A start, an end, or both at once (planar), packed so that integers in order are events in order:
///
/// ```text
/// bits 63..32  position, as an integer that orders like the float
/// bits 31..30  kind: End < Planar < Start
/// bits 29..0   primitive, numbered within its cell
/// ```
/// At one position ends come first: what ends there does not reach above the plane, what starts there does not reach
/// below it (Wald and Havran 2006 §4.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Event(u64);

const END: u64 = 0;
const PLANAR: u64 = 1;
const START: u64 = 2;
const KIND_SHIFT: u32 = 30;
const PRIM_MASK: u64 = (1 << KIND_SHIFT) - 1;

impl Event {
    fn new(position: f32, kind: u64, prim: u32) -> Self {
        Self(u64::from(ordered(position)) << 32 | kind << KIND_SHIFT | u64::from(prim))
    }

    pub(crate) fn position(self) -> f32 {
        unordered(self.position_bits())
    }

    #[allow(clippy::cast_possible_truncation, reason = "the upper half of 64 bits")]
    fn position_bits(self) -> u32 {
        (self.0 >> 32) as u32
    }

    #[allow(clippy::cast_possible_truncation, reason = "two bits")]
    fn kind(self) -> usize {
        (self.0 >> KIND_SHIFT & 3) as usize
    }

    #[allow(clippy::cast_possible_truncation, reason = "30 bits")]
    pub(crate) fn prim(self) -> u32 {
        (self.0 & PRIM_MASK) as u32
    }

    /// The same event of a primitive under its number in another cell.
    pub(crate) fn renumbered(self, prim: u32) -> Self {
        Self(self.0 & !PRIM_MASK | u64::from(prim))
    }
}

/// An integer that orders like the float. -0.0 and 0.0 are one position, so they become one integer.
fn ordered(x: f32) -> u32 {
    let bits = (x + 0.0).to_bits();
    if bits >> 31 == 1 {
        !bits
    } else {
        bits | 1 << 31
    }
}

fn unordered(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 {
        key & !(1 << 31)
    } else {
        !key
    })
}

/// Appends the events of one primitive on one axis.
pub(crate) fn push_events(events: &mut Vec<Event>, axis: Axis, prim: u32, from: &Prim) {
    let (start, end) = (from.bounds.min[axis.index()], from.bounds.max[axis.index()]);
    if start == end {
        events.push(Event::new(start, PLANAR, prim));
    } else {
        events.push(Event::new(start, START, prim));
        events.push(Event::new(end, END, prim));
    }
}

/// All events of a cell on one axis, not sorted.
pub(crate) fn events_of(prims: &[Prim], axis: Axis) -> Vec<Event> {
    let mut events = Vec::with_capacity(2 * prims.len());
    for (prim, from) in (0_u32..).zip(prims) {
        push_events(&mut events, axis, prim, from);
    }
    events
}

/// Offers every position with an event, with the counts on both sides kept up along the way (Wald and Havran 2006,
/// Algorithm 4).
pub(crate) fn sweep(events: &[Event], axis: Axis, prims: usize, best: &mut BestPlane<'_>) {
    let mut lower = 0;
    let mut upper = prims;
    let mut rest = events;
    while let Some(first) = rest.first() {
        let here = first.position_bits();
        let mut count_of = [0_usize; 3];
        let mut at = 0;
        while at < rest.len() && rest[at].position_bits() == here {
            count_of[rest[at].kind()] += 1;
            at += 1;
        }
        rest = &rest[at..];
        let [ends, planar, starts] = count_of;
        upper -= ends + planar;
        best.offer(
            axis,
            first.position(),
            Counts {
                lower,
                planar,
                upper,
            },
        );
        lower += planar + starts;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn keys_order_like_floats(a in -1e30_f32..1e30, b in -1e30_f32..1e30) {
            prop_assert_eq!(ordered(a).cmp(&ordered(b)), a.partial_cmp(&b).expect("finite"));
            prop_assert_eq!(unordered(ordered(a)), a);
        }
    }

    #[test]
    fn both_zeros_are_one_position() {
        assert_eq!(ordered(-0.0), ordered(0.0), "one integer");
        assert!(ordered(-f32::MIN_POSITIVE) < ordered(0.0), "below");
        assert!(ordered(f32::MIN_POSITIVE) > ordered(0.0), "above");
    }

    #[test]
    fn ends_come_before_planar_before_starts() {
        let mut events = [
            Event::new(1.0, START, 0),
            Event::new(1.0, PLANAR, 9),
            Event::new(1.0, END, 5),
            Event::new(0.5, START, 7),
        ];
        events.sort_unstable();
        let order: Vec<u32> = events.iter().map(|e| e.prim()).collect();
        assert_eq!(order, [7, 5, 9, 0], "by position, then kind");
        assert_eq!(events[1].renumbered(3).prim(), 3, "a new number");
        assert_eq!(events[1].renumbered(3).position(), 1.0, "at the same place");
    }
}
