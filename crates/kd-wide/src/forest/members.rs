//! The members of a forest: where their nodes and blocks are.

use std::ops::Range;

use super::room::Room;
use crate::arrays::{Arrays, Paged, State};
use crate::block::Block;
use crate::box_tree::to_u32;
use crate::node::Child;

/// A range of nodes and a range of blocks. The nodes refer to these ranges only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Member {
    first_node: u32,
    nodes: u32,
    first_block: u32,
    blocks: u32,
    root: Child,
}

impl Member {
    /// No nodes.
    const VACANT: Self = Self {
        first_node: 0,
        nodes: 0,
        first_block: 0,
        blocks: 0,
        root: Child::NOTHING,
    };

    /// All of a tree.
    ///
    /// # Panics
    ///
    /// If the tree is that of a forest.
    pub(crate) fn all_of(arrays: &Arrays) -> Self {
        assert!(!arrays.has_members(), "a tree that is not that of a forest");
        Self {
            nodes: to_u32(arrays.nodes().len()),
            blocks: to_u32(arrays.blocks().len()),
            root: arrays.root(),
            ..Self::VACANT
        }
    }

    /// A node, or [`Child::NOTHING`].
    pub(crate) fn root(&self) -> Child {
        self.root
    }

    pub(crate) fn nodes(&self) -> Range<usize> {
        self.first_node as usize..(self.first_node + self.nodes) as usize
    }

    pub(crate) fn blocks(&self) -> Range<usize> {
        self.first_block as usize..(self.first_block + self.blocks) as usize
    }

    /// Gives the nodes of a member, which were at those of `before`, the children that they have now.
    fn rebase(&mut self, before: &Self, arrays: &mut Arrays, at: State) {
        let by = (
            self.nodes().start.wrapping_sub(before.nodes().start),
            self.blocks().start.wrapping_sub(before.blocks().start),
        );
        if by == (0, 0) {
            return;
        }
        self.root = before.root.moved(by.0, by.1);
        let nodes = arrays.nodes.write(self.nodes(), at);
        for child in nodes.iter_mut().flat_map(|node| &mut node.children) {
            *child = child.moved(by.0, by.1);
        }
    }

    /// Whether a node or a leaf is one of the member's.
    pub(crate) fn has(&self, child: Child) -> bool {
        if child.is_leaf() {
            self.blocks().contains(&child.blocks().start)
        } else {
            self.nodes().contains(&child.index())
        }
    }
}

/// The members by number, and what is free in the arrays that they share.
#[derive(Clone, Debug)]
pub(crate) struct Members {
    all: Paged<Member>,
    /// Numbers of no member, to give to the next ones.
    vacant: Vec<u32>,
    nodes: Room,
    blocks: Room,
}

impl Members {
    pub(crate) fn new() -> Self {
        Self {
            all: Paged::new(),
            vacant: Vec::new(),
            nodes: Room::default(),
            blocks: Room::default(),
        }
    }

    /// By number. Vacant ones have no nodes.
    pub(crate) fn all(&self) -> &[Member] {
        &self.all
    }

    /// The number of members.
    pub(crate) fn count(&self) -> usize {
        self.all.len() - self.vacant.len()
    }

    /// Copies a member of other arrays, and adds `slots` to the slots of its triangles. Returns its number.
    pub(crate) fn push(
        &mut self,
        to: &mut Arrays,
        from: &Arrays,
        member: &Member,
        slots: u32,
        at: State,
    ) -> usize {
        let added = self.place(to, member);
        let nodes = &from.nodes()[member.nodes()];
        to.nodes.put(added.nodes().start, nodes, at);
        let blocks = &from.blocks()[member.blocks()];
        to.blocks.put(added.blocks().start, blocks, at);
        let number = self.add(to, added, member, at);
        self.add_to_slots(to, number, slots, at);
        number
    }

    /// Copies one of the members. Returns the number of the copy.
    pub(crate) fn push_again(&mut self, arrays: &mut Arrays, number: usize, at: State) -> usize {
        let member = self.all[number];
        let added = self.place(arrays, &member);
        let nodes = &mut arrays.nodes;
        nodes.put_again(added.nodes().start, member.nodes(), at);
        let blocks = &mut arrays.blocks;
        blocks.put_again(added.blocks().start, member.blocks(), at);
        self.add(arrays, added, &member, at)
    }

    /// Where a copy of a member goes. Its root is still that of the member.
    fn place(&mut self, to: &Arrays, member: &Member) -> Member {
        let first_node = place(&mut self.nodes, member.nodes().len(), to.nodes().len());
        let first_block = place(&mut self.blocks, member.blocks().len(), to.blocks().len());
        Member {
            first_node: to_u32(first_node),
            first_block: to_u32(first_block),
            ..*member
        }
    }

    /// Adds a member whose nodes and blocks were copied from those of `before`. Returns its number.
    fn add(&mut self, to: &mut Arrays, mut added: Member, before: &Member, at: State) -> usize {
        added.rebase(before, to, at);
        let number = self.vacant.pop().unwrap_or(to_u32(self.all.len())) as usize;
        self.all.put(number, &[added], at);
        number
    }

    /// Adds to the slots of all triangles of a member, modulo 2³².
    pub(crate) fn add_to_slots(&self, arrays: &mut Arrays, number: usize, slots: u32, at: State) {
        if slots == 0 {
            return;
        }
        let blocks = arrays.blocks.write(self.all[number].blocks(), at);
        for slot in blocks.iter_mut().flat_map(Block::slots_mut) {
            *slot = slot.wrapping_add(slots);
        }
    }

    /// Frees the nodes and the number of a member. Returns what it was.
    pub(crate) fn remove(&mut self, number: usize, at: State) -> Member {
        let member = std::mem::replace(
            &mut self.all.write(number..number + 1, at)[0],
            Member::VACANT,
        );
        self.vacant.push(to_u32(number));
        self.nodes.give(member.nodes().start, member.nodes().len());
        self.blocks
            .give(member.blocks().start, member.blocks().len());
        member
    }

    /// Frees nodes of no member.
    pub(crate) fn give_nodes(&mut self, nodes: Range<usize>) {
        self.nodes.give(nodes.start, nodes.len());
    }

    /// Removes what is free at the end of the arrays. Nothing may refer to it.
    pub(crate) fn trim(&mut self, arrays: &mut Arrays) {
        let nodes = self.nodes.trim(arrays.nodes().len());
        arrays.nodes.truncate(nodes);
        let blocks = self.blocks.trim(arrays.blocks().len());
        arrays.blocks.truncate(blocks);
    }

    /// Makes these members, which were equal to `with` in the state `since`, equal to `with` again.
    pub(crate) fn catch_up(&mut self, with: &Self, since: State) {
        self.all.catch_up(&with.all, since);
        self.vacant.clone_from(&with.vacant);
        self.nodes.clone_from(&with.nodes);
        self.blocks.clone_from(&with.blocks);
    }

    /// Whether anything is free.
    pub(crate) fn have_room(&self) -> bool {
        self.nodes.free() + self.blocks.free() > 0
    }

    /// Whether so much is free that the members should be moved together.
    pub(crate) fn are_scattered(&self, arrays: &Arrays) -> bool {
        /// Below it, ranges cost nothing to search.
        const FEW_RANGES: usize = 64;
        let much = |room: &Room, all: usize| {
            4 * room.free() > all || room.ranges() > FEW_RANGES.max(self.all.len() / 8)
        };
        much(&self.nodes, arrays.nodes().len()) || much(&self.blocks, arrays.blocks().len())
    }

    /// Moves members down to where nothing is free before them. No nodes but theirs may be in the arrays. Linear in those that move.
    pub(crate) fn move_together(&mut self, arrays: &mut Arrays, at: State) {
        let before = self.all.to_vec();
        let mut members = before.clone();
        let mut numbers: Vec<usize> = (0..members.len()).collect();
        numbers.sort_unstable_by_key(|number| members[*number].first_node);
        let mut end = 0;
        for number in &numbers {
            let member = &mut members[*number];
            if member.nodes == 0 {
                continue;
            }
            arrays.nodes.move_down(member.nodes(), end, at);
            member.first_node = to_u32(end);
            end += member.nodes as usize;
        }
        arrays.nodes.truncate(end);
        numbers.sort_unstable_by_key(|number| members[*number].first_block);
        let mut end = 0;
        for number in numbers {
            let member = &mut members[number];
            if member.blocks == 0 {
                continue;
            }
            arrays.blocks.move_down(member.blocks(), end, at);
            member.first_block = to_u32(end);
            end += member.blocks as usize;
        }
        arrays.blocks.truncate(end);
        for (number, (before, mut member)) in before.iter().zip(members).enumerate() {
            if *before != member {
                member.rebase(before, arrays, at);
                self.all.put(number, &[member], at);
            }
        }
        (self.nodes, self.blocks) = Default::default();
    }
}

/// The place of so many elements: free, or behind all others at `end`. 0 for none of them, which is there whatever goes.
fn place(room: &mut Room, length: usize, end: usize) -> usize {
    match length {
        0 => 0,
        _ => room.take(length).unwrap_or(end),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::WideNode;

    /// A member of this number of nodes, each the parent of the next, and a block at the end.
    fn chain(nodes: usize) -> Arrays {
        let mut all = Vec::new();
        for place in 0..nodes {
            let mut node = WideNode::EMPTY;
            node.children[place % 8] = if place + 1 < nodes {
                Child::node(place + 1)
            } else {
                Child::leaf(0, 1)
            };
            all.push(node);
        }
        let mut block = Block::EMPTY;
        block.set(0, 0, [glam::Vec3::ZERO; 3]);
        Arrays::new(all, vec![block], Child::node(0))
    }

    /// Members, and their arrays.
    struct Forest {
        arrays: Arrays,
        members: Members,
    }

    impl Forest {
        fn new() -> Self {
            Self {
                arrays: Arrays::of_forest(),
                members: Members::new(),
            }
        }

        /// Adds a chain.
        fn push(&mut self, nodes: usize, slots: u32) -> usize {
            let from = chain(nodes);
            let member = Member::all_of(&from);
            self.members
                .push(&mut self.arrays, &from, &member, slots, State::next())
        }

        /// The lengths of chains and the slots of their triangles.
        fn follow<const N: usize>(&self, numbers: [usize; N]) -> [(usize, u32); N] {
            numbers.map(|number| follow(&self.arrays, self.members.all()[number].root()))
        }

        fn sizes(&self) -> (usize, usize) {
            (self.arrays.nodes().len(), self.arrays.blocks().len())
        }
    }

    /// Follows a chain down: its length, and the slot of its triangle.
    fn follow(arrays: &Arrays, mut child: Child) -> (usize, u32) {
        let mut length = 0;
        while !child.is_leaf() {
            let node = arrays.nodes()[child.index()];
            let lane = node.lanes().next().expect("one child");
            child = node.children[lane];
            length += 1;
        }
        (length, arrays.blocks()[child.blocks().start].triangles[0])
    }

    #[test]
    fn members_are_copied_unchanged() {
        let mut forest = Forest::new();
        for (nodes, slots) in [(2, 0), (9, 10), (4, 20)] {
            forest.push(nodes, slots);
        }
        assert_eq!(
            forest.follow([0, 1, 2]),
            [(2, 0), (9, 10), (4, 20)],
            "one after the other"
        );
        let mut others = Forest::new();
        let at = State::next();
        for number in [2, 1] {
            let member = forest.members.all()[number];
            let to = &mut others.arrays;
            others.members.push(to, &forest.arrays, &member, 0, at);
        }
        others.members.push_again(&mut others.arrays, 1, at);
        others.members.add_to_slots(&mut others.arrays, 1, 5, at);
        assert_eq!(
            others.follow([0, 1, 2]),
            [(4, 20), (9, 15), (9, 10)],
            "copied, with new numbers"
        );
    }

    #[test]
    fn removed_members_leave_room() {
        let mut forest = Forest::new();
        for (nodes, slots) in [(2, 0), (9, 10), (4, 20)] {
            forest.push(nodes, slots);
        }
        forest.members.remove(1, State::next());
        assert_eq!(forest.members.count(), 2, "one less");
        assert_eq!(forest.push(3, 7), 1, "the number that is free");
        assert_eq!(forest.push(5, 8), 3, "the next one");
        assert_eq!(
            forest.sizes(),
            (15, 4),
            "3 of the 9 nodes, 5 of the other 6"
        );
        assert_eq!(
            forest.follow([0, 1, 2, 3]),
            [(2, 0), (3, 7), (4, 20), (5, 8)],
            "nothing else changed"
        );
        for number in [0, 1, 2] {
            forest.members.remove(number, State::next());
        }
        assert!(
            forest.members.are_scattered(&forest.arrays),
            "5 nodes of 15"
        );
        forest
            .members
            .move_together(&mut forest.arrays, State::next());
        assert_eq!(forest.sizes(), (5, 1), "together");
        assert_eq!(forest.follow([3]), [(5, 8)], "the same chain");
        forest.members.remove(3, State::next());
        forest.members.trim(&mut forest.arrays);
        assert_eq!(forest.sizes(), (0, 0), "nothing is left");
    }
}
