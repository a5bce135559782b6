//! Which groups are put together.

use crate::build::cost_as_leaf;
use crate::item::{Bounds, Item};
use crate::options::BvhOptions;

/// Fewer groups do not pay for threads.
const PARALLEL_ABOVE: usize = 1 << 12;
/// Where fewer than one in so many groups find a partner, neighbours along the curve are put together.
const FEW_PAIRS: usize = 64;

/// A tree of groups. Items have the numbers from 0 on, groups those after them, in the order in which they were made; the
/// last one is the root.
#[derive(Debug)]
pub(super) struct Clusters {
    items: usize,
    groups: Vec<Group>,
}

/// Two clusters that were put together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub(super) bounds: Bounds,
    pub(super) parts: [u32; 2],
    /// How many triangles are in it.
    pub(super) triangles: u32,
    /// Whether it costs less as one leaf.
    pub(super) is_leaf: bool,
    /// What it costs, by the surface area heuristic, times half areas.
    cost: f64,
}

/// A cluster that is not yet in a group.
#[derive(Clone, Copy, Debug)]
struct Free {
    bounds: Bounds,
    number: u32,
}

impl Clusters {
    pub(super) fn new(
        items: &[Item],
        radius: usize,
        options: &BvhOptions,
        is_parallel: bool,
    ) -> Self {
        let mut clusters = Self {
            items: items.len(),
            groups: Vec::with_capacity(items.len() - 1),
        };
        let free = (0..).zip(items).map(|(number, item)| Free {
            bounds: item.bounds,
            number,
        });
        let mut free: Vec<Free> = free.collect();
        while free.len() > 1 {
            let partners = partners(&free, radius, is_parallel);
            free = clusters.paired(&free, &partners, options);
        }
        clusters
    }

    /// The number of the root.
    pub(super) fn root(&self) -> usize {
        self.items + self.groups.len() - 1
    }

    /// The group of a number; `None` if that is an item.
    pub(super) fn group(&self, number: usize) -> Option<&Group> {
        number.checked_sub(self.items).map(|at| &self.groups[at])
    }

    /// Puts together those that have chosen each other. What has chosen itself stays alone.
    fn paired(&mut self, free: &[Free], partners: &[u32], options: &BvhOptions) -> Vec<Free> {
        let mut next = Vec::with_capacity(free.len());
        for (place, one) in free.iter().enumerate() {
            let partner = partners[place] as usize;
            if partners[partner] as usize != place || partner == place {
                next.push(*one);
            } else if place < partner {
                next.push(self.put_together([one, &free[partner]], options));
            }
        }
        next
    }

    #[allow(clippy::cast_possible_truncation, reason = "31 bits count clusters")]
    fn put_together(&mut self, parts: [&Free; 2], options: &BvhOptions) -> Free {
        let bounds = parts[0].bounds.union(&parts[1].bounds);
        let (mut triangles, mut cost) = (0, f64::from(options.cost.traverse) * bounds.half_area());
        for part in parts {
            match self.group(part.number as usize) {
                Some(group) => {
                    triangles += group.triangles;
                    cost += group.cost;
                }
                None => {
                    triangles += 1;
                    cost += cost_as_leaf(&part.bounds, 1, &options.cost);
                }
            }
        }
        let as_leaf = cost_as_leaf(&bounds, triangles as usize, &options.cost);
        let is_leaf = triangles <= options.max_leaf && as_leaf <= cost;
        self.groups.push(Group {
            bounds,
            parts: parts.map(|part| part.number),
            triangles,
            is_leaf,
            cost: if is_leaf { as_leaf } else { cost },
        });
        Free {
            bounds,
            number: self.root() as u32,
        }
    }
}

/// Which other cluster each one would like to be put together with: at least two choose each other.
fn partners(free: &[Free], radius: usize, is_parallel: bool) -> Vec<u32> {
    let count = u32::try_from(free.len()).expect("30 bits count triangles");
    let is_parallel = is_parallel && free.len() >= PARALLEL_ABOVE;
    let partners = kd_tasks::collect(count, is_parallel, |place| partner(free, place, radius));
    let in_pairs = (0..).zip(&partners).filter(|(place, partner)| {
        let partner_of_partner = partners[**partner as usize];
        partner_of_partner == *place
    });
    // Where sizes grow steadily along the curve, everyone likes the one before best, and one pair is made at a time: in all
    // O(N²). With few clusters left that does not matter.
    if free.len() > radius && FEW_PAIRS * in_pairs.count() < free.len() {
        return (0..count).map(|place| (place ^ 1).min(count - 1)).collect();
    }
    partners
}

/// The cluster near a place with the smallest common box.
///
/// Among equal ones it is the one whose place differs in the lowest bits. Both of a pair see the same, so that those in a
/// heap of equals pair off all at once.
fn partner(free: &[Free], place: u32, radius: usize) -> u32 {
    let own = &free[place as usize];
    let first = (place as usize).saturating_sub(radius);
    let near = &free[first..free.len().min(place as usize + radius + 1)];
    let mut best = (f64::INFINITY, u32::MAX);
    #[allow(clippy::cast_possible_truncation, reason = "30 bits count triangles")]
    for (other, cluster) in (first as u32..).zip(near) {
        let key = (own.bounds.union(&cluster.bounds).half_area(), place ^ other);
        if key < best && other != place {
            best = key;
        }
    }
    place ^ best.1
}

#[cfg(test)]
mod tests {
    use glam::Vec3A;

    use super::*;

    fn at(places: impl Iterator<Item = f32>) -> Vec<Free> {
        let cube = |(number, x): (u32, f32)| {
            let bounds = Bounds {
                min: Vec3A::splat(x),
                max: Vec3A::splat(x + 1.0),
            };
            Free { bounds, number }
        };
        (0..).zip(places).map(cube).collect()
    }

    /// How many choose each other.
    fn in_pairs(free: &[Free], radius: usize) -> usize {
        let partners = partners(free, radius, false);
        let of = |place: usize| partners[place] as usize;
        (0..free.len())
            .filter(|place| of(*place) != *place && of(of(*place)) == *place)
            .count()
    }

    #[test]
    fn there_are_always_pairs_enough() {
        let equal = at((0..1001).map(|_| 0.0));
        assert_eq!(in_pairs(&equal, 16), 1000, "one is left over");
        // Each is nearer to the one before than to the one after it.
        let growing = at((0..1001).map(|i| (i * i) as f32));
        assert_eq!(in_pairs(&growing, 16), 1000, "neighbours");
        assert_eq!(in_pairs(&growing, 1001), 2, "all with all, as it should be");
        let two_by_two = at((0..1000).map(|i| (i / 2 * 10 + i % 2) as f32));
        assert_eq!(in_pairs(&two_by_two, 16), 1000, "each has its own");
    }
}
