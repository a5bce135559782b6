//! Many rays: neighbours that are alike as tiles, others in turn.

use std::ops::Range;

use kd_core::{Hit, Ray};

use super::WideTree;
use super::queue;
use super::tile::{RAYS, Tiles};
use super::walk::{WideRay, walk};
use crate::collect::{Any, Closest, Collect};
use crate::lanes::Simd;

/// Fewer rays take longer as a tile than one by one.
const FEWEST: usize = 16;

/// Fewer rays take as long in turn as one by one, or longer: at the end there are few on their way.
const FEWEST_IN_TURN: usize = 64;

/// The closest hit of each ray.
#[inline(always)]
pub(crate) fn closest<S: Simd, R: WideRay>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    hits: &mut [Option<Hit>],
    prepare: impl Fn(&Ray) -> Option<R>,
) {
    let mut tiles = Tiles::new(simd, tree, &prepare);
    let mut others = Others::default();
    for (rays, hits) in rays.chunks(RAYS).zip(hits.chunks_mut(RAYS)) {
        if rays.len() >= FEWEST && tiles.gather(rays) {
            tiles.closest(rays, hits);
            others.skip(rays.len());
        } else {
            others.add(rays.len());
        }
    }
    others.trace(tree, rays, &prepare, |number, closest: Closest| {
        hits[number] = closest.0;
    });
}

/// Whether each ray hits anything.
#[inline(always)]
pub(crate) fn any<S: Simd, R: WideRay>(
    simd: S,
    tree: &WideTree,
    rays: &[Ray],
    occluded: &mut [bool],
    prepare: impl Fn(&Ray) -> Option<R>,
) {
    let mut tiles = Tiles::new(simd, tree, &prepare);
    let mut others = Others::default();
    for (rays, occluded) in rays.chunks(RAYS).zip(occluded.chunks_mut(RAYS)) {
        if rays.len() >= FEWEST && tiles.gather(rays) {
            tiles.any(rays, occluded);
            others.skip(rays.len());
        } else {
            others.add(rays.len());
        }
    }
    others.trace(tree, rays, &prepare, |number, any: Any| {
        occluded[number] = any.0;
    });
}

/// The rays that are not in tiles.
#[derive(Default)]
struct Others {
    /// Their numbers: ranges in order.
    numbers: Vec<Range<usize>>,
    /// How many there are.
    count: usize,
    /// The first ray that has not been looked at.
    next: usize,
}

impl Others {
    /// The next rays are in a tile.
    #[inline(always)]
    fn skip(&mut self, rays: usize) {
        self.next += rays;
    }

    /// The next rays are not.
    #[inline(always)]
    fn add(&mut self, rays: usize) {
        let end = self.next + rays;
        match self.numbers.last_mut() {
            Some(range) if range.end == self.next => range.end = end,
            _ => self.numbers.push(self.next..end),
        }
        self.count += rays;
        self.next = end;
    }

    /// Traces them, each with a collector of its own, which `take` gets.
    #[inline(always)]
    fn trace<R: WideRay, C: Collect + Default>(
        self,
        tree: &WideTree,
        rays: &[Ray],
        prepare: impl Fn(&Ray) -> Option<R>,
        mut take: impl FnMut(usize, C),
    ) {
        let numbers = self.numbers.into_iter().flatten();
        if self.count >= FEWEST_IN_TURN {
            queue::trace(tree, rays, numbers, prepare, take);
            return;
        }
        for number in numbers {
            let mut collector = C::default();
            if let Some(ray) = prepare(&rays[number]) {
                walk(tree, &ray, &mut collector, &mut ());
            }
            take(number, collector);
        }
    }
}
