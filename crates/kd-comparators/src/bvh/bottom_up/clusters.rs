//! The merging of clusters.

use kd_trace::kit::Item;

use crate::bvh::bounds::Bounds;
use crate::bvh::build::cost_as_leaf;
use crate::bvh::options::BvhOptions;

/// Below this number of clusters, threads do not pay.
const PARALLEL_ABOVE: usize = 1 << 12;
/// If fewer than one in `FEW_PAIRS` clusters find a partner, neighbors along the curve are merged.
const FEW_PAIRS: usize = 64;

/// A tree of groups. Numbers from 0 on are items; the numbers after them are groups, in order of creation. The last group is
/// the root.
#[derive(Debug)]
pub(super) struct Clusters {
    items: usize,
    groups: Vec<Group>,
}

/// Two merged clusters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    pub(super) bounds: Bounds,
    pub(super) members: [u32; 2],
    /// Number of triangles.
    pub(super) triangles: u32,
    /// Whether one leaf costs less than the group's nodes.
    pub(super) is_leaf: bool,
    /// SAH cost, times half areas.
    cost: f64,
}

/// A cluster that is not in a group yet.
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
            bounds: Bounds::of(item),
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

    /// The group of a number; `None` for an item.
    pub(super) fn group(&self, number: usize) -> Option<&Group> {
        number.checked_sub(self.items).map(|at| &self.groups[at])
    }

    /// Merges clusters that have chosen each other. A cluster that has chosen itself stays alone.
    fn paired(&mut self, free: &[Free], partners: &[u32], options: &BvhOptions) -> Vec<Free> {
        let mut next = Vec::with_capacity(free.len());
        for (place, one) in free.iter().enumerate() {
            let partner = partners[place] as usize;
            if partners[partner] as usize != place || partner == place {
                next.push(*one);
            } else if place < partner {
                next.push(self.merged([one, &free[partner]], options));
            }
        }
        next
    }

    #[allow(clippy::cast_possible_truncation, reason = "31 bits count clusters")]
    fn merged(&mut self, members: [&Free; 2], options: &BvhOptions) -> Free {
        let bounds = members[0].bounds.union(&members[1].bounds);
        let (mut triangles, mut cost) = (0, f64::from(options.cost.traverse) * bounds.half_area());
        for member in members {
            match self.group(member.number as usize) {
                Some(group) => {
                    triangles += group.triangles;
                    cost += group.cost;
                }
                None => {
                    triangles += 1;
                    cost += cost_as_leaf(&member.bounds, 1, &options.cost);
                }
            }
        }
        let as_leaf = cost_as_leaf(&bounds, triangles as usize, &options.cost);
        let is_leaf = triangles <= options.max_leaf && as_leaf <= cost;
        self.groups.push(Group {
            bounds,
            members: members.map(|member| member.number),
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

/// The partner that each cluster chooses. At least two clusters choose each other.
fn partners(free: &[Free], radius: usize, is_parallel: bool) -> Vec<u32> {
    let count = u32::try_from(free.len()).expect("30 bits count triangles");
    let is_parallel = is_parallel && free.len() >= PARALLEL_ABOVE;
    let partners = kd_tasks::collect(count, is_parallel, |place| partner(free, place, radius));
    let in_pairs = (0..).zip(&partners).filter(|(place, partner)| {
        let partner_of_partner = partners[**partner as usize];
        partner_of_partner == *place
    });
    // If sizes grow steadily along the curve, each cluster chooses its predecessor, and one pair forms in each round: O(N²) in
    // total. With few clusters left that does not matter.
    if free.len() > radius && FEW_PAIRS * in_pairs.count() < free.len() {
        return (0..count).map(|place| (place ^ 1).min(count - 1)).collect();
    }
    partners
}

/// The cluster with the smallest common box within `radius` of a place.
///
/// Among equals, the cluster whose place differs in the lowest bits. The rule is symmetric, so that equal clusters all pair
/// off in one round.
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

    /// The number of clusters that choose each other.
    fn in_pairs(free: &[Free], radius: usize) -> usize {
        let partners = partners(free, radius, false);
        let of = |place: usize| partners[place] as usize;
        (0..free.len())
            .filter(|place| of(*place) != *place && of(of(*place)) == *place)
            .count()
    }

    #[test]
    fn every_round_makes_enough_pairs() {
        let equal = at((0..1001).map(|_| 0.0));
        assert_eq!(in_pairs(&equal, 16), 1000, "one stays alone");
        // Each cluster is closer to its predecessor than to its successor.
        let growing = at((0..1001).map(|i| (i * i) as f32));
        assert_eq!(in_pairs(&growing, 16), 1000, "neighbors");
        assert_eq!(in_pairs(&growing, 1001), 2, "a window over all clusters");
        let two_by_two = at((0..1000).map(|i| (i / 2 * 10 + i % 2) as f32));
        assert_eq!(in_pairs(&two_by_two, 16), 1000, "each cluster has its own");
    }
}
