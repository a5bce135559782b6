//! The trial of a grid on a sample of rays, before the decision (step 2 of the paper).

/// Number of rays of a sample: the paper takes 100 to 1000.
pub const RAYS: usize = 512;
/// Number of consecutive rays that are timed together.
pub const RUN: usize = 8;
/// For at most this number of rays no trial is made: the grid is kept.
pub const HARDLY_ANY: u64 = 64;

/// Least number of runs, of which the first warms up: fewer would not represent the rays of a scene.
const FEWEST_RUNS: usize = 5;
/// After these runs, a trial ends once it has taken this share of the build time of the grid.
const MOST_OF_BUILD: f64 = 0.25;

/// The largest number of rays of a sample: an eighth of the rays to come.
pub fn most_rays(to_come: u64) -> u64 {
    (to_come / 8).min(RAYS as u64)
}

/// The result of a run of rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Number of rays.
    pub rays: usize,
    /// Number of rays that hit something.
    pub hits: usize,
    /// Their time in seconds; `None` without a clock.
    pub seconds: Option<f64>,
}

/// The result of a trial.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tried {
    /// Sums over all runs.
    rays: usize,
    hits: usize,
    seconds: f64,
    /// Sums over the runs after the first.
    warm_rays: usize,
    warm_seconds: f64,
}

impl Tried {
    /// Traces runs of a sample of `runs` runs, by calling `ask` with their indices, spread evenly over the sample. Ends after
    /// `most_rays` rays, or after a quarter of the build time of the grid, but not before one run, and not for its time before five
    /// runs.
    pub fn ask(
        runs: usize,
        most_rays: u64,
        build_seconds: f64,
        mut ask: impl FnMut(usize) -> Run,
    ) -> Self {
        let mut tried = Self::default();
        for (asked, place) in spread_evenly(runs).enumerate() {
            let is_late = asked >= FEWEST_RUNS && tried.seconds > MOST_OF_BUILD * build_seconds;
            let are_enough = asked > 0 && tried.rays as u64 >= most_rays;
            if is_late || are_enough {
                break;
            }
            let run = ask(place);
            let seconds = run.seconds.unwrap_or(0.0);
            tried.rays += run.rays;
            tried.hits += run.hits;
            tried.seconds += seconds;
            if asked > 0 {
                tried.warm_rays += run.rays;
                tried.warm_seconds += seconds;
            }
        }
        tried
    }

    /// The time of a ray in seconds, without the first run if others follow. `None` without rays or without a clock.
    pub fn ray_seconds(&self) -> Option<f64> {
        let (rays, seconds) = match self.warm_rays {
            0 => (self.rays, self.seconds),
            rays => (rays, self.warm_seconds),
        };
        (rays > 0 && seconds > 0.0).then(|| seconds / rays as f64)
    }

    /// The share of rays that hit something.
    pub fn hit_share(&self) -> f64 {
        self.hits as f64 / self.rays.max(1) as f64
    }

    /// The time of the trial in seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}

/// The numbers below `count`, in an order whose every prefix is spread evenly (J. G. van der Corput, *Verteilungsfunktionen*,
/// 1935).
fn spread_evenly(count: usize) -> impl Iterator<Item = usize> {
    let places = count.next_power_of_two();
    let shift = usize::BITS - places.trailing_zeros();
    (0..places)
        .map(move |number| number.reverse_bits().checked_shr(shift).unwrap_or(0))
        .filter(move |place| *place < count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_prefix_is_spread_evenly() {
        assert!(spread_evenly(8).eq([0, 4, 2, 6, 1, 5, 3, 7]), "by bits");
        assert!(spread_evenly(5).eq([0, 4, 2, 1, 3]), "those below 5");
        assert!(spread_evenly(1).eq([0]), "the only one");
        assert_eq!(spread_evenly(0).count(), 0, "of nothing, nothing");
        let mut all: Vec<usize> = spread_evenly(1000).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..1000), "each once");
    }

    /// The traced places and the result, if a run takes `seconds` seconds.
    fn tried(runs: usize, seconds: Option<f64>) -> (Vec<usize>, Tried) {
        let mut places = Vec::new();
        let tried = Tried::ask(runs, 400, 100.0, |place| {
            places.push(place);
            let cold = if places.len() == 1 { 10.0 } else { 1.0 };
            Run {
                rays: 8,
                hits: 2,
                seconds: seconds.map(|seconds| cold * seconds),
            }
        });
        (places, tried)
    }

    #[test]
    fn a_trial_ends_after_a_quarter_of_the_build_and_not_before_five_runs() {
        // Ten seconds for the first run, and one for each of sixteen others.
        let (places, some) = tried(64, Some(1.0));
        assert_eq!(places.len(), 17, "26 seconds are more than 25");
        assert_eq!(some.seconds(), 26.0, "all of them");
        assert_eq!(some.ray_seconds(), Some(0.125), "but for the first");
        assert_eq!(some.hit_share(), 0.25, "two of eight");
        let (places, slow) = tried(64, Some(1000.0));
        assert_eq!(places, [0, 32, 16, 48, 8], "five at least");
        assert_eq!(slow.ray_seconds(), Some(125.0), "of four");
        let (places, _) = tried(3, Some(1e-3));
        assert_eq!(places.len(), 3, "all runs");
    }

    #[test]
    fn a_trial_traces_at_most_an_eighth_of_the_rays_to_come() {
        let asked = |to_come: u64| {
            let run = Run {
                rays: RUN,
                hits: 0,
                seconds: None,
            };
            Tried::ask(1000, most_rays(to_come), 1.0, |_| run).rays
        };
        assert_eq!(asked(u64::MAX), RAYS, "enough");
        assert_eq!(asked(1280), 160, "an eighth");
        assert_eq!(asked(HARDLY_ANY + 1), RUN, "one run at least");
    }

    #[test]
    fn a_trial_without_a_clock_has_no_times() {
        let (places, timeless) = tried(64, None);
        assert_eq!(places.len(), 50, "no time is spent, but these are 400");
        assert_eq!(timeless.ray_seconds(), None, "no clock");
        assert_eq!(timeless.hit_share(), 0.25, "all the same");
        assert_eq!(tried(0, Some(1.0)).1.ray_seconds(), None, "no rays");
        assert_eq!(
            tried(1, Some(1.0)).1.ray_seconds(),
            Some(1.25),
            "a cold one"
        );
    }
}
