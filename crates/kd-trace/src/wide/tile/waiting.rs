//! The decisions at the end of a tile: for each ray, the triangle that it hits first according to f32.

use kd_core::Hit;
use kd_simd::{LANES, Simd, Task};
use kd_wide::Block;

use super::{NOTHING, Tile};
use crate::collect::keep_first;
use crate::wide::eight::{BlockLane, decide};

/// Rays whose first triangle is undecided.
pub(super) struct Waiting<'a> {
    pub(super) blocks: &'a [Block],
    pub(super) tile: &'a Tile,
    pub(super) hits: &'a mut [Option<Hit>],
}

impl<S: Simd> Task<S> for Waiting<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: S) {
        let blocks = self.blocks;
        let hits = self.hits.chunks_mut(LANES);
        for (group, (numbers, hits)) in self.tile.place.iter().zip(hits).enumerate() {
            if *numbers == [NOTHING; LANES] {
                continue;
            }
            // A ray without a triangle gets any triangle, and its answer is dropped.
            let [a, b, c, d, e, f, g, h] = *numbers;
            let places = [
                BlockLane::or_any(blocks, a),
                BlockLane::or_any(blocks, b),
                BlockLane::or_any(blocks, c),
                BlockLane::or_any(blocks, d),
                BlockLane::or_any(blocks, e),
                BlockLane::or_any(blocks, f),
                BlockLane::or_any(blocks, g),
                BlockLane::or_any(blocks, h),
            ];
            let decided = decide(simd, &self.tile.turned_group(group), places);
            for (lane, best) in hits.iter_mut().enumerate() {
                if numbers[lane] == NOTHING || decided.is_hit >> lane & 1 == 0 {
                    continue;
                }
                keep_first(best, decided.hit(lane, places[lane].triangle()));
            }
        }
    }
}
