//! What a query wants from the hits of a ray: the closest, any, or the first few in order.

use std::ops::ControlFlow;

use kd_core::Hit;

/// Takes the hits that a traversal finds, in any order, the same one possibly several times.
pub trait Collect {
    /// Whether any hit is as good as any other, so that the first one ends the search.
    const ANY: bool = false;
    /// Takes note that there is a hit, whichever: only where any will do.
    fn take_any(&mut self) {}
    /// Hits beyond this `t` are of no interest; hits at it may be.
    fn limit(&self) -> f32;
    /// Takes a hit. Breaks if no other can matter.
    fn take(&mut self, hit: Hit) -> ControlFlow<()>;
    /// Whether a hit that was taken broke.
    fn is_done(&self) -> bool {
        false
    }
}

/// Keeps the hit that comes first.
#[inline(always)]
pub(crate) fn keep_first(best: &mut Option<Hit>, hit: Hit) {
    if best.is_none_or(|best| hit.is_before(&best)) {
        *best = Some(hit);
    }
}

/// The closest hit, the lower triangle among equals.
#[derive(Debug, Default)]
pub struct Closest(
    /// The one so far.
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
    /// Whether there was one.
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
    /// How many are kept; not 0.
    pub max: usize,
    /// Sorted at all times. Leaves come roughly front to back, so that new hits go near the end.
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
        // A triangle met again gives the same t, so it stands exactly where it would go.
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
