//! The comparison of a ray's answers with brute force.

use std::cell::RefCell;

use kd_core::{Culling, Hit, Mesh, Ray, RayPacket8};
use kd_trace::{RayHit, RayQuery, Verdict, brute_force};

/// Compares queries of a ray with brute force, in each structure; for one ray in four every query, without culling and culling
/// either side. Returns the number of hits.
///
/// # Panics
///
/// If an answer is wrong. The message holds the ray as Rust source.
#[track_caller]
pub fn check(
    scene: &str,
    mesh: &Mesh,
    structures: &[&dyn RayQuery<Hit = Hit>],
    ray: &Ray,
) -> usize {
    let mut expected = Vec::new();
    brute_force::hits(mesh, ray, usize::MAX, &mut expected);
    // Queries that are made of others, and sides, take several times as long: one ray in four asks them.
    let is_asked_all = key_of(ray).is_multiple_of(4);
    let check_all = |ray: &Ray, expected: &[Hit]| {
        for (number, structure) in structures.iter().enumerate() {
            let name = format!("{scene}, structure {number}");
            check_required(&name, structure, ray, expected);
            if is_asked_all {
                check_made(&name, structure, ray, expected);
            }
        }
    };
    check_all(ray, &expected);
    if is_asked_all && ray.culling.is_none() && !expected.is_empty() {
        let (mut of_side, mut of_sides) = (Vec::new(), 0);
        for culling in [Culling::BACK, Culling::FRONT] {
            let ray = ray.with_culling(culling);
            brute_force::hits(mesh, &ray, usize::MAX, &mut of_side);
            check_all(&ray, &of_side);
            of_sides += of_side.len();
        }
        assert_eq!(
            of_sides,
            expected.len(),
            "{scene}: a hit is on one side: {}",
            source(ray)
        );
    }
    expected.len()
}

/// A number that is as good as random, the same for the same ray.
fn key_of(ray: &Ray) -> u32 {
    let numbers = [ray.origin, ray.direction].map(|v| v.to_array().map(f32::to_bits));
    let mix = |key: u32, bits: &u32| (key ^ bits).wrapping_mul(747_796_405).rotate_left(15);
    numbers.as_flattened().iter().fold(1, mix) >> 8
}

/// Compares every query of a ray with all its hits, in order.
///
/// # Panics
///
/// If an answer is wrong. The message holds the ray as Rust source.
#[track_caller]
pub fn check_ray<Q: RayQuery>(name: &str, structure: &Q, ray: &Ray, expected: &[Q::Hit]) {
    check_required(name, structure, ray, expected);
    check_made(name, structure, ray, expected);
}

/// The queries that a structure implements itself.
#[track_caller]
fn check_required<Q: RayQuery>(name: &str, structure: &Q, ray: &Ray, expected: &[Q::Hit]) {
    let place = |query: &str| format!("{name}, {query}: {}", source(ray));
    let closest = structure.intersect(ray);
    assert_eq!(closest, expected.first().copied(), "{}", place("intersect"));
    let occluded = structure.occluded(ray);
    assert_eq!(occluded, !expected.is_empty(), "{}", place("occluded"));
    let mut found = Vec::new();
    for max in [2, usize::MAX] {
        structure.hits(ray, max, &mut found);
        let first = &expected[..max.min(expected.len())];
        assert_eq!(found, first, "{}", place("hits"));
    }
}

/// The queries that are made of these.
#[track_caller]
fn check_made<Q: RayQuery>(name: &str, structure: &Q, ray: &Ray, expected: &[Q::Hit]) {
    let place = |query: &str| format!("{name}, {query}: {}", source(ray));
    let mut found = Vec::new();
    let count = structure.count_hits(ray);
    assert_eq!(count, expected.len(), "{}", place("count of hits"));
    // Behind the first hit and the last one.
    for (number, last) in expected
        .iter()
        .enumerate()
        .step_by(expected.len().max(2) - 1)
    {
        structure.hits_behind(ray, last, 3, &mut found);
        let rest = &expected[number + 1..];
        assert_eq!(found, rest[..rest.len().min(3)], "{}", place("hits behind"));
    }
    for salt in 0..3 {
        let filter = Filter::new(0, salt);
        let mut calls = Vec::new();
        let accepted = structure.intersect_filtered(ray, |hit| filter.call(hit, &mut calls));
        let [first, called] = filter.first(expected);
        assert_eq!(
            accepted.as_slice(),
            first,
            "{}",
            place("intersect with a filter")
        );
        assert_eq!(calls, called, "{}", place("calls of a filter"));
        calls.clear();
        let occluded = structure.occluded_filtered(ray, |hit| filter.call(hit, &mut calls));
        assert_eq!(
            occluded,
            accepted.is_some(),
            "{}",
            place("occluded with a filter")
        );
        assert_eq!(calls, called, "{}", place("calls of a filter for any hit"));
        calls.clear();
        structure.hits_filtered(ray, 2, &mut found, |hit| filter.call(hit, &mut calls));
        let (all, called) = filter.all(expected, 2);
        assert_eq!(found, all, "{}", place("hits with a filter"));
        assert_eq!(calls, called, "{}", place("calls of a filter for hits"));
    }
}

/// Compares every query of a batch with all hits of its rays, in order; on all threads, too.
///
/// # Panics
///
/// If an answer is wrong.
#[track_caller]
pub fn check_batch<Q: RayQuery + Sync>(
    name: &str,
    structure: &Q,
    rays: &[Ray],
    expected: &[Vec<Q::Hit>],
) {
    let place = |query: &str| format!("{name}, {query} of {} rays", rays.len());
    let closest: Vec<_> = expected.iter().map(|hits| hits.first().copied()).collect();
    let are_hit: Vec<bool> = closest.iter().map(Option::is_some).collect();
    let counts: Vec<usize> = expected.iter().map(Vec::len).collect();
    // Earlier contents must not stay.
    let other = closest.iter().flatten().next().copied();
    let mut hits = vec![other; rays.len()];
    let mut occluded = vec![true; rays.len()];
    let mut counted = vec![7; rays.len()];
    for is_parallel in [false, true] {
        hits.fill(other);
        occluded.fill(true);
        counted.fill(7);
        let lists = if is_parallel {
            structure.par_intersect_batch(rays, &mut hits);
            structure.par_occluded_batch(rays, &mut occluded);
            structure.par_count_hits_batch(rays, &mut counted);
            structure.par_hits_batch(rays, 3)
        } else {
            structure.intersect_batch(rays, &mut hits);
            structure.occluded_batch(rays, &mut occluded);
            structure.count_hits_batch(rays, &mut counted);
            structure.hits_batch(rays, 3)
        };
        assert_eq!(hits, closest, "{}", place("intersect"));
        assert_eq!(occluded, are_hit, "{}", place("occluded"));
        assert_eq!(counted, counts, "{}", place("counts"));
        let first = expected.iter().map(|hits| &hits[..hits.len().min(3)]);
        assert!(lists.iter().eq(first), "{}", place("hits"));
    }
    for (rays, closest) in rays.chunks(8).zip(closest.chunks(8)) {
        let packet = RayPacket8::new(rays);
        let (hits, occluded) = (structure.intersect8(&packet), structure.occluded8(&packet));
        for (lane, hit) in hits.into_iter().enumerate() {
            let closest = closest.get(lane).copied().flatten();
            assert_eq!(hit, closest, "{}, lane {lane}", place("packets"));
            assert_eq!(
                occluded[lane],
                hit.is_some(),
                "{}, lane {lane}",
                place("packets")
            );
        }
    }
    check_filtered_batch(structure, rays, expected, &place);
}

#[track_caller]
fn check_filtered_batch<Q: RayQuery + Sync>(
    structure: &Q,
    rays: &[Ray],
    expected: &[Vec<Q::Hit>],
    place: &dyn Fn(&str) -> String,
) {
    let (mut first, mut lists) = (Vec::new(), Vec::new());
    let (mut calls_of_first, mut calls_of_lists) = (Vec::new(), Vec::new());
    for (number, hits) in expected.iter().enumerate() {
        let filter = Filter::new(number, 0);
        let [accepted, called] = filter.first(hits);
        first.push(accepted.first().copied());
        calls_of_first.extend(called.iter().map(|hit| (number, *hit)));
        let (accepted, called) = filter.all(hits, 2);
        lists.push(accepted);
        calls_of_lists.extend(called.iter().map(|hit| (number, *hit)));
    }
    let are_hit: Vec<bool> = first.iter().map(Option::is_some).collect();
    let mut hits = vec![None; rays.len()];
    let mut occluded = vec![true; rays.len()];
    let calls = RefCell::new(Vec::new());
    let filter = |number: usize, hit: &Q::Hit| {
        calls.borrow_mut().push((number, *hit));
        Filter::new(number, 0).verdict(hit)
    };
    structure.intersect_filtered_batch(rays, &mut hits, filter);
    assert_eq!(hits, first, "{}", place("intersect with a filter"));
    assert_eq!(
        calls.take(),
        calls_of_first,
        "{}",
        place("calls of a filter")
    );
    structure.occluded_filtered_batch(rays, &mut occluded, filter);
    assert_eq!(occluded, are_hit, "{}", place("occluded with a filter"));
    assert_eq!(
        calls.take(),
        calls_of_first,
        "{}",
        place("calls of a filter for any hit")
    );
    let found = structure.hits_filtered_batch(rays, 2, filter);
    assert!(found.iter().eq(&lists), "{}", place("hits with a filter"));
    assert_eq!(
        calls.take(),
        calls_of_lists,
        "{}",
        place("calls of a filter for hits")
    );

    let filter = |number: usize, hit: &Q::Hit| Filter::new(number, 0).verdict(hit);
    hits.fill(None);
    occluded.fill(true);
    structure.par_intersect_filtered_batch(rays, &mut hits, filter);
    assert_eq!(
        hits,
        first,
        "{}",
        place("intersect with a filter on all threads")
    );
    structure.par_occluded_filtered_batch(rays, &mut occluded, filter);
    assert_eq!(
        occluded,
        are_hit,
        "{}",
        place("occluded with a filter on all threads")
    );
    let found = structure.par_hits_filtered_batch(rays, 2, filter);
    assert!(
        found.iter().eq(&lists),
        "{}",
        place("hits with a filter on all threads")
    );
}

/// A filter that rejects most hits.
#[derive(Clone, Copy)]
struct Filter {
    key: u32,
}

impl Filter {
    /// Of a ray.
    fn new(ray: usize, salt: u32) -> Self {
        let ray = u32::try_from(ray).expect("few");
        Self {
            key: ray.wrapping_mul(747_796_405).wrapping_add(salt),
        }
    }

    fn verdict<H: RayHit>(self, hit: &H) -> Verdict {
        // Hits at one distance have different verdicts.
        let place = hit.t().to_bits() ^ hit.triangle().wrapping_mul(2_654_435_769);
        match (place.wrapping_add(self.key).wrapping_mul(2_246_822_519) >> 16) % 8 {
            0 | 1 => Verdict::Accept,
            2 => Verdict::Stop,
            _ => Verdict::Reject,
        }
    }

    fn call<H: RayHit>(self, hit: &H, calls: &mut Vec<H>) -> Verdict {
        calls.push(*hit);
        self.verdict(hit)
    }

    /// Of all hits in order, the first that is accepted, if one is, and those that the filter is called for.
    fn first<H: RayHit>(self, hits: &[H]) -> [&[H]; 2] {
        let end = hits
            .iter()
            .position(|hit| self.verdict(hit) != Verdict::Reject);
        let Some(end) = end else {
            return [&[], hits];
        };
        let is_accepted = self.verdict(&hits[end]) == Verdict::Accept;
        let accepted = if is_accepted { &hits[end..=end] } else { &[] };
        [accepted, &hits[..=end]]
    }

    /// Of all hits in order, the first `max` that are accepted, and those that the filter is called for.
    fn all<H: RayHit>(self, hits: &[H], max: usize) -> (Vec<H>, &[H]) {
        let mut accepted = Vec::new();
        for (number, hit) in hits.iter().enumerate() {
            let verdict = self.verdict(hit);
            if verdict == Verdict::Accept {
                accepted.push(*hit);
            }
            if verdict == Verdict::Stop || accepted.len() == max {
                return (accepted, &hits[..=number]);
            }
        }
        (accepted, hits)
    }
}

/// The ray as Rust source, to paste into a test.
pub fn source(ray: &Ray) -> String {
    let number = |x: f32| {
        if x.is_finite() {
            format!("{x:?}")
        } else {
            format!("f32::from_bits({:#x})", x.to_bits())
        }
    };
    let list = |v: glam::Vec3| v.to_array().map(number).join(", ");
    let culling = if ray.culling.is_none() {
        String::new()
    } else {
        format!(".with_culling({:?})", ray.culling)
    };
    format!(
        "Ray::new([{}], [{}]).with_range({}, {}){culling}",
        list(ray.origin),
        list(ray.direction),
        number(ray.t_min),
        number(ray.t_max)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Brute force with a flaw.
    struct Wrong<'a> {
        mesh: &'a Mesh,
        flaw: Flaw,
    }

    #[derive(Clone, Copy, PartialEq)]
    enum Flaw {
        None,
        Intersect,
        Occluded,
        Hits,
    }

    impl RayQuery for Wrong<'_> {
        type Hit = Hit;

        fn intersect(&self, ray: &Ray) -> Option<Hit> {
            let hit = brute_force::intersect(self.mesh, ray);
            hit.filter(|_| self.flaw != Flaw::Intersect)
        }

        fn occluded(&self, ray: &Ray) -> bool {
            brute_force::occluded(self.mesh, ray) && self.flaw != Flaw::Occluded
        }

        fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
            let max = max - usize::from(self.flaw == Flaw::Hits);
            brute_force::hits(self.mesh, ray, max, out);
        }
    }

    #[test]
    fn wrong_answers_are_noticed() {
        let mesh = crate::scenes::sphere(1);
        let ray = Ray::new([0.1, 0.2, -3.0], [0.0, 0.0, 1.0]);
        for flaw in [Flaw::None, Flaw::Intersect, Flaw::Occluded, Flaw::Hits] {
            let checked = std::panic::catch_unwind(|| {
                check("sphere", &mesh, &[&Wrong { mesh: &mesh, flaw }], &ray)
            });
            assert_eq!(checked.is_ok(), flaw == Flaw::None, "only without a flaw");
        }
    }
}
