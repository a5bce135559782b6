//! Trying a grid on some of the rays, before it is decided (step 2 of the paper).

/// So many rays are enough: the paper takes 100 to 1000.
pub const RAYS: usize = 512;
/// Rays that are asked one after the other, and timed together.
pub const RUN: usize = 8;
/// With no more rays to come there is nothing to try a grid on: it is kept.
pub const HARDLY_ANY: u64 = 64;

/// So many runs are asked whatever they take, the first of which warms up: with fewer, most rays of a scene may be unlike those
/// that were asked.
const FEWEST_RUNS: usize = 5;
/// After these, a try ends when it has taken this part of what the grid took to build: it is to save time.
const MOST_OF_BUILD: f64 = 0.25;

/// The most rays of a sample where so many are to come: an eighth of them.
pub fn most_rays(to_come: u64) -> u64 {
    (to_come / 8).min(RAYS as u64)
}

/// What a run of rays told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// How many they are.
    pub rays: usize,
    /// How many of them hit.
    pub hits: usize,
    /// What they took, if there is a clock.
    pub seconds: Option<f64>,
}

/// What a sample told.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tried {
    /// Of all runs: rays, hits, seconds.
    rays: usize,
    hits: usize,
    seconds: f64,
    /// Of those after the first one, if there are any.
    warm_rays: usize,
    warm_seconds: f64,
}

impl Tried {
    /// Asks runs of a sample, told by their places among so many: from all over it, until they are so many rays, or a quarter of
    /// the time is spent that the grid took to build; but one run at least, and five whatever they take, if there are so many.
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

    /// What a ray takes, of those after the first run, if there are any. `None` without rays, or a clock.
    pub fn ray_seconds(&self) -> Option<f64> {
        let (rays, seconds) = match self.warm_rays {
            0 => (self.rays, self.seconds),
            rays => (rays, self.warm_seconds),
        };
        (rays > 0 && seconds > 0.0).then(|| seconds / rays as f64)
    }

    /// The part of all that hit.
    pub fn hit_share(&self) -> f64 {
        self.hits as f64 / self.rays.max(1) as f64
    }

    /// What it took.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}

/// The numbers below `count`, in an order in which the first ones, however many, are spread evenly over all (J. G. van der
/// Corput, *Verteilungsfunktionen*, 1935).
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
    fn the_first_ones_are_spread_over_all() {
        assert!(spread_evenly(8).eq([0, 4, 2, 6, 1, 5, 3, 7]), "by bits");
        assert!(spread_evenly(5).eq([0, 4, 2, 1, 3]), "as far as there are");
        assert!(spread_evenly(1).eq([0]), "the only one");
        assert_eq!(spread_evenly(0).count(), 0, "of nothing, nothing");
        let mut all: Vec<usize> = spread_evenly(1000).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..1000), "each once");
    }

    /// Places that were asked, and what they told, if a run takes so many seconds.
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
    fn a_try_ends_after_a_quarter_of_the_build_and_not_before_five_runs() {
        // Ten for the first one, and one for each of sixteen others.
        let (places, some) = tried(64, Some(1.0));
        assert_eq!(places.len(), 17, "26 seconds are more than 25");
        assert_eq!(some.seconds(), 26.0, "all of them");
        assert_eq!(some.ray_seconds(), Some(0.125), "but for the first");
        assert_eq!(some.hit_share(), 0.25, "two of eight");
        let (places, slow) = tried(64, Some(1000.0));
        assert_eq!(places, [0, 32, 16, 48, 8], "five at least");
        assert_eq!(slow.ray_seconds(), Some(125.0), "of four");
        let (places, _) = tried(3, Some(1e-3));
        assert_eq!(places.len(), 3, "all there are");
    }

    #[test]
    fn no_more_are_asked_than_an_eighth_of_what_is_to_come() {
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
    fn what_is_not_known_is_not_told() {
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
