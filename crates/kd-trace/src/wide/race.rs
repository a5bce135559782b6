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
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Race {
    /// The time of a ray, in nanoseconds, when it was last measured.
    together: f32,
    alone: f32,
    state: State,
    /// Groups to trace in the faster way, after the last measurement.
    pause: u32,
}

#[derive(Clone, Copy, Debug, Default)]
enum State {
    #[default]
    MeasureTogether,
    MeasureAlone,
    /// Groups until the next measurement.
    Pause(u32),
}

/// Groups to trace in the faster way after the first measurement, and at most.
const SHORT: u32 = 16;
const LONG: u32 = 256;

impl Race {
    /// How to trace the next group, and whether to [`learn`](Self::learn) its time.
    #[inline]
    pub(super) fn next(&mut self) -> (Way, bool) {
        match &mut self.state {
            State::MeasureTogether => (Way::Together, true),
            State::MeasureAlone => (Way::Alone, true),
            State::Pause(groups) => {
                *groups -= 1;
                if *groups == 0 {
                    self.state = State::MeasureTogether;
                }
                (self.faster(), false)
            }
        }
    }

    /// Whether rays alone are faster, and this number of groups needs no measurement. Counts them as traced then.
    #[inline]
    pub(super) fn skips(&mut self, count: u32) -> bool {
        match &mut self.state {
            State::Pause(groups) if *groups > count && self.together > self.alone => {
                *groups -= count;
                true
            }
            _ => false,
        }
    }

    fn faster(&self) -> Way {
        if self.together <= self.alone {
            Way::Together
        } else {
            Way::Alone
        }
    }

    /// Records the time of a ray. Where the order of both ways is the same as before, the next measurement is later.
    pub(super) fn learn(&mut self, way: Way, time: f32) {
        match way {
            Way::Together => {
                let before = self.faster();
                self.together = time;
                if self.pause > 0 && before != self.faster() {
                    self.pause = 0;
                }
                self.state = State::MeasureAlone;
            }
            Way::Alone => {
                let before = self.faster();
                self.alone = time;
                let is_new = self.pause == 0 || before != self.faster();
                self.pause = if is_new {
                    SHORT
                } else {
                    LONG.min(2 * self.pause)
                };
                self.state = State::Pause(self.pause);
            }
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
    fn ways(race: &mut Race, groups: usize, time: impl Fn(Way) -> f32) -> (Vec<Way>, Vec<usize>) {
        let mut measured = Vec::new();
        let ways = (0..groups).map(|group| {
            let (way, is_measured) = race.next();
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
        for (together, alone, faster) in [(2.0, 1.0, Way::Alone), (1.0, 2.0, Way::Together)] {
            let mut race = Race::default();
            let time = |way| {
                if way == Way::Together {
                    together
                } else {
                    alone
                }
            };
            let (ways, measured) = ways(&mut race, 2000, time);
            assert_eq!(
                measured[..10],
                [0, 1, 18, 19, 52, 53, 118, 119, 248, 249],
                "{faster:?}"
            );
            assert!(measured.len() < 30, "{faster:?}: seldom");
            for (group, way) in ways.iter().enumerate() {
                assert!(*way == faster || measured.contains(&group), "group {group}");
            }
        }
    }

    #[test]
    fn groups_are_skipped_while_rays_alone_are_faster() {
        let mut race = Race::default();
        assert!(!race.skips(1), "nothing is known");
        ways(&mut race, 2, |way| {
            f32::from(u8::from(way == Way::Together))
        });
        assert!(!race.skips(SHORT), "a measurement is among them");
        assert!(race.skips(SHORT - 1), "up to it");
        assert!(!race.skips(1), "it is next");
        assert_eq!(race.next(), (Way::Alone, false), "the last of the pause");
        assert_eq!(race.next(), (Way::Together, true), "the measurement");
        let mut race = Race::default();
        ways(&mut race, 2, |way| f32::from(u8::from(way == Way::Alone)));
        assert!(!race.skips(1), "rays together are faster");
    }

    #[test]
    fn a_change_is_noticed() {
        let mut race = Race::default();
        ways(&mut race, 300, |way| f32::from(u8::from(way == Way::Alone)));
        let (ways, measured) = ways(&mut race, 1000, |way| {
            f32::from(u8::from(way == Way::Together))
        });
        assert!(measured[2] - measured[1] < 20, "checked soon after");
        assert_eq!(ways[999], Way::Alone);
    }
}
