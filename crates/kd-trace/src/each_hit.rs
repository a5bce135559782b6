//! The hits of a ray one after another, found as they are asked for.

use kd_core::Ray;

use crate::ray_query::RayQuery;

/// Hits that are found together after the first. Each time more are needed, four times as many are found, up to [`MOST`].
const FEW: usize = 4;
const MOST: usize = 1024;

/// The hits of a ray in order, each triangle once. See [`RayQuery::each_hit`].
///
/// The first hit costs a closest hit. Hits behind it are found in groups that grow, each in a traversal of its own, so all of `k`
/// hits take O(log k) traversals and k / 1024.
#[derive(Debug)]
pub struct EachHit<'a, Q: RayQuery> {
    query: &'a Q,
    ray: Ray,
    /// Hits that were found, in order; those before `next` were returned.
    found: Vec<Q::Hit>,
    next: usize,
    /// How many hits to find next.
    count: usize,
    /// The last hit that was returned.
    last: Option<Q::Hit>,
    is_finished: bool,
}

impl<'a, Q: RayQuery> EachHit<'a, Q> {
    /// From the first hit on. `expected` hits will be asked for, more or fewer.
    pub(crate) fn new(query: &'a Q, ray: &Ray, expected: usize) -> Self {
        Self {
            query,
            ray: *ray,
            found: Vec::new(),
            next: 0,
            count: expected.clamp(1, MOST),
            last: None,
            is_finished: false,
        }
    }

    /// Behind a hit of the ray.
    pub(crate) fn behind(query: &'a Q, ray: &Ray, last: Q::Hit) -> Self {
        Self {
            last: Some(last),
            ..Self::new(query, ray, FEW)
        }
    }

    /// Finds the next hits.
    fn find(&mut self) {
        let Self {
            query, ray, found, ..
        } = self;
        match &self.last {
            None if self.count == 1 => {
                found.clear();
                found.extend(query.intersect(ray));
            }
            None => query.hits(ray, self.count, found),
            Some(last) => query.hits_behind(ray, last, self.count, found),
        }
        self.is_finished = found.len() < self.count;
        self.count = (4 * self.count).min(MOST);
        self.next = 0;
    }
}

impl<Q: RayQuery> Iterator for EachHit<'_, Q> {
    type Item = Q::Hit;

    #[inline]
    fn next(&mut self) -> Option<Q::Hit> {
        if self.next == self.found.len() {
            if self.is_finished {
                return None;
            }
            self.find();
        }
        let hit = *self.found.get(self.next)?;
        self.next += 1;
        self.last = Some(hit);
        Some(hit)
    }
}
