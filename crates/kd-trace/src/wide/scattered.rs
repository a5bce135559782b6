//! Coherent rays that are not neighbors.
//!
//! Rays that a curved mirror reflects go in all directions, and so do shadow rays from the points that they hit. Among many such
//! rays some are coherent: they are [sorted](super::sorter) and traced as [tiles](super::tile).
//!
//! That does not always pay. Rays that are scattered at random have similar directions but distant origins, and meet different
//! boxes: a tile of them takes longer than single rays. So two checks apply: rays are sorted only where neighbors are coherent
//! more often than by chance, and tiles are used only while they cost less than single rays.

use kd_core::Ray;

use super::batch::{FEWEST, Query};
use super::sorter::{Sorter, are_alike};
use super::tile::{RAYS, Tiles};
use crate::dispatch::TraceSimd;
use crate::probe::Probe;

/// The fewest rays that are sorted.
const FEWEST_SORTED: usize = 2 * RAYS;

/// Rays that are traced alone to measure the steps of single rays.
const SAMPLES: usize = 8;

/// Pairs of rays that are compared, and the fewest coherent ones, more than one in eleven, in rays that are not random.
const PAIRS: usize = 64;
const FEWEST_ALIKE: usize = 6;

/// The rays of one batch that are in no tile of neighbors, window by window.
#[derive(Default)]
pub(super) struct Scattered {
    sorter: Option<Box<Sorter>>,
    trust: Trust,
    is_done: Vec<bool>,
    alike: Vec<Ray>,
}

impl Scattered {
    /// Traces coherent rays as tiles while that pays, and removes them from `numbers`. `alone` traces one ray.
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

/// Whether neighbors are coherent no more often than random rays.
#[inline(always)]
fn are_by_chance(rays: &[Ray], numbers: &[u32]) -> bool {
    // Each ray and the next but one, since two kinds of rays may alternate.
    let pairs = numbers.as_chunks::<3>().0;
    let looked_at = pairs.iter().step_by(pairs.len().div_ceil(PAIRS));
    let count = looked_at.len();
    let alike = looked_at.filter(|[a, _, b]| are_alike(&rays[*a as usize], &rays[*b as usize]));
    alike.count() * PAIRS < FEWEST_ALIKE * count
}

/// The steps of a single ray: nodes and leaves.
#[derive(Default)]
pub(super) struct Steps(u32);

impl Probe for Steps {
    fn node(&mut self) {
        self.0 += 1;
    }

    fn leaf(&mut self, _triangles: impl FnOnce() -> u32) {
        self.0 += 1;
    }
}

/// Whether tiles pay, by the costs of the last tiles.
#[derive(Default)]
struct Trust {
    /// Steps of single rays, and the number of these rays.
    steps: f32,
    rays: f32,
    /// The budget left after the [`effort`](Tiles::effort) of all tiles. No tile is traced while it is below zero.
    saved: f32,
}

/// The effort that a tile may take per step of its rays alone. (From 0.3 to 0.5 it was about as fast behind the mirrors
/// of BART kitchen; throw-away program, 2026-11-28.)
const EFFORT_OF_STEP: f32 = 0.4;
/// Subtracted for each ray: its effort before its first box.
const EFFORT_OF_RAY: f32 = 0.3;
/// Added to the budget for each ray that is in no tile.
const FORGOTTEN: f32 = 0.3;
/// Upper limit of the budget.
const MOST_SAVED: f32 = 256.0;

impl Trust {
    /// Whether to trace this number of rays as a tile.
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

    /// Records the effort of a tile, after [`learn_alone`](Self::learn_alone).
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

    /// Rays at the given angles.
    fn turned(by: impl Fn(u16) -> f32) -> Vec<Ray> {
        let direction = |i: u16| Vec3::new(by(i).cos(), by(i).sin(), 0.1);
        (0..600)
            .map(|i| Ray::new(Vec3::ZERO, direction(i)))
            .collect()
    }

    #[test]
    fn random_rays_are_distinguished_from_mirrored_ones() {
        let numbers: Vec<u32> = (0..600).collect();
        let ball = turned(|i| 0.05 * f32::from(i));
        assert!(!are_by_chance(&ball, &numbers), "round a ball");
        let two = turned(|i| 0.05 * f32::from(i) + f32::from(i % 2) * 2.0);
        assert!(!are_by_chance(&two, &numbers), "two kinds in turn");
        // A low-discrepancy sequence of directions, over the sphere or a hemisphere.
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
