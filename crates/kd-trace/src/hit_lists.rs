//! The hits of many rays in one list.

use std::ops::Index;

use kd_core::{Hit, Ray};

use crate::ray_hit::RayHit;
use crate::ray_query::RayQuery;

/// The hits of each ray of a batch, one ray after the other: all hits in one vector, and the place where those of each ray begin
/// (compressed sparse rows).
///
/// ```
/// use kd_core::{Mesh, Ray};
/// use kd_trace::{RayQuery, WideTree};
///
/// let corners = vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]];
/// let tree = WideTree::from_objects(&Mesh::new(corners, vec![[0, 1, 2], [0, 1, 2]])?);
/// let at = |x: f32| Ray::new([x, 0.2, 0.0], [0.0, 0.0, 1.0]);
/// let lists = tree.hits_batch(&[at(9.0), at(0.2)], usize::MAX);
/// assert_eq!(lists.offsets(), [0, 0, 2]);
/// assert!(lists[0].is_empty(), "a miss");
/// assert_eq!(lists[1].iter().map(|hit| hit.triangle).collect::<Vec<_>>(), [0, 1]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct HitLists<H = Hit> {
    /// One more than rays: the first is 0, the last the number of hits.
    offsets: Vec<usize>,
    hits: Vec<H>,
}

impl<H> HitLists<H> {
    /// Lists for no ray, with room for those of some rays.
    pub(crate) fn with_room_for(rays: usize) -> Self {
        let mut offsets = Vec::with_capacity(rays + 1);
        offsets.push(0);
        Self {
            offsets,
            hits: Vec::new(),
        }
    }

    /// The first `max` hits of each ray.
    pub(crate) fn of_each<Q: RayQuery<Hit = H>>(query: &Q, rays: &[Ray], max: usize) -> Self
    where
        H: RayHit,
    {
        let mut lists = Self::with_room_for(rays.len());
        let mut hits = Vec::new();
        for ray in rays {
            query.hits(ray, max, &mut hits);
            lists.push(&hits);
        }
        lists
    }

    /// Lists one after the other.
    pub(crate) fn joined(all: Vec<Self>) -> Self {
        let mut joined = Self::with_room_for(all.iter().map(Self::len).sum());
        joined
            .hits
            .reserve(all.iter().map(|lists| lists.hits.len()).sum());
        for lists in all {
            joined.append(lists);
        }
        joined
    }

    /// Adds the list of the next ray.
    pub(crate) fn push(&mut self, hits: &[H])
    where
        H: Copy,
    {
        self.hits.extend_from_slice(hits);
        self.offsets.push(self.hits.len());
    }

    /// Adds lists behind these.
    pub(crate) fn append(&mut self, mut others: Self) {
        let before = self.hits.len();
        self.hits.append(&mut others.hits);
        let ends = others.offsets.into_iter().skip(1);
        self.offsets.extend(ends.map(|end| before + end));
    }

    /// The number of rays.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Where the hits of each ray begin in [`hits`](Self::hits), and at last the number of hits: one number more than rays.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// The hits of all rays, those of the first ray first.
    pub fn hits(&self) -> &[H] {
        &self.hits
    }

    /// The hits of each ray, in the order of the rays.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &[H]> {
        let pairs = self.offsets.windows(2);
        pairs.map(|ends| &self.hits[ends[0]..ends[1]])
    }

    /// [`offsets`](Self::offsets) and [`hits`](Self::hits), to keep.
    pub fn into_parts(self) -> (Vec<usize>, Vec<H>) {
        (self.offsets, self.hits)
    }
}

/// The hits of a ray.
///
/// # Panics
///
/// If there is no such ray.
impl<H> Index<usize> for HitLists<H> {
    type Output = [H];

    fn index(&self, ray: usize) -> &[H] {
        &self.hits[self.offsets[ray]..self.offsets[ray + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_appended_in_order() {
        let mut lists = HitLists::with_room_for(2);
        lists.push(&[1, 2]);
        lists.push(&[]);
        let mut others = HitLists::with_room_for(2);
        others.push(&[3]);
        others.push(&[4, 5]);
        lists.append(others);
        lists.append(HitLists::with_room_for(0));
        let all: Vec<&[i32]> = lists.iter().collect();
        let expected: [&[i32]; 4] = [&[1, 2], &[], &[3], &[4, 5]];
        assert_eq!(all, expected);
        assert_eq!((lists.len(), &lists[3]), (4, expected[3]));
        assert_eq!(
            lists.into_parts(),
            (vec![0, 2, 2, 3, 5], vec![1, 2, 3, 4, 5])
        );
    }
}
