//! Coherent rays that are not neighbors.
//!
//! Rays that a curved mirror reflects go in all directions, and so do shadow rays from the points that they hit. Among many such
//! rays some are coherent: they are [sorted](super::sorter) and traced as [tiles](super::tile).
//!
//! That does not always pay. Rays that are scattered at random have similar directions but distant origins, and meet different
//! boxes: a tile of them takes longer than single rays. So two checks apply: rays are sorted only where neighbors are coherent
//! more often than by chance, and tiles are used only while they are [faster](super::race) than single rays.

use kd_core::Ray;

use super::batch::{AS_TILES, Batch, FEWEST, Query};
use super::race::{Race, Stopwatch, Way};
use super::sorter::{Sorter, are_alike};
use super::tile::RAYS;
use crate::dispatch::TraceSimd;

/// The fewest rays that are sorted.
const FEWEST_SORTED: usize = 2 * RAYS;

/// Rays that are sorted to measure whether that pays.
const PROBE: usize = 1024;

/// Pairs of rays that are compared, and the fewest coherent ones, more than one in eleven, in rays that are not random.
const PAIRS: usize = 64;
const FEWEST_ALIKE: usize = 6;

/// Rays that are taken to be random after others that were. (The check takes 5 ns a ray in batches of 256 rays; throw-away
/// program, 2026-11-30.)
const LIKE_BEFORE: usize = 4096;

/// Traces the rays of batches that are in no tile of neighbors, window by window.
pub(super) struct Scattered {
    sorter: Option<Box<Sorter>>,
    race: Race,
    is_done: Vec<bool>,
    alike: Vec<Ray>,
    /// The next rays, this number of them, are taken to be random.
    random: usize,
}

/// Tiles until both ways are measured again. Rays are sorted for that, which takes as long as some of them alone.
const PAUSES: [u32; 2] = [128, 1024];

impl Scattered {
    pub(super) fn new() -> Self {
        Self {
            sorter: None,
            race: Race::new(AS_TILES, PAUSES),
            is_done: Vec::new(),
            alike: Vec::new(),
            random: 0,
        }
    }

    pub(super) fn race(&mut self) -> &mut Race {
        &mut self.race
    }

    /// Traces coherent rays as tiles while that pays, and removes them from `numbers`.
    #[inline(always)]
    pub(super) fn trace<S: TraceSimd, Q: Query>(
        &mut self,
        batch: &mut Batch<'_, S>,
        rays: &[Ray],
        numbers: &mut Vec<u32>,
        answers: &mut [Q::Answer],
    ) {
        if numbers.len() < FEWEST_SORTED {
            return;
        }
        if self.random >= numbers.len() {
            self.random -= numbers.len();
            return;
        }
        if are_by_chance(rays, numbers) {
            self.random = LIKE_BEFORE;
            return;
        }
        let groups = u32::try_from(numbers.len() / RAYS).expect("a window is small");
        if self.race.skips(groups) {
            return;
        }
        self.is_done.clear();
        self.is_done.resize(rays.len(), false);
        // Until it is known that tiles pay, a few rays are enough.
        let sorted = if self.race.measures() {
            numbers.len().min(PROBE)
        } else {
            numbers.len()
        };
        let sorter = self.sorter.get_or_insert_with(Box::default);
        let mut found = [Q::Answer::default(); RAYS];
        let clock = Stopwatch::start();
        let runs = sorter.runs(rays, &numbers[..sorted], RAYS);
        let sorting = clock.per_ray(sorted);
        for run in runs {
            if run.len() < FEWEST || self.race.skips(1) {
                continue;
            }
            let clock = self.race.measures().then(Stopwatch::start);
            self.alike.clear();
            self.alike
                .extend(run.iter().map(|number| rays[*number as usize]));
            if !batch.tiles.gather_sorted(&self.alike) {
                continue;
            }
            let found = &mut found[..run.len()];
            let way = self.race.next();
            // Rays alone need not be sorted and gathered.
            let (clock, before) = if way == Way::Alone {
                (clock.map(|_| Stopwatch::start()), 0.0)
            } else {
                (clock, sorting)
            };
            batch.trace_gathered::<Q>(way, &self.alike, found);
            if let Some(clock) = clock {
                self.race.learn(before + clock.per_ray(run.len()));
            }
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
}
