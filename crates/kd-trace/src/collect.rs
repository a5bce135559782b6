//! Which hits of a ray a query keeps: the closest, any, or the first few in order.

use std::cmp::Ordering;
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

/// Knows how far along a ray anything matters.
pub(crate) trait Limited {
    /// Nothing beyond this `t` matters; what is at it may.
    fn farthest(&self) -> f32;
}

impl<C: Collect> Limited for C {
    #[inline(always)]
    fn farthest(&self) -> f32 {
        self.limit()
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
///
/// Leaves come roughly front to back, so most hits belong near the end of the sorted hits, and are inserted there. A hit that
/// belongs farther from the end is appended, and so are those that follow it, until their number is at least a quarter of the
/// sorted hits: then all are sorted. So `k` hits in any order take O(k log k), and no more than 1.25 `max` are kept.
#[derive(Debug)]
pub struct Ordered<'a> {
    /// Upper limit on the number of hits; not 0.
    max: usize,
    /// Only hits behind this one are kept.
    behind: Option<Hit>,
    /// Sorted, each triangle once, while `sort_at` is `None`.
    out: &'a mut Vec<Hit>,
    /// The `t` of the last of `max` sorted hits; infinite for fewer.
    limit: f32,
    /// The length of `out` at which it is sorted; `None` while it is.
    sort_at: Option<usize>,
}

/// The largest number of hits that one insertion moves.
const NEAR_END: usize = 32;

impl<'a> Ordered<'a> {
    /// Fills `out`, which is cleared before, with the first `max` hits that `walk` passes to the collector: ordered by `t`, then by
    /// triangle, each triangle once. A triangle that is passed several times has the same `t`. Calls `walk` unless `max` is 0.
    ///
    /// O(k log k) for `k` hits passed. Allocates in `out` only, which holds at most 1.25 `max` hits.
    ///
    /// ```
    /// use kd_core::Hit;
    /// use kd_trace::kit::{Collect, Ordered};
    ///
    /// let hit = |t: f32, triangle: u32| Hit { t, u: 0.0, v: 0.0, triangle };
    /// let mut out = Vec::new();
    /// Ordered::fill(&mut out, 2, |collector| {
    ///     for hit in [hit(3.0, 0), hit(1.0, 1), hit(2.0, 2), hit(1.0, 1)] {
    ///         let _ = collector.take(hit);
    ///     }
    /// });
    /// assert_eq!(out, [hit(1.0, 1), hit(2.0, 2)]);
    /// ```
    pub fn fill(out: &'a mut Vec<Hit>, max: usize, walk: impl FnOnce(&mut Self)) {
        Self::fill_behind(out, None, max, walk);
    }

    /// [`fill`](Self::fill) with the first `max` hits behind one, which need not be a hit. `walk` may pass others, too.
    pub fn fill_behind(
        out: &'a mut Vec<Hit>,
        behind: Option<Hit>,
        max: usize,
        walk: impl FnOnce(&mut Self),
    ) {
        out.clear();
        if max == 0 {
            return;
        }
        let mut ordered = Self {
            max,
            behind,
            out,
            limit: f32::INFINITY,
            sort_at: None,
        };
        walk(&mut ordered);
        if ordered.sort_at.is_some() {
            ordered.sort();
        }
    }

    /// Appends a hit that does not belong near the end.
    #[cold]
    #[inline(never)]
    fn append(&mut self, hit: Hit) {
        if hit.t > self.limit {
            return;
        }
        let len = self.out.len();
        // At `max` hits the limit is known. But the hits that are sorted again must not outnumber the new ones by far.
        let sort_at = *self
            .sort_at
            .get_or_insert(self.max.clamp(len + len / 4, 2 * len));
        self.out.push(hit);
        if self.out.len() >= sort_at {
            self.sort();
        }
    }

    /// Sorts the hits, and keeps each triangle once and no more than `max`.
    fn sort(&mut self) {
        self.out.sort_unstable_by(|a, b| {
            if a.is_before(b) {
                Ordering::Less
            } else if b.is_before(a) {
                Ordering::Greater
            } else {
                Ordering::Equal
            }
        });
        // A triangle that is hit again has the same t, so it is next to itself.
        self.out.dedup_by_key(|hit| hit.triangle);
        self.out.truncate(self.max);
        self.sort_at = None;
        self.set_limit();
    }

    #[inline]
    fn set_limit(&mut self) {
        if self.out.len() == self.max
            && let Some(last) = self.out.last()
        {
            self.limit = last.t;
        }
    }
}

impl Collect for Ordered<'_> {
    #[inline]
    fn limit(&self) -> f32 {
        self.limit
    }

    fn take(&mut self, hit: Hit) -> ControlFlow<()> {
        if self.behind.is_some_and(|last| !last.is_before(&hit)) {
            return ControlFlow::Continue(());
        }
        let near_end = self.out.len().saturating_sub(NEAR_END);
        let later = if self.sort_at.is_none() {
            self.out[near_end..].partition_point(|other| other.is_before(&hit))
        } else {
            0
        };
        if later == 0 && near_end > 0 {
            self.append(hit);
            return ControlFlow::Continue(());
        }
        let place = near_end + later;
        // A triangle that is hit again has the same t, so it is exactly at this place.
        let is_known = self
            .out
            .get(place)
            .is_some_and(|other| other.triangle == hit.triangle);
        if !is_known && place < self.max {
            self.out.truncate(self.max - 1);
            self.out.insert(place, hit);
            self.set_limit();
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use kd_oracle::rng::Rng;

    use super::*;

    fn hit(t: f32, triangle: u32) -> Hit {
        Hit {
            t,
            u: 0.0,
            v: 0.0,
            triangle,
        }
    }

    /// The hits that the collector keeps of `found`, its limit, and the work: the number of hits that it sorts, summed over all
    /// sorts.
    fn first(max: usize, found: &[Hit]) -> (Vec<Hit>, f32, usize) {
        let mut out = Vec::new();
        let (mut limit, mut sorted) = (f32::INFINITY, 0);
        Ordered::fill(&mut out, max, |ordered| {
            for hit in found {
                let before = (ordered.out.clone(), ordered.sort_at);
                assert!(
                    ordered.take(*hit).is_continue(),
                    "there may always be a nearer one"
                );
                match (before.1, ordered.sort_at) {
                    (Some(count), None) => sorted += count,
                    (None, None) => {
                        let kept = before.0.len().saturating_sub(NEAR_END);
                        assert_eq!(before.0[..kept], ordered.out[..kept], "not moved");
                    }
                    _ => {}
                }
                assert!(
                    ordered.out.len() <= max.saturating_add(max / 4),
                    "max {max}: bounded memory"
                );
            }
            limit = ordered.limit();
            sorted += ordered.sort_at.map_or(0, |_| ordered.out.len());
        });
        (out, limit, sorted)
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
            let (out, limit, _) = first(max, &found);
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
        let mut out = sorted.to_vec();
        Ordered::fill(&mut out, 0, |_| unreachable!("nothing is searched"));
        assert_eq!(out, [], "max 0");
    }

    /// Orders of `count` hits, some of which come twice or three times: front to back, back to front, at random, at one `t`, and
    /// two runs.
    fn orders(count: u32) -> Vec<(&'static str, Vec<Hit>)> {
        let mut rng = Rng(3);
        let mut at_random: Vec<Hit> = (0..count).map(|i| hit((i / 3) as f32, i)).collect();
        for i in (1..at_random.len()).rev() {
            at_random.swap(i, rng.below(i + 1));
        }
        let forward: Vec<Hit> = (0..count).map(|i| hit((i / 3) as f32, i)).collect();
        let backward = forward.iter().rev().copied().collect();
        let coincident = at_random.iter().map(|of| hit(1.0, of.triangle)).collect();
        let (lower, upper) = forward.split_at(forward.len() / 2);
        let runs = [upper, lower].concat();
        let named = [
            ("front to back", forward.clone()),
            ("back to front", backward),
            ("at random", at_random),
            ("coincident", coincident),
            ("two runs", runs),
        ];
        let twice = |(name, hits): (_, Vec<Hit>)| {
            let mut found = Vec::new();
            for (i, hit) in hits.iter().enumerate() {
                let before = hits[i.saturating_sub(rng.below(100))];
                found.extend([*hit, before]);
                found.extend((i % 7 == 0).then_some(hits[0]));
            }
            (name, found)
        };
        named.map(twice).into()
    }

    #[test]
    fn any_order_gives_the_same_first_hits() {
        for count in [31, 33, 40, 100, 1000] {
            for (name, found) in orders(count) {
                let mut sorted = found.clone();
                sorted.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
                sorted.dedup();
                assert_eq!(sorted.len(), count as usize, "{name}: each once");
                let around = [32, 33, 34, 63, 64, 65, 99, 500, 999, 1000, 1001, usize::MAX];
                for max in (1..=20).chain(around) {
                    let (out, limit, _) = first(max, &found);
                    let most = max.min(sorted.len());
                    assert!(out == sorted[..most], "{name}, {max} of {count}");
                    if max <= NEAR_END && max <= sorted.len() {
                        assert_eq!(limit, sorted[max - 1].t, "{name}, {max} of {count}");
                    }
                    if max > sorted.len() {
                        assert_eq!(limit, f32::INFINITY, "{name}, {max} of {count}");
                    }
                }
            }
        }
    }

    /// A hit moves at most [`NEAR_END`] others, or is sorted with others. All sorts together take at most five times the hits.
    #[test]
    fn the_work_of_ordering_hits_is_in_proportion_to_their_number() {
        for (name, found) in orders(4000) {
            for max in [1, 4, 40, 400, 3999, 4000, usize::MAX] {
                let (_, _, sorted) = first(max, &found);
                assert!(
                    sorted <= 5 * found.len(),
                    "{name}, max {max}: {sorted} sorted for {}",
                    found.len()
                );
                assert!(
                    sorted > 0 || max < 400 || name == "front to back",
                    "{name}, max {max}: inserted, far from the end"
                );
            }
        }
    }

    /// Back to front, the limit is at most a quarter of `max` hits behind.
    #[test]
    fn the_limit_is_known_once_enough_hits_are_found() {
        let backward: Vec<Hit> = (0..1000).map(|i| hit((1000 - i) as f32, i)).collect();
        for max in [1, 20, 33, 40, 100, 300] {
            for count in max + max / 4..=3 * max {
                let (_, limit, _) = first(max, &backward[..count]);
                let last = count - max;
                let earlier = last - max / 4;
                assert!(
                    (backward[last].t..=backward[earlier].t).contains(&limit),
                    "{limit} after {count} hits, max {max}"
                );
            }
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
