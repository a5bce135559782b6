//! Which of two ways to trace groups of rays is faster, by measuring both on the way.
//!
//! Rays that traverse together share work, or hide latencies of each other. How much that gains depends on the rays, the tree and
//! the caches; where it gains nothing, rays are faster alone. A batch measures this: the answers are the same.
//!
//! Neighboring groups resemble each other, distant ones do not. So a group is traced together if the last one that was took less
//! than the last one that was not. After a failure, groups are traced alone: one, then twice as many after each further failure.

/// A way to trace a group of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Way {
    #[default]
    Together,
    Alone,
}

/// Rays together against rays alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Race {
    /// The time of a ray of the last group that was traced alone and measured, in nanoseconds.
    alone: f32,
    /// Groups to trace alone before the next one together.
    wait: u32,
    /// Groups that were traced alone after the last failure.
    last_wait: u32,
    /// Groups to trace together before the next one alone, unless one fails.
    trust: u32,
    /// The groups of the last trust.
    last_trust: u32,
}

/// Groups alone after repeated failures, at most.
const MOST_WAIT: u32 = 64;
/// Groups together after the first comparison, and at most.
const TRUST: u32 = 64;
const MOST_TRUST: u32 = 256;
/// Rays together must be faster by this factor: otherwise little is gained, and a wrong choice costs more.
const MARGIN: f32 = 1.05;

impl Default for Race {
    fn default() -> Self {
        Self {
            alone: f32::INFINITY,
            wait: 0,
            last_wait: 0,
            trust: 1,
            last_trust: TRUST / 2,
        }
    }
}

impl Race {
    /// How to trace the next group. [`learn`](Self::learn) must follow.
    #[inline]
    pub(super) fn next(&self) -> Way {
        if self.wait > 0 {
            Way::Alone
        } else {
            Way::Together
        }
    }

    /// Whether this number of groups is traced alone, with at least one more. Counts them as traced then.
    #[inline]
    pub(super) fn skips(&mut self, count: u32) -> bool {
        let skips = self.wait > count;
        if skips {
            self.wait -= count;
        }
        skips
    }

    /// Records the time of a ray of a group.
    pub(super) fn learn(&mut self, way: Way, time: f32) {
        match way {
            Way::Alone => {
                self.alone = time;
                self.wait -= 1;
            }
            Way::Together if time * MARGIN > self.alone => {
                self.last_wait = MOST_WAIT.min(1.max(2 * self.last_wait));
                self.wait = self.last_wait;
            }
            Way::Together => {
                self.last_wait = 0;
                self.trust -= 1;
                if self.trust == 0 {
                    self.wait = 1;
                    self.last_trust = MOST_TRUST.min(2 * self.last_trust);
                    self.trust = self.last_trust;
                }
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

    /// The numbers of the groups, of a thousand, that are traced in a way. `time` is that of a group, together and alone.
    fn traced(way: Way, time: impl Fn(usize) -> [f32; 2]) -> Vec<usize> {
        let mut race = Race::default();
        let groups = (0..1000).filter(|group| {
            let next = race.next();
            let [together, alone] = time(*group);
            race.learn(
                next,
                if next == Way::Together {
                    together
                } else {
                    alone
                },
            );
            next == way
        });
        groups.collect()
    }

    #[test]
    fn groups_that_are_slower_together_are_tried_ever_more_seldom() {
        let together = traced(Way::Together, |_| [2.0, 1.0]);
        assert_eq!(together[..8], [0, 2, 4, 7, 12, 21, 38, 71]);
        assert!(together.len() < 25, "{together:?}");
    }

    #[test]
    fn groups_that_are_slower_alone_are_seldom_traced_so() {
        let alone = traced(Way::Alone, |_| [1.0, 2.0]);
        assert_eq!(alone, [1, 66, 195, 452, 709, 966]);
    }

    #[test]
    fn each_part_of_the_rays_is_traced_in_its_faster_way() {
        let is_coherent = |group: usize| group % 200 < 100;
        let time = |group| {
            if is_coherent(group) {
                [1.0, 9.0]
            } else {
                [40.0, 20.0]
            }
        };
        let together = traced(Way::Together, time);
        let right = together.iter().filter(|group| is_coherent(**group)).count();
        assert!(right > 300, "{right} of 500 coherent groups");
        assert!(
            together.len() - right < 50,
            "{} others",
            together.len() - right
        );
    }

    #[test]
    fn one_interrupted_group_changes_little() {
        let together = traced(Way::Together, |group| {
            [if group == 40 { 99.0 } else { 1.0 }, 2.0]
        });
        assert!(together.len() > 985, "{}", together.len());
    }

    #[test]
    fn groups_are_skipped_while_others_follow() {
        let mut race = Race::default();
        assert!(!race.skips(1), "the first is traced together");
        for way in [
            Way::Together,
            Way::Alone,
            Way::Together,
            Way::Alone,
            Way::Together,
        ] {
            assert_eq!(race.next(), way);
            race.learn(way, if way == Way::Together { 2.0 } else { 1.0 });
        }
        assert_eq!(race.wait, 2);
        assert!(!race.skips(2), "the last one is measured");
        assert!(race.skips(1));
        assert!(!race.skips(1), "the last one");
    }
}
