//! Many rays: neighbours that are alike as tiles, others one by one.

use kd_core::{Hit, Ray};

use super::WideTree;
use super::tile::{RAYS, Tiles};
use super::walk::{WideRay, walk};
use crate::collect::{Any, Closest, Collect};
use crate::lanes::Simd;

/// Fewer rays take longer as a tile than one by one.
const FEWEST: usize = 16;

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
    for (rays, hits) in rays.chunks(RAYS).zip(hits.chunks_mut(RAYS)) {
        if rays.len() >= FEWEST && tiles.gather(rays) {
            tiles.closest(rays, hits);
        } else {
            one_by_one(tree, rays, &prepare, |number, closest: Closest| {
                hits[number] = closest.0;
            });
        }
    }
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
    for (rays, occluded) in rays.chunks(RAYS).zip(occluded.chunks_mut(RAYS)) {
        if rays.len() >= FEWEST && tiles.gather(rays) {
            tiles.any(rays, occluded);
        } else {
            one_by_one(tree, rays, &prepare, |number, any: Any| {
                occluded[number] = any.0;
            });
        }
    }
}

/// One ray after the other, each with a collector of its own, which `take` gets.
#[inline(always)]
fn one_by_one<R: WideRay, C: Collect + Default>(
    tree: &WideTree,
    rays: &[Ray],
    prepare: impl Fn(&Ray) -> Option<R>,
    mut take: impl FnMut(usize, C),
) {
    for (number, ray) in rays.iter().enumerate() {
        let mut collector = C::default();
        if let Some(ray) = prepare(ray) {
            walk(tree, &ray, &mut collector, &mut ());
        }
        take(number, collector);
    }
}
