//! Events: sorted starts and ends of primitives along an axis.

use kd_core::Axis;

use crate::CHUNK;
use crate::plane::{BestPlane, Counts};
use crate::prim::Prim;

/// A start, an end, or both at once (planar), packed into an integer that orders like the event:
///
/// ```text
/// bits 63..32  position, as an integer that orders like the float
/// bits 31..30  kind: End < Planar < Start
/// bits 29..0   primitive, numbered within its cell
/// ```
/// At one position ends come first: a primitive that ends there does not reach above the plane, and one that starts there
/// does not reach below it (Wald and Havran 2006 §4.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Event(u64);

const END: u64 = 0;
const PLANAR: u64 = 1;
const START: u64 = 2;
const KIND_SHIFT: u32 = 30;
const PRIM_MASK: u64 = (1 << KIND_SHIFT) - 1;

impl Event {
    /// An initial value for memory that is written later.
    pub(crate) const NONE: Self = Self(0);

    /// A start without a primitive.
    #[inline]
    pub(crate) fn start(position: f32) -> Self {
        Self::new(position, START, 0)
    }

    /// An end without a primitive.
    #[inline]
    pub(crate) fn end(position: f32) -> Self {
        Self::new(position, END, 0)
    }

    /// A planar event without a primitive.
    #[inline]
    pub(crate) fn planar(position: f32) -> Self {
        Self::new(position, PLANAR, 0)
    }

    #[inline]
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

    /// The same event with the number of its primitive in another cell.
    pub(crate) fn renumbered(self, prim: u32) -> Self {
        Self(self.0 & !PRIM_MASK | u64::from(prim))
    }
}

/// An integer that orders like the float. -0.0 and 0.0 are the same position, so they give the same integer.
#[inline]
fn ordered(x: f32) -> u32 {
    let bits = (x + 0.0).to_bits();
    // Inverts all bits of a negative number, and only the sign bit of a positive one.
    let inverted = (bits.cast_signed() >> 31).cast_unsigned() | 1 << 31;
    bits ^ inverted
}

fn unordered(key: u32) -> f32 {
    f32::from_bits(if key >> 31 == 1 {
        key & !(1 << 31)
    } else {
        !key
    })
}

/// Appends the events of one primitive on one axis.
pub(crate) fn push_events(events: &mut Vec<Event>, axis: Axis, number: u32, prim: &Prim) {
    let (start, end) = (prim.start(axis), prim.end(axis));
    if start == end {
        events.push(Event::new(start, PLANAR, number));
    } else {
        events.push(Event::new(start, START, number));
        events.push(Event::new(end, END, number));
    }
}

/// All events of a cell on one axis, unsorted.
pub(crate) fn events_of(prims: &[Prim], axis: Axis) -> Vec<Event> {
    let mut events = Vec::with_capacity(2 * prims.len());
    for (number, prim) in (0_u32..).zip(prims) {
        push_events(&mut events, axis, number, prim);
    }
    events
}

/// Offers a plane at every position with an event, with counts on both sides that are updated incrementally (Wald and
/// Havran 2006, Algorithm 4). `lower` primitives reach below all of the events, and `upper` above the first one. Each event
/// and each of these counts for `weight` primitives.
pub(crate) fn sweep(
    events: &[Event],
    axis: Axis,
    (mut lower, mut upper): (usize, usize),
    weight: usize,
    best: &mut BestPlane<'_>,
) {
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
                lower: weight * lower,
                planar: weight * planar,
                upper: weight * upper,
            },
        );
        lower += planar + starts;
    }
}

/// [`sweep`] in chunks, on several threads if `parallel` (Choi et al. 2010): `PreScan` counts the events of each chunk,
/// `Push` sums the counts before each chunk, and `SAHScan` finds the best plane of each chunk.
pub(crate) fn sweep_in_chunks(
    events: &[Event],
    axis: Axis,
    prims: usize,
    best: &mut BestPlane<'_>,
    parallel: bool,
) {
    let chunks = chunks(events);
    let counted = kd_tasks::map(chunks.clone(), parallel, |chunk| {
        let mut count_of = [0_usize; 3];
        for event in chunk {
            count_of[event.kind()] += 1;
        }
        count_of
    });
    let mut before = (0, prims);
    let mut scans = Vec::with_capacity(chunks.len());
    for (chunk, [ends, planar, starts]) in chunks.into_iter().zip(counted) {
        scans.push((chunk, before));
        before = (before.0 + planar + starts, before.1 - planar - ends);
    }
    let empty = BestPlane::new(best.cost);
    let found = kd_tasks::map(scans, parallel, |(chunk, before)| {
        let mut best = empty;
        sweep(chunk, axis, before, 1, &mut best);
        best.found()
    });
    for plane in found.into_iter().flatten() {
        best.take(plane);
    }
}

/// Divides sorted events into contiguous chunks, such that events at one position are in one chunk.
fn chunks(mut events: &[Event]) -> Vec<&[Event]> {
    let mut chunks = Vec::with_capacity(events.len() / CHUNK + 1);
    while events.len() > CHUNK {
        let here = events[CHUNK].position_bits();
        let cut = events.partition_point(|event| event.position_bits() < here);
        // The whole chunk is at one position: it extends to the next position.
        let cut = if cut > 0 {
            cut
        } else {
            events.partition_point(|event| event.position_bits() == here)
        };
        let (chunk, rest) = events.split_at(cut);
        chunks.push(chunk);
        events = rest;
    }
    chunks.push(events);
    chunks
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
        assert_eq!(ordered(-0.0), ordered(0.0), "the same integer");
        assert!(
            ordered(-f32::MIN_POSITIVE) < ordered(0.0),
            "a negative number is below"
        );
        assert!(
            ordered(f32::MIN_POSITIVE) > ordered(0.0),
            "a positive number is above"
        );
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
        assert_eq!(events[1].renumbered(3).prim(), 3, "the new number");
        assert_eq!(
            events[1].renumbered(3).position(),
            1.0,
            "the position is unchanged"
        );
    }
}
