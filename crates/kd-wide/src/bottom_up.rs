//! Bottom-up: another tree over the leaves of a division, by locally-ordered clustering (D. Meister, J. Bittner, *Parallel
//! Locally-Ordered Clustering for Bounding Volume Hierarchy Construction*, 2018).
//!
//! Leaves are sorted along a space-filling curve. In each round each cluster chooses, among its neighbors on the curve, the one that it
//! has the smallest box with; two that choose each other become one. Large walls among small things stay alone until only large boxes
//! are left, and so are near the root. A division from above has no such choice.

use crate::box_tree::{BoxTree, Item, Kind};
use crate::linked::{Linked, LinkedTree};
use crate::morton::in_morton_order;

/// Neighbors on either side of a cluster. (With 16, rays are 0.7 % slower over 20 meshes; a throw-away program, 2026-11-30.)
const RADIUS: usize = 8;
/// If fewer than one in `FEW_PAIRS` clusters find a partner, neighbors along the curve are merged.
const FEW_PAIRS: usize = 64;
/// Below this number of clusters, threads do not pay.
const PARALLEL_ABOVE: usize = 1 << 12;

/// A cluster that is not in another one yet.
#[derive(Clone, Copy)]
struct Free {
    node: Linked,
    number: u32,
}

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
    nodes.reserve(nodes.len());
    let mut free: Vec<Free> = (0..)
        .zip(&nodes)
        .map(|(number, node)| Free {
            node: *node,
            number,
        })
        .collect();
    while free.len() > 1 {
        let partners = partners(&free, is_parallel);
        free = paired(&free, &partners, &mut nodes);
    }
    let root = free[0].number;
    Some(LinkedTree { nodes, root })
}

/// Merges clusters that have chosen each other. A cluster that has chosen itself stays alone.
fn paired(free: &[Free], partners: &[u32], nodes: &mut Vec<Linked>) -> Vec<Free> {
    let mut next = Vec::with_capacity(free.len());
    for (place, one) in free.iter().enumerate() {
        let partner = partners[place] as usize;
        if partners[partner] as usize != place || partner == place {
            next.push(*one);
        } else if place < partner {
            let other = &free[partner];
            let members = [one.number, other.number];
            let node = Linked::around(members, [&one.node, &other.node]);
            let number = to_u32(nodes.len());
            for member in members {
                nodes[member as usize].parent = number;
            }
            nodes.push(node);
            next.push(Free { node, number });
        }
    }
    next
}

/// The partner that each cluster chooses. At least two clusters choose each other.
fn partners(free: &[Free], is_parallel: bool) -> Vec<u32> {
    let count = to_u32(free.len());
    let partners = if is_parallel && free.len() >= PARALLEL_ABOVE {
        kd_tasks::collect(count, true, |place| partner(free, place))
    } else {
        partners_at_once(free)
    };
    let in_pairs = (0..).zip(&partners).filter(|(place, partner)| {
        let partner_of_partner = partners[**partner as usize];
        partner_of_partner == *place
    });
    // If sizes grow steadily along the curve, each cluster chooses its predecessor, and one pair forms in each round: O(N²) in
    // total. With few clusters left that does not matter.
    if free.len() > RADIUS && FEW_PAIRS * in_pairs.count() < free.len() {
        return (0..count).map(|place| (place ^ 1).min(count - 1)).collect();
    }
    partners
}

/// What a cluster thinks of a partner: the area of their box, and, among equals, the bits in which their places differ. The rule is
/// symmetric, so that equal clusters all pair off in one round.
type Key = (f32, u32);
const WORST: Key = (f32::INFINITY, u32::MAX);

fn key(a: (&Free, u32), b: (&Free, u32)) -> Key {
    (a.0.node.area_with(&b.0.node), a.1 ^ b.1)
}

/// The partner of one cluster.
fn partner(free: &[Free], place: u32) -> u32 {
    let own = (&free[place as usize], place);
    let first = (place as usize).saturating_sub(RADIUS);
    let near = &free[first..free.len().min(place as usize + RADIUS + 1)];
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
fn partners_at_once(free: &[Free]) -> Vec<u32> {
    let mut best = vec![WORST; free.len()];
    for (place, own) in free.iter().enumerate() {
        let later = free.iter().enumerate().skip(place + 1).take(RADIUS);
        for (other, cluster) in later {
            let key = key((own, to_u32(place)), (cluster, to_u32(other)));
            for cluster in [place, other] {
                if key < best[cluster] {
                    best[cluster] = key;
                }
            }
        }
    }
    (0..)
        .zip(best)
        .map(|(place, best)| chosen(place, best))
        .collect()
}

/// Itself, if areas are not finite.
fn chosen(place: u32, best: Key) -> u32 {
    if best == WORST { place } else { place ^ best.1 }
}

fn to_u32(count: usize) -> u32 {
    u32::try_from(count).expect("32 bits count nodes")
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;

    use super::*;

    fn at(places: impl Iterator<Item = f32>) -> Vec<Free> {
        let cube = |(number, x): (u32, f32)| {
            let bounds = Aabb {
                min: Vec3::splat(x),
                max: Vec3::splat(x + 1.0),
            };
            let node = Linked::leaf(&bounds, number);
            Free { node, number }
        };
        (0..).zip(places).map(cube).collect()
    }

    /// The number of clusters that choose each other.
    fn in_pairs(free: &[Free]) -> usize {
        let partners = partners(free, false);
        let of = |place: usize| partners[place] as usize;
        (0..free.len())
            .filter(|place| of(*place) != *place && of(of(*place)) == *place)
            .count()
    }

    #[test]
    fn every_round_makes_enough_pairs() {
        let equal = at((0..1001).map(|_| 0.0));
        assert_eq!(in_pairs(&equal), 1000, "one stays alone");
        // Each cluster is closer to its predecessor than to its successor.
        let growing = at((0..1001).map(|i| (i * i) as f32));
        assert_eq!(in_pairs(&growing), 1000, "neighbors");
        let two_by_two = at((0..1000).map(|i| (i / 2 * 10 + i % 2) as f32));
        assert_eq!(in_pairs(&two_by_two), 1000, "each cluster has its own");
        let infinite = at((0..1000).map(|i| if i % 2 == 0 { 3e38 } else { -3e38 }));
        assert_eq!(in_pairs(&infinite), 1000, "boxes without an area in f32");
    }

    #[test]
    fn both_searches_choose_alike() {
        let free = at((0..3000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as f32));
        let alone: Vec<u32> = (0..3000).map(|place| partner(&free, place)).collect();
        assert_eq!(partners_at_once(&free), alone);
    }
}
