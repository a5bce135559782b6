//! Which of two ways to trace rays is faster, by measuring both on the way.
//!
//! Rays that traverse together share work, or hide latencies of each other. How much that gains depends on the rays, the tree and
//! the caches; where it gains nothing, rays are faster alone. A batch measures this: the answers are the same.

/// A way to trace a group of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Together,
    Alone,
}

/// Rays together against rays alone. Groups are traced in the faster way, but now and then both are measured: one group each,
/// since rays that pass where others passed before find memory in the cache.
#[derive(Clone, Copy, Debug)]
pub(super) struct Race {
    /// The most groups that are traced in the faster way until both are measured again.
    longest: u32,
    /// The time of a ray, in nanoseconds: the mean of the last measurement and the mean before it.
    together: f32,
    alone: f32,
    /// The faster way by these.
    faster: Way,
    /// How many times both were measured since the order changed; a clear measurement counts three times.
    rounds: u32,
    state: State,
}

#[derive(Clone, Copy, Debug)]
enum State {
    MeasureTogether,
    MeasureAlone,
    /// Groups until the next measurement.
    Pause(u32),
}

/// Rounds of measurements in a row: rays differ, so one group each says little.
const IN_A_ROW: u32 = 2;
/// Groups to trace in the faster way after these.
const SHORT: u32 = 16;
/// A measurement is clear where one way takes longer by this factor.
const CLEAR: f32 = 1.4;
/// Rays together must be faster by this factor. (What is saved then is less than a wrong choice costs.)
const MARGIN: f32 = 1.05;

impl Race {
    /// Nothing is measured yet. The first group is traced together and not measured: it finds code and memory cold.
    pub(super) fn new(longest: u32) -> Self {
        Self {
            longest,
            together: 0.0,
            alone: 0.0,
            faster: Way::Together,
            rounds: 0,
            state: State::Pause(1),
        }
    }

    /// How to trace the next group.
    #[inline]
    pub(super) fn next(&mut self) -> Way {
        match &mut self.state {
            State::MeasureTogether => Way::Together,
            State::MeasureAlone => Way::Alone,
            State::Pause(groups) => {
                *groups -= 1;
                if *groups == 0 {
                    self.state = State::MeasureTogether;
                }
                self.faster
            }
        }
    }

    /// Whether to [`learn`](Self::learn) the time of the next group.
    #[inline]
    pub(super) fn measures(&self) -> bool {
        !matches!(self.state, State::Pause(_))
    }

    /// Whether rays alone are faster, and the next group needs no measurement. Counts this number of groups as traced then.
    #[inline]
    pub(super) fn skips(&mut self, count: u32) -> bool {
        let is_alone = self.faster == Way::Alone;
        match &mut self.state {
            State::Pause(groups) if *groups > 1 && is_alone => {
                *groups = groups.saturating_sub(count).max(1);
                true
            }
            _ => false,
        }
    }

    /// Records the time of a ray. While the order of both ways stays the same, measurements become more seldom.
    pub(super) fn learn(&mut self, way: Way, time: f32) {
        let (mean, next) = match way {
            Way::Together => (&mut self.together, State::MeasureAlone),
            Way::Alone => (&mut self.alone, State::MeasureTogether),
        };
        *mean = if self.rounds == 0 {
            time
        } else {
            0.5 * (*mean + time)
        };
        self.state = next;
        if way == Way::Together {
            return;
        }
        let before = (self.rounds >= IN_A_ROW).then_some(self.faster);
        self.faster = if self.together * MARGIN <= self.alone {
            Way::Together
        } else {
            Way::Alone
        };
        let (slower, faster) = (self.together.max(self.alone), self.together.min(self.alone));
        self.rounds += if slower > CLEAR * faster { 3 } else { 1 };
        if before.is_some_and(|before| before != self.faster) {
            // It may be an interruption: both are measured at once again.
            self.rounds = 0;
        }
        if let Some(doublings) = self.rounds.checked_sub(IN_A_ROW) {
            self.state = State::Pause(self.longest.min(SHORT << doublings.min(8)));
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

    /// The ways of some groups, and the numbers of those that are measured.
    fn ways(
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
                race.learn(way, time(way));
            }
            way
        });
        (ways.collect(), measured)
    }

    #[test]
    fn the_faster_way_is_taken_and_both_are_measured_ever_more_seldom() {
        let slightly = [1, 2, 3, 4, 21, 22, 55, 56, 121, 122];
        let clearly = [1, 2, 35, 36, 293, 294, 807, 808, 1321, 1322];
        for (together, alone, faster, expected) in [
            (1.2, 1.0, Way::Alone, slightly),
            (1.0, 1.2, Way::Together, slightly),
            (2.0, 1.0, Way::Alone, clearly),
            (1.0, 2.0, Way::Together, clearly),
        ] {
            let mut race = Race::new(512);
            let time = |way| {
                if way == Way::Together {
                    together
                } else {
                    alone
                }
            };
            let (ways, measured) = ways(&mut race, 2000, time);
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
    fn groups_are_skipped_while_rays_alone_are_faster() {
        let slower = |slow: Way| move |way| f32::from(1 + u8::from(way == slow));
        let mut race = Race::new(512);
        assert!(!race.skips(1), "nothing is known");
        ways(&mut race, 3, slower(Way::Together));
        assert!(race.skips(SHORT), "no measurement is due");
        assert!(race.skips(2 * SHORT), "more than are left");
        assert!(!race.skips(1), "one is left");
        assert_eq!(race.next(), Way::Alone, "the last of the pause");
        assert!(race.measures(), "then both ways");
        let mut race = Race::new(512);
        ways(&mut race, 3, slower(Way::Alone));
        assert!(!race.skips(1), "rays together are faster");
    }

    #[test]
    fn a_change_is_noticed() {
        let slower = |slow: Way| move |way| f32::from(1 + u8::from(way == slow));
        let mut race = Race::new(512);
        ways(&mut race, 300, slower(Way::Alone));
        let (ways, _) = ways(&mut race, 1000, slower(Way::Together));
        assert_eq!(ways[999], Way::Alone);
    }

    #[test]
    fn one_slow_group_among_others_changes_little() {
        let mut race = Race::new(512);
        let mut count = 0;
        let (ways, _) = ways(&mut race, 1000, |way| {
            count += 1;
            let is_interrupted = count == 9;
            f32::from(1 + u8::from(way == Way::Alone) + 10 * u8::from(is_interrupted))
        });
        let alone = ways.iter().filter(|way| **way == Way::Alone).count();
        assert!(alone < 20, "{alone} groups in the slower way");
    }
}
