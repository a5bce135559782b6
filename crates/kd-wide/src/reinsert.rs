//! Reinsertion: a tree of boxes becomes cheaper when subtrees move to better places (J. Bittner, M. Hapala, V. Havran, *Fast
//! Insertion-Based Optimization of Bounding Volume Hierarchies*, 2013; the search from a node upwards and the rounds are those of
//! D. Meister, J. Bittner, *Parallel Reinsertion for Bounding Volume Hierarchy Optimization*, 2018).
//!
//! A round takes the largest boxes, finds for each the place where its subtree saves most area, and moves them, those that save most
//! first, as far as they do not get in each other's way.

use std::cmp::Reverse;

use crate::linked::{Below, LinkedTree, NONE};
use crate::work::Work;

/// The part of all nodes that a round takes, and the number of rounds.
const PART: f64 = 0.2;
const ROUNDS: usize = 4;
/// Boxes that a search visits, at most. (In rooms and scans it visits fewer than a hundred on average. Where all boxes overlap, it finds
/// no bound.)
const MOST_VISITS: usize = 512;
/// Nodes of a task: some tens of microseconds.
const CHUNK: usize = 64;

/// A subtree, and the node that becomes its sibling.
#[derive(Clone, Copy, Debug)]
struct Move {
    node: u32,
    sibling: u32,
    /// The half area that the boxes together lose.
    saved: f32,
}

/// Moves subtrees to where they cost less.
pub(crate) fn reinsert(tree: &mut LinkedTree, work: Work<'_>) {
    let mut share = work.share;
    for round in 0..ROUNDS {
        let own;
        [own, share] = share.divide([1, ROUNDS - round - 1]);
        tree.reinsertion_round(work.is_parallel);
        if work.tracker.done(own).is_err() {
            return;
        }
    }
}

impl LinkedTree {
    fn reinsertion_round(&mut self, is_parallel: bool) {
        let largest = self.largest();
        let chunks: Vec<&[u32]> = largest.chunks(CHUNK).collect();
        let found = kd_tasks::map(chunks, is_parallel, |chunk| {
            let mut pending = Vec::new();
            let moves = chunk
                .iter()
                .filter_map(|node| self.best_move(*node, &mut pending));
            moves.collect::<Vec<Move>>()
        });
        let mut moves: Vec<Move> = found.into_iter().flatten().collect();
        moves.sort_unstable_by(|a, b| b.saved.total_cmp(&a.saved).then(a.node.cmp(&b.node)));
        let mut is_changed = vec![false; self.nodes.len()];
        for planned in moves {
            self.apply(planned, &mut is_changed);
        }
    }

    /// The nodes with the largest boxes that have another place: not the root, nor its children.
    fn largest(&self) -> Vec<u32> {
        let can_move = |parent: u32| parent != NONE && self.at(parent).parent != NONE;
        let all = (0_u32..).zip(&self.nodes);
        // Bits of floats that are not negative are in the order of the floats.
        let mut nodes: Vec<Reverse<(u32, u32)>> = all
            .filter(|(_, node)| can_move(node.parent))
            .map(|(number, node)| Reverse((node.area().to_bits(), number)))
            .collect();
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a part of a length"
        )]
        let count = (self.nodes.len() as f64 * PART) as usize + 1;
        if count < nodes.len() {
            nodes.select_nth_unstable(count);
            nodes.truncate(count);
        }
        nodes.sort_unstable();
        nodes
            .into_iter()
            .map(|Reverse((_, number))| number)
            .collect()
    }

    /// The place where a subtree saves most area, if it saves any. Branch and bound: down from the sibling of the node, then from those
    /// of its ancestors. `pending` is memory.
    fn best_move(&self, node: u32, pending: &mut Vec<(f32, u32)>) -> Option<Move> {
        let own = self.at(node);
        let (parent, own_area) = (own.parent, own.area());
        let mut best = Move {
            node,
            sibling: NONE,
            saved: 0.0,
        };
        // The ancestor that is looked at, what the removal of the node saves up to there, and the box that is left of it.
        let mut ancestor = parent;
        let mut saved = self.at(parent).area();
        let mut beside = self.sibling(node);
        let mut left = *self.at(beside);
        let mut visits = 0;
        loop {
            pending.push((saved, beside));
            while let Some((saved, place)) = pending.pop() {
                visits += 1;
                // The box around the node and anything below is at least that of the node.
                if saved - own_area <= best.saved {
                    continue;
                }
                let at = self.at(place);
                let saved = saved - at.area_with(own);
                if saved > best.saved {
                    best = Move {
                        sibling: place,
                        saved,
                        ..best
                    };
                }
                if let Below::Both(children) = at.below
                    && visits < MOST_VISITS
                {
                    // As a sibling of something below, the node enlarges this box.
                    let saved = saved + at.area();
                    pending.extend(children.map(|child| (saved, child)));
                }
            }
            if ancestor != parent {
                let at = self.at(beside);
                left.min = left.min.min(at.min);
                left.max = left.max.max(at.max);
                saved += self.at(ancestor).area() - left.area();
            }
            if self.at(ancestor).parent == NONE || visits > MOST_VISITS {
                break;
            }
            beside = self.sibling(ancestor);
            ancestor = self.at(ancestor).parent;
        }
        let is_elsewhere = best.sibling != NONE && best.sibling != self.sibling(node);
        is_elsewhere.then_some(best)
    }

    /// Moves a subtree, unless something near it or near its place has moved, or its place is below it by now. Its parent moves along.
    fn apply(&mut self, Move { node, sibling, .. }: Move, is_changed: &mut [bool]) {
        let parent = self.at(node).parent;
        let left = self.sibling(node);
        let (grandparent, above) = (self.at(parent).parent, self.at(sibling).parent);
        let near = [node, sibling, parent, left, grandparent, above];
        let can_move = near
            .iter()
            .all(|near| *near != NONE && !is_changed[*near as usize])
            && sibling != parent
            && !self.is_below(sibling, node);
        if !can_move {
            return;
        }
        for near in [node, sibling, parent, left, above] {
            is_changed[near as usize] = true;
        }
        self.replace_child(grandparent, parent, left);
        let above = self.at(sibling).parent;
        self.replace_child(above, sibling, parent);
        self.nodes[parent as usize].below = Below::Both([sibling, node]);
        self.nodes[sibling as usize].parent = parent;
        self.fit(parent);
        self.fit(grandparent);
    }

    fn is_below(&self, mut number: u32, ancestor: u32) -> bool {
        while number != NONE {
            if number == ancestor {
                return true;
            }
            number = self.at(number).parent;
        }
        false
    }

    fn replace_child(&mut self, parent: u32, before: u32, after: u32) {
        if let Below::Both(children) = &mut self.nodes[parent as usize].below {
            for child in children {
                if *child == before {
                    *child = after;
                }
            }
        }
        self.nodes[after as usize].parent = parent;
    }

    /// Fits the boxes of a node and its ancestors.
    fn fit(&mut self, mut number: u32) {
        while number != NONE {
            if let Below::Both([a, b]) = self.at(number).below {
                let (a, b) = (*self.at(a), *self.at(b));
                let node = &mut self.nodes[number as usize];
                (node.min, node.max) = (a.min.min(b.min), a.max.max(b.max));
            }
            number = self.at(number).parent;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Aabb;
    use kd_tasks::Tracker;

    use super::*;
    use crate::linked::Linked;

    /// Cubes at random places, in a tree of pairs by number: as bad as a tree can be.
    fn bad_tree(count: u32) -> LinkedTree {
        let mut state = 5_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut nodes: Vec<Linked> = (0..count)
            .map(|number| {
                let min = 100.0 * Vec3::new(random(), random(), random());
                Linked::leaf(
                    &Aabb {
                        min,
                        max: min + 1.0,
                    },
                    number,
                )
            })
            .collect();
        let mut next = 0;
        while next + 1 < nodes.len() {
            let number = u32::try_from(nodes.len()).expect("few");
            let children = [next, next + 1].map(|child| u32::try_from(child).expect("few"));
            let both = children.map(|child| nodes[child as usize]);
            nodes.push(Linked::around(children, [&both[0], &both[1]]));
            for child in children {
                nodes[child as usize].parent = number;
            }
            next += 2;
        }
        let root = u32::try_from(nodes.len() - 1).expect("few");
        LinkedTree { nodes, root }
    }

    fn area(tree: &LinkedTree) -> f64 {
        tree.nodes.iter().map(|node| f64::from(node.area())).sum()
    }

    /// Panics unless every leaf is below the root once, in boxes that contain it.
    fn leaves_below(tree: &LinkedTree, number: u32, leaves: &mut Vec<u32>) {
        match tree.at(number).below {
            Below::Leaf(leaf) => leaves.push(leaf),
            Below::Both(children) => {
                for child in children {
                    assert_eq!(tree.at(child).parent, number, "the parent of {child}");
                    let (inner, outer) = (tree.at(child), tree.at(number));
                    assert!(outer.min.cmple(inner.min).all() && inner.max.cmple(outer.max).all());
                    leaves_below(tree, child, leaves);
                }
            }
        }
    }

    #[test]
    fn boxes_lose_area_and_no_leaf() {
        let run = |is_parallel| {
            let mut tree = bad_tree(4000);
            let before = area(&tree);
            let tracker = Tracker::new(None);
            for _ in 0..5 {
                reinsert(&mut tree, Work::new(is_parallel, &tracker));
                let mut leaves = Vec::new();
                leaves_below(&tree, tree.root, &mut leaves);
                leaves.sort_unstable();
                assert!(leaves.into_iter().eq(0..4000), "each leaf once");
            }
            let after = area(&tree);
            assert!(after < 0.8 * before, "{after} of {before}");
            after
        };
        assert_eq!(run(false), run(true), "on any number of threads");
    }

    #[test]
    fn few_nodes_have_no_other_place() {
        for count in 1..5 {
            let mut tree = bad_tree(count);
            let tracker = Tracker::new(None);
            reinsert(&mut tree, Work::new(false, &tracker));
            let mut leaves = Vec::new();
            leaves_below(&tree, tree.root, &mut leaves);
            assert_eq!(leaves.len(), count as usize, "{count}");
        }
    }
}
