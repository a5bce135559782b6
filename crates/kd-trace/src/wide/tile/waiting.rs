//! What is decided in the end: for each ray, the triangle that it hits first as far as f32 can tell.

use kd_core::Hit;
use kd_simd::{LANES, Simd, Task};
use kd_wide::Block;

use super::{NOTHING, Tile};
use crate::collect::keep_first;
use crate::wide::decide::{Place, decide};

/// Rays whose first triangle is to be decided.
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
            // Where there is nothing, another triangle stands in, whose answer is not taken.
            let [a, b, c, d, e, f, g, h] = *numbers;
            let places = [
                Place::or_any(blocks, a),
                Place::or_any(blocks, b),
                Place::or_any(blocks, c),
                Place::or_any(blocks, d),
                Place::or_any(blocks, e),
                Place::or_any(blocks, f),
                Place::or_any(blocks, g),
                Place::or_any(blocks, h),
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
