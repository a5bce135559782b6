//! Bottom-up: another tree over the leaves of a division, by locally-ordered clustering (D. Meister, J. Bittner, *Parallel
//! Locally-Ordered Clustering for Bounding Volume Hierarchy Construction*, 2018).
//!
//! Leaves are sorted along a space-filling curve. In each round each cluster chooses, among its neighbors on the curve, the one that it
//! has the smallest box with; two that choose each other become one. Large walls among small things stay alone until only large boxes
//! are left, and so are near the root. A division from above has no such choice.

use crate::bins::half_area;
use crate::box_tree::{BoxTree, Item, Kind, to_u32};
use crate::linked::{Linked, LinkedTree};
use crate::morton::in_morton_order;

/// Neighbors on either side of a cluster. (With 16, rays are 0.7 % slower over 20 meshes; a throw-away program, 2026-11-30.)
const RADIUS: usize = 8;
/// If fewer than one in `FEW_PAIRS` clusters find a partner, neighbors along the curve are merged.
const FEW_PAIRS: usize = 64;
/// Below this number of clusters, threads do not pay.
const PARALLEL_ABOVE: usize = 1 << 12;

/// A tree over the leaves of `boxes`; `None` without leaves.
pub(crate) fn bottom_up(boxes: &BoxTree, is_parallel: bool) -> Option<LinkedTree> {
    boxes.root()?;
    let leaves = (0..boxes.count()).filter(|number| matches!(boxes.node(*number).kind, Kind::Leaf));
    let leaves: Vec<Item> = leaves
        .map(|number| Item::within(boxes.node(number).bounds, number))
        .collect();
    let leaves = in_morton_order(&leaves, is_parallel);
    let nodes = leaves
        .iter()
        .map(|leaf| Linked::leaf(&leaf.bounds(), leaf.number()));
    let mut nodes: Vec<Linked> = nodes.collect();
    for members in clusters(&leaves, RADIUS, is_parallel) {
        let number = to_u32(nodes.len());
        let [a, b] = members.map(|member| {
            let node = &mut nodes[member as usize];
            node.parent = number;
            *node
        });
        nodes.push(Linked::around(members, [&a, &b]));
    }
    let root = to_u32(nodes.len() - 1);
    Some(LinkedTree { nodes, root })
}

/// Merges items, which are in the order of a curve, two by two until one cluster is left: the members of each cluster, in the order in
/// which the clusters are made. Members from 0 on are the places of items; the numbers after them are clusters. The last one is the
/// root.
///
/// Each cluster looks at `radius` neighbors on either side. O(N · `radius`) where sizes vary evenly along the curve. Parallel: on the
/// threads of the pool in scope, with the same result.
///
/// ```
/// use glam::Vec3;
/// use kd_core::Aabb;
/// use kd_wide::{Item, clusters};
///
/// let cube = |(number, x): (u32, f32)| {
///     let min = Vec3::new(x, 0.0, 0.0);
///     Item::within(Aabb { min, max: min + 1.0 }, number)
/// };
/// let row: Vec<Item> = (0..).zip([0.0, 1.0, 5.0, 6.5]).map(cube).collect();
/// assert_eq!(clusters(&row, 2, false), [[0, 1], [2, 3], [4, 5]]);
/// ```
pub fn clusters(items: &[Item], radius: usize, is_parallel: bool) -> Vec<[u32; 2]> {
    let numbered = (0..).zip(items);
    let mut free: Vec<Item> = numbered
        .map(|(place, item)| Item::within(item.bounds(), place))
        .collect();
    let mut made = Vec::with_capacity(items.len().saturating_sub(1));
    while free.len() > 1 {
        let partners = partners(&free, radius, is_parallel);
        let mut next = Vec::with_capacity(free.len());
        for (place, one) in free.iter().enumerate() {
            let partner = partners[place] as usize;
            if partners[partner] as usize != place || partner == place {
                next.push(*one);
            } else if place < partner {
                let other = &free[partner];
                let bounds = one.bounds().union(&other.bounds());
                next.push(Item::within(bounds, to_u32(items.len() + made.len())));
                made.push([one.number(), other.number()]);
            }
        }
        free = next;
    }
    made
}

/// The partner that each cluster chooses: itself, if areas are not finite. At least two clusters choose each other.
fn partners(free: &[Item], radius: usize, is_parallel: bool) -> Vec<u32> {
    let count = to_u32(free.len());
    let partners = if is_parallel && free.len() >= PARALLEL_ABOVE {
        kd_tasks::collect(count, true, |place| partner(free, place, radius))
    } else {
        partners_at_once(free, radius)
    };
    let in_pairs = (0..).zip(&partners).filter(|(place, partner)| {
        let partner_of_partner = partners[**partner as usize];
        partner_of_partner == *place && *partner != place
    });
    // If sizes grow steadily along the curve, each cluster chooses its predecessor, and one pair forms in each round: O(N²) in
    // total. With few clusters left that does not matter, unless none forms.
    let pairs = in_pairs.count();
    if pairs == 0 || free.len() > radius && FEW_PAIRS * pairs < free.len() {
        return (0..count).map(|place| (place ^ 1).min(count - 1)).collect();
    }
    partners
}

/// What a cluster thinks of a partner: the area of their box, and, among equals, the bits in which their places differ. The rule is
/// symmetric, so that equal clusters all pair off in one round.
type Key = (f32, u32);
const WORST: Key = (f32::INFINITY, u32::MAX);

#[inline(always)]
fn key(a: (&Item, u32), b: (&Item, u32)) -> Key {
    let extent = a.0.max().max(b.0.max()) - a.0.min().min(b.0.min());
    (half_area(extent), a.1 ^ b.1)
}

/// The partner of one cluster.
fn partner(free: &[Item], place: u32, radius: usize) -> u32 {
    let own = (&free[place as usize], place);
    let first = (place as usize).saturating_sub(radius);
    let near = &free[first..free.len().min(place as usize + radius + 1)];
    let others = (to_u32(first)..)
        .zip(near)
        .filter(|(other, _)| *other != place);
    let best = others.fold(WORST, |best, (other, cluster)| {
        let key = key(own, (cluster, other));
        if key < best { key } else { best }
    });
    chosen(place, best)
}

/// [`partner`] of every cluster, with each pair looked at once.
fn partners_at_once(free: &[Item], radius: usize) -> Vec<u32> {
    let mut best = vec![WORST; free.len()];
    for (place, own) in free.iter().enumerate() {
        let later = free.iter().enumerate().skip(place + 1).take(radius);
        for (other, cluster) in later {
            let key = key((own, to_u32(place)), (cluster, to_u32(other)));
            for cluster in [place, other] {
                if key < best[cluster] {
                    best[cluster] = key;
                }
            }
        }
    }
    let all = (0..).zip(best);
    all.map(|(place, best)| chosen(place, best)).collect()
}

fn chosen(place: u32, best: Key) -> u32 {
    if best == WORST { place } else { place ^ best.1 }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;

    use super::*;

    fn at(places: impl Iterator<Item = f32>) -> Vec<Item> {
        let cube = |(number, x): (u32, f32)| {
            let bounds = Aabb {
                min: Vec3::splat(x),
                max: Vec3::splat(x + 1.0),
            };
            Item::within(bounds, number)
        };
        (0..).zip(places).map(cube).collect()
    }

    /// The number of clusters that choose each other.
    fn in_pairs(free: &[Item], radius: usize) -> usize {
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
        for count in [2, 5, 1000] {
            let infinite = at((0..count).map(|i| if i % 2 == 0 { 3e38 } else { -3e38 }));
            let pairs = in_pairs(&infinite, 16);
            assert!(pairs >= 2, "{count} boxes without a finite area: {pairs}");
        }
    }

    /// Infinity times zero is no area: no cluster prefers another one.
    #[test]
    fn flat_boxes_too_far_apart_become_one_cluster() {
        for count in [2, 3, 8, 100] {
            let far = |number: u32| {
                let x = if number.is_multiple_of(2) {
                    3e38
                } else {
                    -3e38
                };
                let min = Vec3::new(x, number as f32, 0.0);
                Item::within(Aabb { min, max: min }, number)
            };
            let items: Vec<Item> = (0..count).map(far).collect();
            let made = clusters(&items, 8, false);
            assert_eq!(made.len() + 1, items.len(), "{count}");
        }
    }

    #[test]
    fn both_searches_choose_alike() {
        let free = at((0..3000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as f32));
        for radius in [1, 8, 100] {
            let alone: Vec<u32> = (0..3000)
                .map(|place| partner(&free, place, radius))
                .collect();
            assert_eq!(partners_at_once(&free, radius), alone, "{radius}");
        }
    }
}
