//! Rays that are no neighbours of such as are alike, but may be alike with others.
//!
//! What something curved mirrors goes on all ways, and so does light to what is seen there. But of many such rays there are
//! some that go much the same way: they are [sorted](super::sorter), and traced as [tiles](super::tile).
//!
//! That does not always pay. Rays that are scattered by chance go the same way from everywhere, and meet other boxes each; a
//! tile of them takes longer than they would alone. So there are two checks: rays are only sorted where neighbours are alike
//! more often than by chance, and it is looked at what tiles take.

use kd_core::Ray;

use super::batch::{FEWEST, Query};
use super::sorter::{Sorter, are_alike};
use super::tile::{RAYS, Tiles};
use crate::dispatch::TraceSimd;
use crate::probe::Probe;

/// Fewer rays are not looked at.
const FEWEST_SORTED: usize = 2 * RAYS;

/// So many rays tell what others take alone.
const SAMPLES: usize = 8;

/// So many pairs tell whether rays are scattered by chance: more than one in eleven is alike only where they are not.
const PAIRS: usize = 64;
const FEWEST_ALIKE: usize = 6;

/// Rays of the same batch, some of them at a time.
#[derive(Default)]
pub(super) struct Scattered {
    sorter: Option<Box<Sorter>>,
    trust: Trust,
    is_done: Vec<bool>,
    alike: Vec<Ray>,
}

impl Scattered {
    /// Traces those rays as tiles that are alike, if that pays, and takes them out of the numbers. `alone` traces a ray.
    #[inline(always)]
    pub(super) fn trace<S: TraceSimd, Q: Query>(
        &mut self,
        tiles: &mut Tiles<'_, S>,
        rays: &[Ray],
        numbers: &mut Vec<u32>,
        answers: &mut [Q::Answer],
        alone: impl Fn(&Ray, &mut Steps) -> Q::Answer,
    ) {
        if numbers.len() < FEWEST_SORTED || are_by_chance(rays, numbers) {
            return;
        }
        self.is_done.clear();
        self.is_done.resize(rays.len(), false);
        for number in numbers.iter().step_by(numbers.len().div_ceil(SAMPLES)) {
            let number = *number as usize;
            let mut steps = Steps::default();
            answers[number] = alone(&rays[number], &mut steps);
            self.is_done[number] = true;
            self.trust.learn_alone(&steps);
        }
        numbers.retain(|number| !self.is_done[*number as usize]);
        let sorter = self.sorter.get_or_insert_with(Box::default);
        let mut found = [Q::Answer::default(); RAYS];
        for run in sorter.runs(rays, numbers, RAYS) {
            if run.len() < FEWEST || !self.trust.has(run.len()) {
                continue;
            }
            self.alike.clear();
            self.alike
                .extend(run.iter().map(|number| rays[*number as usize]));
            if !tiles.gather_sorted(&self.alike) {
                continue;
            }
            let found = &mut found[..run.len()];
            Q::trace(tiles, &self.alike, found);
            self.trust.learn(run.len(), tiles.effort());
            for (number, answer) in run.iter().zip(found) {
                answers[*number as usize] = *answer;
                self.is_done[*number as usize] = true;
            }
        }
        numbers.retain(|number| !self.is_done[*number as usize]);
    }
}

/// Whether neighbours are not alike more often than if each went its way by chance.
#[inline(always)]
fn are_by_chance(rays: &[Ray], numbers: &[u32]) -> bool {
    // The next but one, since two kinds of rays may alternate.
    let pairs = numbers.as_chunks::<3>().0;
    let looked_at = pairs.iter().step_by(pairs.len().div_ceil(PAIRS));
    let count = looked_at.len();
    let alike = looked_at.filter(|[a, _, b]| are_alike(&rays[*a as usize], &rays[*b as usize]));
    alike.count() * PAIRS < FEWEST_ALIKE * count
}

/// What a ray takes alone: nodes and leaves.
#[derive(Default)]
pub(super) struct Steps(u32);

impl Probe for Steps {
    fn node(&mut self) {
        self.0 += 1;
    }

    fn leaf(&mut self, _triangles: u32) {
        self.0 += 1;
    }
}

/// Whether tiles pay, from how the last ones went.
#[derive(Default)]
struct Trust {
    /// Steps that rays took alone, and how many rays.
    steps: f32,
    rays: f32,
    /// How much less tiles took than they might, as [`effort`](Tiles::effort); while that is below zero there are no tiles.
    saved: f32,
}

/// What a tile may take for each step that its rays would take alone. (From 0.3 to 0.5 it was about as fast behind the mirrors
/// of BART kitchen; throw-away program, 2026-11-28.)
const EFFORT_OF_STEP: f32 = 0.4;
/// And less for each ray, which takes so much before its first box.
const EFFORT_OF_RAY: f32 = 0.3;
/// What is forgotten for each ray that is not in a tile.
const FORGOTTEN: f32 = 0.3;
/// No more is saved up for tiles that take more than they may.
const MOST_SAVED: f32 = 256.0;

impl Trust {
    /// Whether so many rays are to be traced as a tile.
    fn has(&mut self, rays: usize) -> bool {
        if self.saved >= 0.0 {
            return true;
        }
        self.saved += FORGOTTEN * rays as f32;
        false
    }

    fn learn_alone(&mut self, steps: &Steps) {
        self.steps += steps.0 as f32;
        self.rays += 1.0;
    }

    /// What a tile took. Some ray has been traced alone before.
    fn learn(&mut self, rays: usize, effort: u32) {
        let may_take = EFFORT_OF_STEP * self.steps / self.rays - EFFORT_OF_RAY;
        let saved = self.saved + may_take * rays as f32 - effort as f32;
        self.saved = saved.min(MOST_SAVED);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Rays in a row, each turned from the one before by an angle.
    fn turned(by: impl Fn(u16) -> f32) -> Vec<Ray> {
        let direction = |i: u16| Vec3::new(by(i).cos(), by(i).sin(), 0.1);
        (0..600)
            .map(|i| Ray::new(Vec3::ZERO, direction(i)))
            .collect()
    }

    #[test]
    fn chance_is_told_from_mirrors() {
        let numbers: Vec<u32> = (0..600).collect();
        let ball = turned(|i| 0.05 * f32::from(i));
        assert!(!are_by_chance(&ball, &numbers), "round a ball");
        let two = turned(|i| 0.05 * f32::from(i) + f32::from(i % 2) * 2.0);
        assert!(!are_by_chance(&two, &numbers), "two kinds in turn");
        // On all sides, or on those of a half: a sequence that is spread evenly.
        for half in [false, true] {
            let all = |i: u16| {
                let part = |step: f32| (f32::from(i) * step).fract();
                let z = if half {
                    part(0.755)
                } else {
                    2.0 * part(0.755) - 1.0
                };
                let around = std::f32::consts::TAU * part(0.57);
                let radius = (1.0 - z * z).sqrt();
                Ray::new(
                    Vec3::ZERO,
                    Vec3::new(radius * around.cos(), radius * around.sin(), z),
                )
            };
            let rays: Vec<Ray> = (0..600).map(all).collect();
            assert!(are_by_chance(&rays, &numbers), "by chance, half: {half}");
        }
    }

    #[test]
    fn tiles_that_do_not_pay_are_given_up_for_a_while() {
        let mut trust = Trust::default();
        trust.learn_alone(&Steps(10));
        assert!(trust.has(64), "the first one");
        trust.learn(64, 100);
        assert!(trust.has(64), "it took less than the rays would have alone");
        for _ in 0..4 {
            trust.learn(64, 500);
        }
        let skipped = (0..1000).take_while(|_| !trust.has(64)).count();
        assert!((1..1000).contains(&skipped), "{skipped}");
    }
}
