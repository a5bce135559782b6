//! Filters: hits that the caller decides about, in order.

use kd_core::Ray;

use crate::each_hit::EachHit;
use crate::hit_lists::HitLists;
use crate::ray_query::RayQuery;

/// What a filter says of a hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// It counts.
    Accept,
    /// It does not count, and the ray goes on: through the hole of a cutout texture, for example.
    Reject,
    /// It does not count, and the ray ends here: nothing behind it counts either.
    Stop,
}

/// The first hit that the filter accepts.
pub(crate) fn first<H>(
    hits: impl Iterator<Item = H>,
    mut filter: impl FnMut(&H) -> Verdict,
) -> Option<H> {
    for hit in hits {
        match filter(&hit) {
            Verdict::Accept => return Some(hit),
            Verdict::Reject => {}
            Verdict::Stop => return None,
        }
    }
    None
}

/// The first hit that the filter accepts, from the closest one on.
#[inline]
pub(crate) fn first_from<Q: RayQuery>(
    query: &Q,
    ray: &Ray,
    closest: Q::Hit,
    mut filter: impl FnMut(&Q::Hit) -> Verdict,
) -> Option<Q::Hit> {
    match filter(&closest) {
        Verdict::Accept => Some(closest),
        Verdict::Stop => None,
        Verdict::Reject => first(EachHit::behind(query, ray, closest), filter),
    }
}

/// The first `max` hits that the filter accepts. Clears `out` first.
pub(crate) fn collect<Q: RayQuery>(
    query: &Q,
    ray: &Ray,
    max: usize,
    out: &mut Vec<Q::Hit>,
    mut filter: impl FnMut(&Q::Hit) -> Verdict,
) {
    out.clear();
    if max == 0 {
        return;
    }
    for hit in EachHit::new(query, ray, max) {
        match filter(&hit) {
            Verdict::Accept => out.push(hit),
            Verdict::Reject => {}
            Verdict::Stop => return,
        }
        if out.len() == max {
            return;
        }
    }
}

/// Replaces the closest hit of each ray by the first that the filter accepts. `start` is the number of the first ray.
pub(crate) fn first_of_each<Q: RayQuery>(
    query: &Q,
    rays: &[Ray],
    start: usize,
    closest: &mut [Option<Q::Hit>],
    mut filter: impl FnMut(usize, &Q::Hit) -> Verdict,
) {
    for (number, (ray, closest)) in (start..).zip(rays.iter().zip(closest)) {
        if let Some(hit) = *closest {
            *closest = first_from(query, ray, hit, |hit| filter(number, hit));
        }
    }
}

/// Whether the filter accepts any hit of each ray. `start` is the number of the first ray.
pub(crate) fn any_of_each<Q: RayQuery>(
    query: &Q,
    rays: &[Ray],
    start: usize,
    occluded: &mut [bool],
    mut filter: impl FnMut(usize, &Q::Hit) -> Verdict,
) {
    /// Bounds the memory for closest hits, a multiple of what a batch sorts together.
    const CHUNK: usize = 1 << 14;
    let mut closest = vec![None; rays.len().min(CHUNK)];
    let starts = (start..).step_by(CHUNK);
    for ((rays, occluded), start) in rays
        .chunks(CHUNK)
        .zip(occluded.chunks_mut(CHUNK))
        .zip(starts)
    {
        let closest = &mut closest[..rays.len()];
        query.intersect_batch(rays, closest);
        first_of_each(query, rays, start, closest, &mut filter);
        for (occluded, hit) in occluded.iter_mut().zip(closest) {
            *occluded = hit.is_some();
        }
    }
}

/// The first `max` hits of each ray that the filter accepts. `start` is the number of the first ray.
pub(crate) fn lists<Q: RayQuery>(
    query: &Q,
    rays: &[Ray],
    start: usize,
    max: usize,
    mut filter: impl FnMut(usize, &Q::Hit) -> Verdict,
) -> HitLists<Q::Hit> {
    let mut lists = HitLists::with_room_for(rays.len());
    let mut hits = Vec::new();
    for (number, ray) in (start..).zip(rays) {
        collect(query, ray, max, &mut hits, |hit| filter(number, hit));
        lists.push(&hits);
    }
    lists
}
