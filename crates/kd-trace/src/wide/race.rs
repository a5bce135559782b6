//! Which of several ways to trace rays is fastest, by measuring all on the way.
//!
//! Rays that traverse together share work, or hide latencies of each other. How much that gains depends on the rays, the tree and
//! the caches; where it gains nothing, rays are faster alone. A batch measures this: the answers are the same.

/// A way to trace a group of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// As a tile, or as a stream.
    Together,
    /// In a queue.
    InTurns,
    Alone,
}

/// Most ways of one race.
const MOST_WAYS: usize = 3;

/// Groups are traced in the fastest way, but now and then all ways are measured. Each way traces other rays: the same rays would find
/// what they need in the cache.
#[derive(Clone, Copy, Debug)]
pub(super) struct Race {
    /// Rays alone come last.
    ways: &'static [Way],
    /// The fewest and the most groups that are traced in the fastest way until all are measured again.
    pauses: [u32; 2],
    /// By way, the time of a ray in nanoseconds: the mean of the last measurement and the mean before it.
    times: [f32; MOST_WAYS],
    /// The fastest way by these.
    fastest: usize,
    /// How many times all were measured since the fastest one changed; a clear measurement counts three times.
    rounds: u32,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// The way to measure.
    Measure(usize),
    /// Groups until the next measurement.
    Pause(u32),
}

/// Rounds of measurements in a row: rays differ, so one group each says little.
const IN_A_ROW: u32 = 2;
/// A measurement is clear where each other way takes longer by this factor.
const CLEAR: f32 = 1.4;
/// Rays together must be faster than alone by this factor. (What is saved then is less than a wrong choice costs.)
const MARGIN: f32 = 1.05;

impl Race {
    /// Nothing is measured yet. The first group is traced in the first way and not measured: it finds code and memory cold.
    pub(super) fn new(ways: &'static [Way], pauses: [u32; 2]) -> Self {
        debug_assert_eq!(ways.last(), Some(&Way::Alone), "rays alone come last");
        Self {
            ways,
            pauses,
            times: [0.0; MOST_WAYS],
            fastest: 0,
            rounds: 0,
            state: State::Pause(1),
        }
    }

    /// Forgets what was measured.
    pub(super) fn restart(&mut self) {
        *self = Self::new(self.ways, self.pauses);
    }

    /// Goes on with the rays of another batch, which may differ: all ways are measured soon.
    pub(super) fn resume(&mut self) {
        if let State::Pause(groups) = &mut self.state {
            *groups = self.pauses[0].min(*groups);
        }
    }

    /// How to trace the next group.
    #[inline]
    pub(super) fn next(&mut self) -> Way {
        match &mut self.state {
            State::Measure(way) => self.ways[*way],
            State::Pause(groups) => {
                *groups -= 1;
                if *groups == 0 {
                    self.state = State::Measure(0);
                }
                self.ways[self.fastest]
            }
        }
    }

    /// How many times all ways were measured since the fastest one changed, at least.
    #[inline]
    pub(super) fn rounds(&self) -> u32 {
        self.rounds
    }

    /// Whether to [`learn`](Self::learn) the time of the next group.
    #[inline]
    pub(super) fn measures(&self) -> bool {
        !matches!(self.state, State::Pause(_))
    }

    /// Whether rays alone are fastest, and the next group needs no measurement. Counts this number of groups as traced then.
    #[inline]
    pub(super) fn skips(&mut self, count: u32) -> bool {
        let is_alone = self.ways[self.fastest] == Way::Alone;
        match &mut self.state {
            State::Pause(groups) if *groups > 1 && is_alone => {
                *groups = groups.saturating_sub(count).max(1);
                true
            }
            _ => false,
        }
    }

    /// Records the time of a ray in the group that was measured. While the fastest way stays the same, measurements become more
    /// seldom.
    pub(super) fn learn(&mut self, time: f32) {
        let State::Measure(way) = self.state else {
            return;
        };
        let mean = &mut self.times[way];
        *mean = if self.rounds == 0 {
            time
        } else {
            0.5 * (*mean + time)
        };
        let is_round = way + 1 == self.ways.len();
        self.state = State::Measure(if is_round { 0 } else { way + 1 });
        if is_round {
            self.compare();
        }
    }

    /// Finds the fastest way after all were measured.
    fn compare(&mut self) {
        let before = (self.rounds >= IN_A_ROW).then_some(self.fastest);
        let alone = self.ways.len() - 1;
        let time = |way: usize| self.times[way] * if way < alone { MARGIN } else { 1.0 };
        let least = |a: &usize, b: &usize| time(*a).total_cmp(&time(*b));
        let fastest = (0..=alone).min_by(least).unwrap_or(alone);
        let others = (0..=alone).filter(|way| *way != fastest);
        let second = others.min_by(least).unwrap_or(alone);
        let is_clear = self.times[second] > CLEAR * self.times[fastest];
        self.fastest = fastest;
        self.rounds += if is_clear { 3 } else { 1 };
        if before.is_some_and(|before| before != self.fastest) {
            // It may be an interruption: all are measured at once again.
            self.rounds = 0;
        }
        if let Some(doublings) = self.rounds.checked_sub(IN_A_ROW) {
            let [shortest, longest] = self.pauses;
            self.state = State::Pause(longest.min(shortest << doublings.min(8)));
        }
    }
}

/// Measures times; without a clock, every time is 0.
pub(super) struct Stopwatch(#[cfg(not(target_family = "wasm"))] std::time::Instant);

impl Stopwatch {
    #[inline(always)]
    pub(super) fn start() -> Self {
        Self(
            #[cfg(not(target_family = "wasm"))]
            std::time::Instant::now(),
        )
    }

    /// The time since the start for each of some rays, in nanoseconds.
    #[inline(always)]
    pub(super) fn per_ray(&self, rays: usize) -> f32 {
        #[cfg(not(target_family = "wasm"))]
        let time = self.0.elapsed().as_nanos() as f32;
        #[cfg(target_family = "wasm")]
        let time = 0.0;
        time / rays as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &[Way] = &[Way::Together, Way::Alone];
    const PAUSES: [u32; 2] = [16, 512];
    const THREE: &[Way] = &[Way::Together, Way::InTurns, Way::Alone];

    /// The ways of some groups, and the numbers of those that are measured.
    fn trace(
        race: &mut Race,
        groups: usize,
        mut time: impl FnMut(Way) -> f32,
    ) -> (Vec<Way>, Vec<usize>) {
        let mut measured = Vec::new();
        let ways = (0..groups).map(|group| {
            let is_measured = race.measures();
            let way = race.next();
            if is_measured {
                measured.push(group);
                race.learn(time(way));
            }
            way
        });
        (ways.collect(), measured)
    }

    /// All ways take one unit but this one.
    fn except(special: Way, special_time: f32) -> impl Fn(Way) -> f32 {
        move |way| if way == special { special_time } else { 1.0 }
    }

    #[test]
    fn the_faster_way_is_taken_and_both_are_measured_ever_more_seldom() {
        let slightly = [1, 2, 3, 4, 21, 22, 55, 56, 121, 122];
        let clearly = [1, 2, 35, 36, 293, 294, 807, 808, 1321, 1322];
        for (together, faster, expected) in [
            (1.2, Way::Alone, slightly),
            (0.8, Way::Together, slightly),
            (2.0, Way::Alone, clearly),
            (0.5, Way::Together, clearly),
        ] {
            let mut race = Race::new(TWO, PAUSES);
            let (ways, measured) = trace(&mut race, 2000, except(Way::Together, together));
            assert_eq!(measured[..10], expected, "{faster:?}");
            assert!(measured.len() < 40, "{faster:?}: seldom");
            for (group, way) in ways.iter().enumerate() {
                let is_first = group == 0;
                assert!(
                    *way == faster || is_first || measured.contains(&group),
                    "group {group}"
                );
            }
        }
    }

    #[test]
    fn the_fastest_of_three_ways_is_taken() {
        for fastest in THREE {
            let mut race = Race::new(THREE, PAUSES);
            let (ways, measured) = trace(&mut race, 500, except(*fastest, 0.5));
            assert_eq!(measured[..6], [1, 2, 3, 36, 37, 38]);
            let count = ways.iter().filter(|way| *way == fastest).count();
            assert!(count > 480, "{fastest:?}: {count} of 500 groups");
        }
        let mut race = Race::new(THREE, PAUSES);
        let (ways, measured) = trace(&mut race, 8, except(Way::InTurns, 0.9));
        assert_eq!(measured, [1, 2, 3, 4, 5, 6], "not clear: once more");
        assert_eq!(ways[7], Way::InTurns);
    }

    #[test]
    fn rays_together_must_be_faster_than_alone_by_a_margin() {
        for (together, expected) in [(0.97, Way::Alone), (0.94, Way::Together)] {
            let mut race = Race::new(TWO, PAUSES);
            let (ways, _) = trace(&mut race, 10, except(Way::Together, together));
            assert_eq!(ways[9], expected, "{together}");
        }
    }

    #[test]
    fn groups_are_skipped_while_rays_alone_are_faster() {
        let mut race = Race::new(TWO, PAUSES);
        assert!(!race.skips(1), "nothing is known");
        trace(&mut race, 3, except(Way::Together, 2.0));
        assert!(race.skips(16), "no measurement is due");
        assert!(race.skips(32), "more than are left");
        assert!(!race.skips(1), "one is left");
        assert_eq!(race.next(), Way::Alone, "the last of the pause");
        assert!(race.measures(), "then both ways");
        let mut race = Race::new(TWO, PAUSES);
        trace(&mut race, 3, except(Way::Alone, 2.0));
        assert!(!race.skips(1), "rays together are faster");
    }

    #[test]
    fn another_batch_is_measured_soon() {
        let mut race = Race::new(TWO, PAUSES);
        let (_, measured) = trace(&mut race, 1000, except(Way::Together, 2.0));
        assert!(*measured.last().expect("some") < 900, "a long pause");
        race.resume();
        let (ways, measured) = trace(&mut race, 18, except(Way::Together, 2.0));
        assert_eq!(measured, [16, 17]);
        assert_eq!(ways[0], Way::Alone, "what was learned holds until then");
        race.restart();
        let (ways, measured) = trace(&mut race, 3, except(Way::Together, 2.0));
        assert_eq!((ways[0], measured), (Way::Together, vec![1, 2]));
    }

    #[test]
    fn a_change_is_noticed() {
        let mut race = Race::new(TWO, PAUSES);
        trace(&mut race, 300, except(Way::Alone, 2.0));
        let (ways, _) = trace(&mut race, 1000, except(Way::Together, 2.0));
        assert_eq!(ways[999], Way::Alone);
    }

    #[test]
    fn one_slow_group_among_others_changes_little() {
        let mut race = Race::new(TWO, PAUSES);
        let mut count = 0;
        let (ways, _) = trace(&mut race, 1000, |way| {
            count += 1;
            let is_interrupted = count == 9;
            f32::from(1 + u8::from(way == Way::Alone) + 10 * u8::from(is_interrupted))
        });
        let alone = ways.iter().filter(|way| **way == Way::Alone).count();
        assert!(alone < 20, "{alone} groups in the slower way");
    }
}
