//! Which hits of a ray a query keeps: the closest, any, or the first few in order.

use std::ops::ControlFlow;

use kd_core::Hit;

/// Receives the hits that a traversal finds, in any order, some more than once.
pub trait Collect {
    /// Whether the first hit found ends the search.
    const ANY: bool = false;
    /// Records that there is some hit. Called only where [`ANY`](Self::ANY) is true.
    fn take_any(&mut self) {}
    /// Hits beyond this `t` do not matter; hits at it may.
    fn limit(&self) -> f32;
    /// Receives a hit. Breaks if no other hit can matter.
    fn take(&mut self, hit: Hit) -> ControlFlow<()>;
    /// Whether [`take`](Self::take) broke.
    fn is_done(&self) -> bool {
        false
    }
}

/// Keeps the first of two hits.
#[inline(always)]
pub(crate) fn keep_first(best: &mut Option<Hit>, hit: Hit) {
    if best.is_none_or(|best| hit.is_before(&best)) {
        *best = Some(hit);
    }
}

/// The closest hit, the lower triangle among equals.
#[derive(Debug, Default)]
pub struct Closest(
    /// The closest so far.
    pub Option<Hit>,
);

impl Collect for Closest {
    #[inline]
    fn limit(&self) -> f32 {
        self.0.map_or(f32::INFINITY, |best| best.t)
    }

    #[inline]
    fn take(&mut self, hit: Hit) -> ControlFlow<()> {
        keep_first(&mut self.0, hit);
        ControlFlow::Continue(())
    }
}

/// Whether there is a hit.
#[derive(Debug, Default)]
pub struct Any(
    /// Whether a hit was found.
    pub bool,
);

impl Collect for Any {
    const ANY: bool = true;

    #[inline]
    fn take_any(&mut self) {
        self.0 = true;
    }

    #[inline]
    fn limit(&self) -> f32 {
        f32::INFINITY
    }

    #[inline]
    fn take(&mut self, _: Hit) -> ControlFlow<()> {
        self.0 = true;
        ControlFlow::Break(())
    }

    fn is_done(&self) -> bool {
        self.0
    }
}

/// The first `max` hits in order, each triangle once.
#[derive(Debug)]
pub struct Ordered<'a> {
    /// Upper limit on the number kept; not 0.
    pub max: usize,
    /// Always sorted. Leaves come roughly front to back, so new hits are inserted near the end.
    pub out: &'a mut Vec<Hit>,
}

impl Collect for Ordered<'_> {
    #[inline]
    fn limit(&self) -> f32 {
        match self.out.last() {
            Some(last) if self.out.len() == self.max => last.t,
            _ => f32::INFINITY,
        }
    }

    fn take(&mut self, hit: Hit) -> ControlFlow<()> {
        let place = self.out.partition_point(|other| other.is_before(&hit));
        // A triangle that is hit again has the same t, so it is exactly at this place.
        let is_known = self
            .out
            .get(place)
            .is_some_and(|other| other.triangle == hit.triangle);
        if !is_known && place < self.max {
            self.out.truncate(self.max - 1);
            self.out.insert(place, hit);
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hit(t: f32, triangle: u32) -> Hit {
        Hit {
            t,
            u: 0.0,
            v: 0.0,
            triangle,
        }
    }

    #[test]
    fn ordered_hits_are_sorted_unique_and_the_first() {
        let found = [
            hit(2.0, 5),
            hit(1.0, 9),
            hit(2.0, 5),
            hit(2.0, 1),
            hit(3.0, 0),
            hit(1.0, 2),
        ];
        let sorted = [
            hit(1.0, 2),
            hit(1.0, 9),
            hit(2.0, 1),
            hit(2.0, 5),
            hit(3.0, 0),
        ];
        for max in 1..7 {
            let mut out = Vec::new();
            let mut ordered = Ordered { max, out: &mut out };
            for h in found {
                assert!(
                    ordered.take(h).is_continue(),
                    "there may always be a nearer one"
                );
            }
            let limit = ordered.limit();
            assert_eq!(out, sorted[..max.min(5)], "max {max}");
            let expected = if max <= 5 {
                sorted[max - 1].t
            } else {
                f32::INFINITY
            };
            assert_eq!(
                limit, expected,
                "max {max}: nothing beyond the last one matters, once full"
            );
        }
    }

    #[test]
    fn the_closest_is_the_lower_triangle_among_equals() {
        let mut closest = Closest::default();
        for h in [hit(2.0, 5), hit(2.0, 3), hit(2.0, 4), hit(2.5, 0)] {
            assert!(
                closest.take(h).is_continue(),
                "there may always be a nearer one"
            );
        }
        assert_eq!(closest.0, Some(hit(2.0, 3)), "at t = 2");
    }
}
