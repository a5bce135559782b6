//! The top of a forest: made by a join, and repaired where few members have changed.
//!
//! A repair removes the links of a member that has changed, and adds one to its root at a place that costs little: a free lane of a
//! node, or that of another link, in a new node for both. The search is that of J. Bittner, M. Hapala, V. Havran, *Incremental BVH
//! construction for ray tracing*, 2015.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BinaryHeap};
use std::ops::Range;

use kd_core::Aabb;

use super::join::{Join, Joined, NewTop, join};
use super::members::{Member, Members};
use crate::arrays::{Arrays, State};
use crate::divide::MOST_DIVISIONS;
use crate::node::{Child, WIDTH, WideNode};

/// The fewest members whose top is repaired. A join of fewer takes half a millisecond. (18 ms for 40 000 boxes of twelve triangles, a
/// throw-away program, 2026-11-30.)
const MANY: usize = 1000;
/// A repair changes at most one in this many members.
const ONE_IN: usize = 32;
/// Room for a node of a repair, for this many members.
const NODE_PER: usize = 16;
/// By what factor the SAH cost of the top may grow until the members are joined again.
const MOST_WORN: f64 = 1.05;

/// The members that have changed since the last join, by number, and what the top links of each: nothing of a member that had no
/// triangles with an area.
pub(crate) type Edits = BTreeMap<u32, Option<Linked>>;

/// A member and its box, as they were when it was linked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linked {
    pub(crate) member: Member,
    pub(crate) bounds: Aabb,
}

/// Nodes over all members.
#[derive(Clone, Debug)]
pub(crate) struct Top {
    options: Join,
    root: Child,
    /// Its nodes in the arrays, with some that are free.
    nodes: Range<usize>,
    first_free: usize,
    /// Of the last join; repairs keep the numbers of nodes and links true.
    joined: Joined,
    /// The half areas of all boxes, added up.
    cost: f64,
    /// The largest `cost` that is repaired.
    most_cost: f64,
    /// How many members may change until the next join, which then costs little for each.
    changes_left: usize,
}

/// A lane of a node of the top.
#[derive(Clone, Copy, Debug)]
struct Lane {
    node: usize,
    lane: usize,
}

/// Where a link may be added.
#[derive(Clone, Debug)]
struct Place {
    /// By how much it makes the cost of the top grow; without the box of the link itself, which is the same anywhere.
    growth: f64,
    /// The lanes above, from the root down.
    above: Vec<Lane>,
    at: Lane,
    /// Whether another link is there.
    is_shared: bool,
}

/// A way down to a node.
#[derive(Clone, Debug)]
struct Way {
    /// By how much the boxes on it would grow.
    growth: f64,
    /// Its lanes, from the root down.
    above: Vec<Lane>,
    node: usize,
}

/// The least growth is the greatest; among equals the lower node.
impl Ord for Way {
    fn cmp(&self, other: &Self) -> Ordering {
        let growth = other.growth.total_cmp(&self.growth);
        growth.then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Way {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Way {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Way {}

impl Top {
    /// Whether the top over so many members is repaired.
    pub(crate) fn is_kept(members: &Members) -> bool {
        members.count() >= MANY
    }

    /// Whether a repair may change so many of the members.
    pub(crate) fn can_repair(edits: &Edits, members: &Members) -> bool {
        edits.len() * ONE_IN <= members.count()
    }

    /// Joins all members, and puts the top behind all other nodes.
    pub(crate) fn new(arrays: &mut Arrays, members: &Members, options: Join, at: State) -> Self {
        let first = arrays.nodes().len();
        let NewTop {
            mut nodes,
            root,
            joined,
        } = join(arrays, members.all(), options, first);
        let first_free = first + nodes.len();
        let mut cost = 0.0;
        if Self::is_kept(members) {
            let boxes = nodes.iter().flat_map(boxes);
            cost = boxes.map(|bounds| bounds.half_area()).sum();
            nodes.resize(nodes.len() + members.count() / NODE_PER, WideNode::EMPTY);
        }
        arrays.nodes.put(first, &nodes, at);
        let mut children = nodes.iter().flat_map(|node| node.children);
        assert!(
            children.all(|child| arrays.has(child)),
            "every child is a node or blocks of the same tree"
        );
        Self {
            options,
            root,
            nodes: first..first + nodes.len(),
            first_free,
            joined,
            cost,
            most_cost: MOST_WORN * cost,
            changes_left: members.count(),
        }
    }

    pub(crate) fn root(&self) -> Child {
        self.root
    }

    pub(crate) fn joined(&self) -> Joined {
        self.joined
    }

    /// Its places in the arrays.
    pub(crate) fn nodes(&self) -> Range<usize> {
        self.nodes.clone()
    }

    /// Changes the links of members that have changed. False: they must be joined instead.
    pub(crate) fn repair(
        &mut self,
        arrays: &mut Arrays,
        members: &Members,
        edits: &Edits,
        options: Join,
        at: State,
    ) -> bool {
        if options.open_above != self.options.open_above
            || edits.len() > self.changes_left
            || !self.has(self.root)
        {
            return false;
        }
        self.changes_left -= edits.len();
        // The nodes of one member may be where those of another one were: first all links that are no more.
        for linked in edits.values().flatten() {
            self.unlink(arrays, linked, at);
        }
        let are_linked = edits.keys().all(|number| {
            let member = members.all()[*number as usize].root();
            member == Child::NOTHING || self.link(arrays, member, at)
        });
        are_linked && self.cost <= self.most_cost
    }

    /// Whether a child of one of its nodes is one of them, and no link.
    fn has(&self, child: Child) -> bool {
        !child.is_leaf() && self.nodes.contains(&child.index())
    }

    /// Removes all links to nodes and leaves of a member.
    fn unlink(&mut self, arrays: &mut Arrays, linked: &Linked, at: State) {
        let mut found = Vec::new();
        self.find(
            arrays,
            linked,
            self.root.index(),
            &mut Vec::new(),
            &mut found,
        );
        debug_assert!(!found.is_empty(), "a member in a box has a link");
        self.joined.links -= found.len();
        for lanes in found {
            let (link, above) = lanes.split_last().expect("a lane of the root or below");
            self.set(arrays, *link, &Aabb::EMPTY, Child::NOTHING, at);
            for lane in above.iter().rev() {
                let child = arrays.nodes()[lane.node].children[lane.lane];
                let around = arrays.nodes()[child.index()].around();
                self.set(arrays, *lane, &around, child, at);
            }
        }
    }

    /// Finds the lanes of all links to a member below a node, each after those above it. All links are in the box of the member.
    fn find(
        &self,
        arrays: &Arrays,
        linked: &Linked,
        node: usize,
        above: &mut Vec<Lane>,
        found: &mut Vec<Vec<Lane>>,
    ) {
        let children = &arrays.nodes()[node];
        for lane in children.lanes() {
            let child = children.children[lane];
            if !self.has(child) {
                if linked.member.has(child) {
                    let mut lanes = above.clone();
                    lanes.push(Lane { node, lane });
                    found.push(lanes);
                }
                continue;
            }
            if !children
                .bounds(lane)
                .intersection(&linked.bounds)
                .is_empty()
            {
                above.push(Lane { node, lane });
                self.find(arrays, linked, child.index(), above, found);
                above.pop();
            }
        }
    }

    /// Adds a link to the root of a member. False if there is no place for it.
    fn link(&mut self, arrays: &mut Arrays, member: Child, at: State) -> bool {
        let bounds = arrays.nodes()[member.index()].around();
        if bounds.is_empty() {
            return true;
        }
        let Some(place) = self.best_place(arrays, &bounds) else {
            return false;
        };
        for lane in place.above {
            let node = &arrays.nodes()[lane.node];
            let (around, child) = (node.bounds(lane.lane), node.children[lane.lane]);
            self.set(arrays, lane, &around.union(&bounds), child, at);
        }
        self.joined.links += 1;
        let Lane { node, lane } = place.at;
        if !place.is_shared {
            self.set(arrays, place.at, &bounds, member, at);
            return true;
        }
        let other = arrays.nodes()[node];
        let both = self.first_free;
        self.first_free += 1;
        self.joined.nodes += 1;
        let links = [(other.bounds(lane), other.children[lane]), (bounds, member)];
        for (lane, (bounds, child)) in links.iter().enumerate() {
            let lane = Lane { node: both, lane };
            self.set(arrays, lane, bounds, *child, at);
        }
        let around = bounds.union(&other.bounds(lane));
        self.set(arrays, place.at, &around, Child::node(both), at);
        true
    }

    /// The place of least growth. Ways down are tried in the order of the growth of the boxes on them, until none can be better.
    fn best_place(&self, arrays: &Arrays, bounds: &Aabb) -> Option<Place> {
        let mut best: Option<Place> = None;
        let mut ways = BinaryHeap::from([Way {
            growth: 0.0,
            above: Vec::new(),
            node: self.root.index(),
        }]);
        while let Some(Way {
            growth,
            above,
            node,
        }) = ways.pop()
        {
            let is_best = |growth: f64| best.as_ref().is_none_or(|best| growth < best.growth);
            if !is_best(growth) {
                break;
            }
            let children = &arrays.nodes()[node];
            let free = (0..WIDTH).find(|lane| children.children[*lane] == Child::NOTHING);
            if let Some(lane) = free {
                best = Some(Place {
                    growth,
                    above: above.clone(),
                    at: Lane { node, lane },
                    is_shared: false,
                });
            }
            for lane in children.lanes() {
                let before = children.bounds(lane);
                let after = before.union(bounds).half_area();
                let child = children.children[lane];
                let at = Lane { node, lane };
                if self.has(child) {
                    let growth = growth + after - before.half_area();
                    let above = above.iter().copied().chain([at]).collect();
                    let node = child.index();
                    ways.push(Way {
                        growth,
                        above,
                        node,
                    });
                    continue;
                }
                // The other link gets a box of its own, one level further down.
                let growth = growth + after;
                let has_room = above.len() < MOST_DIVISIONS && self.first_free < self.nodes.end;
                if has_room && best.as_ref().is_none_or(|best| growth < best.growth) {
                    best = Some(Place {
                        growth,
                        above: above.clone(),
                        at,
                        is_shared: true,
                    });
                }
            }
        }
        best
    }

    /// Sets a child and its box.
    fn set(&mut self, arrays: &mut Arrays, lane: Lane, bounds: &Aabb, child: Child, at: State) {
        assert!(
            arrays.has(child),
            "every child is a node or blocks of the same tree"
        );
        let Lane { node, lane } = lane;
        let node = &mut arrays.nodes.write(node..node + 1, at)[0];
        self.cost += bounds.half_area() - node.bounds(lane).half_area();
        node.set(lane, bounds, child);
        node.order_by_centers();
    }
}

fn boxes(node: &WideNode) -> [Aabb; WIDTH] {
    std::array::from_fn(|lane| node.bounds(lane))
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use kd_core::Mesh;

    use super::super::{Join, Refit, WideForest};
    use super::*;
    use crate::tree::WideTree;

    const TRIANGLES: u32 = 20;

    /// Some triangles, a few of them without an area, around a point: most members are small, some are large.
    fn member(rng: &mut Rng) -> Mesh {
        let mut point = {
            let mut rng = rng.fork();
            move |size: f32| [0; 3].map(|_| size * (2.0 * rng.f32() - 1.0))
        };
        let center = point(10.0);
        let size = if center[0] > 9.8 { 10.0 } else { 0.5 };
        let mut corners: Vec<[f32; 3]> = Vec::new();
        for _ in 0..3 * TRIANGLES {
            let offset = point(size);
            corners.push([0, 1, 2].map(|axis| center[axis] + offset[axis]));
        }
        let of_no_area = match rng.u32(0..10) {
            0 => 0..TRIANGLES,
            1 => 3..TRIANGLES,
            _ => 0..0,
        };
        let triangles = (0..TRIANGLES).map(|number| {
            let first = 3 * number;
            let last = if of_no_area.contains(&number) { 1 } else { 2 };
            [first, first + 1, first + last]
        });
        Mesh::new(corners, triangles.collect()).expect("valid")
    }

    /// Checks that boxes hold what is below them, and counts how often rays reach each block.
    fn check(forest: &WideForest, child: Child, reached: &mut [u32]) -> Aabb {
        let arrays = &forest.tree.arrays;
        if child.is_leaf() {
            let blocks = child.blocks();
            reached[blocks.clone()]
                .iter_mut()
                .for_each(|count| *count += 1);
            let boxes = arrays.blocks()[blocks].iter().map(|block| block.bounds());
            return boxes.fold(Aabb::EMPTY, |around, bounds| around.union(&bounds));
        }
        let node = arrays.nodes()[child.index()];
        for lane in 0..WIDTH {
            let below = check(forest, node.children[lane], reached);
            assert_eq!(below, node.bounds(lane), "the box around what is below");
        }
        node.around()
    }

    #[test]
    fn repairs_link_every_triangle_once() {
        let mut rng = Rng::with_seed(2);
        let mut forest = WideForest::new();
        let mut first_slots: Vec<Option<u32>> = Vec::new();
        for number in 0..1200 {
            forest.push(
                &WideTree::from_objects(&member(&mut rng)),
                TRIANGLES * number,
            );
            first_slots.push(Some(TRIANGLES * number));
        }
        let options = Join::default();
        let opened = forest.join(options).opened;
        assert!(opened > 100, "{opened} opened");
        let mut repaired = 0;
        let mut older = vec![forest.clone()];
        for round in 0..effort() {
            let mut refits = Vec::new();
            for _ in 0..rng.usize(0..30) {
                let mesh = member(&mut rng);
                let number = rng.usize(0..first_slots.len());
                match (first_slots[number], rng.u32(0..8)) {
                    (Some(_), 0) => {
                        forest.remove(number);
                        first_slots[number] = None;
                    }
                    (Some(first_slot), 1..=6) => refits.push((number, mesh, first_slot)),
                    _ => {
                        let slot = TRIANGLES * (10_000 + round);
                        let number = forest.push(&WideTree::from_objects(&mesh), slot);
                        first_slots.resize(first_slots.len().max(number + 1), None);
                        first_slots[number] = Some(slot);
                    }
                }
            }
            for (number, mesh, first_slot) in refits {
                // Triangles with an area lose it, or regain it.
                if first_slots[number] == Some(first_slot) {
                    forest.refit_all(
                        &[Refit {
                            number,
                            mesh: &mesh,
                            first_slot,
                        }],
                        false,
                    );
                }
            }
            let before = forest.top.as_ref().map(|top| top.nodes());
            let joined = forest.join(options);
            let after = forest.top.as_ref().map(|top| top.nodes());
            repaired += u32::from(before == after);
            let arrays = &forest.tree.arrays;
            if let Some(top) = &forest.top {
                let boxes = arrays.nodes()[top.nodes()].iter().flat_map(boxes);
                let cost: f64 = boxes.map(|bounds| bounds.half_area()).sum();
                let is_right = (top.cost - cost).abs() < 1e-9 * cost;
                assert!(
                    is_right || !Top::is_kept(&forest.members),
                    "round {round}: {cost}"
                );
            }
            let mut reached = vec![0; arrays.blocks().len()];
            check(&forest, arrays.root(), &mut reached);
            for member in forest.members.all() {
                for (count, block) in reached[member.blocks()]
                    .iter_mut()
                    .zip(&arrays.blocks()[member.blocks()])
                {
                    let is_met = !block.bounds().is_empty();
                    assert!(
                        *count == 1 || *count == 0 && !is_met,
                        "round {round}: each triangle once"
                    );
                    *count = 0;
                }
            }
            assert!(
                reached.iter().all(|count| *count == 0),
                "round {round}: nothing that was removed"
            );
            let count = first_slots.iter().flatten().count();
            assert_eq!(forest.len(), count, "round {round}");
            assert!(joined.links > 3 * count / 4, "{joined:?}");
            if round % 3 == 0 {
                older.push(forest.clone());
            }
            if older.len() > 4 {
                let mut copy = older.swap_remove(rng.usize(0..older.len()));
                copy.catch_up(&forest);
                assert!(copy.tree == forest.tree, "round {round}: an older copy");
                forest = copy;
            }
        }
        assert!(repaired > effort() / 2, "{repaired} repairs");
    }

    /// Rounds of edits.
    fn effort() -> u32 {
        if cfg!(miri) { 2 } else { 200 }
    }

    fn nested(size: f32) -> Mesh {
        let corners = vec![[0.0; 3], [size, 0.0, size], [0.0, size, size]];
        Mesh::new(corners, vec![[0, 1, 2]]).expect("valid")
    }

    #[test]
    #[cfg_attr(miri, ignore = "takes minutes")]
    fn links_stay_near_the_root() {
        fn depth(forest: &WideForest, child: Child) -> usize {
            if child.is_leaf() {
                return 0;
            }
            let node = forest.tree.nodes()[child.index()];
            let below = node.children.map(|child| depth(forest, child));
            1 + below.into_iter().max().expect("eight")
        }
        let mut forest = WideForest::new();
        for number in 0..20_000_u16 {
            let right = [f32::from(number), 0.0, 0.0];
            let mesh = nested(0.5).transformed(&glam::Affine3A::from_translation(right.into()));
            let tree = WideTree::from_objects(&mesh.expect("finite"));
            forest.push(&tree, u32::from(number));
        }
        forest.join(Join::default());
        // One within the other, so that the best place of each is beside the one before.
        let mut size = 0.4;
        for number in 1..1000_u32 {
            forest.refit(number as usize, &nested(size), number);
            forest.join(Join::default());
            size *= 0.95;
            let depth = depth(&forest, forest.tree.root());
            assert!(depth <= MOST_DIVISIONS + 2, "{depth} levels");
        }
    }

    #[test]
    fn a_top_that_is_worn_or_of_other_options_is_made_again() {
        let mut rng = Rng::with_seed(8);
        let mut forest = WideForest::new();
        let count = if cfg!(miri) { 1000 } else { 1200 };
        for number in 0..count {
            let tree = WideTree::from_objects(&member(&mut rng));
            forest.push(&tree, TRIANGLES * number);
        }
        let opened = forest.join(Join::default()).opened;
        let never = Join {
            open_above: f64::INFINITY,
            ..Join::default()
        };
        assert!(opened > 0, "{opened} opened");
        assert_eq!(forest.join(never).opened, 0, "of other options");
        let before = forest.top.as_ref().expect("a top").changes_left;
        let far = glam::Affine3A::from_translation(glam::Vec3::splat(1e4));
        let far = member(&mut rng).transformed(&far).expect("finite");
        forest.refit(5, &far, TRIANGLES * 5);
        forest.join(never);
        let after = forest.top.as_ref().expect("a top").changes_left;
        assert_eq!(after, before, "worn by a box of the size of all");
    }
}
