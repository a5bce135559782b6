//! The members of a forest, one after another in the same arrays, and the top over them.

use std::ops::Range;

use super::Arrays;
use crate::block::Block;
use crate::large_pages;
use crate::node::{Child, WideNode};

/// A range of nodes and a range of blocks. The nodes refer to these ranges only.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Member {
    nodes: Range<usize>,
    blocks: Range<usize>,
    root: Child,
}

impl Member {
    /// A node, or [`Child::NOTHING`].
    pub(crate) fn root(&self) -> Child {
        self.root
    }

    pub(crate) fn nodes(&self) -> Range<usize> {
        self.nodes.clone()
    }

    pub(crate) fn blocks(&self) -> Range<usize> {
        self.blocks.clone()
    }
}

impl Arrays {
    pub(crate) const fn empty() -> Self {
        Self {
            nodes: Vec::new(),
            blocks: Vec::new(),
            root: Child::NOTHING,
            members: Vec::new(),
        }
    }

    pub(crate) fn members(&self) -> &[Member] {
        &self.members
    }

    /// All of a tree that was not joined, as a member.
    ///
    /// # Panics
    ///
    /// If the tree was joined.
    pub(crate) fn as_member(&self) -> Member {
        assert!(self.members.is_empty(), "a tree that was not joined");
        Member {
            nodes: 0..self.nodes.len(),
            blocks: 0..self.blocks.len(),
            root: self.root,
        }
    }

    /// The number of nodes of all members.
    pub(crate) fn nodes_of_members(&self) -> usize {
        self.members.last().map_or(0, |member| member.nodes.end)
    }

    /// Drops the top. Rays hit nothing until there is a new one.
    pub(crate) fn clear_top(&mut self) {
        self.nodes.truncate(self.nodes_of_members());
        self.root = Child::NOTHING;
    }

    /// Puts the top over the members: nodes that follow theirs.
    ///
    /// # Panics
    ///
    /// If a child is not among the nodes and blocks.
    pub(crate) fn set_top(&mut self, top: &[WideNode], root: Child) {
        self.clear_top();
        let nodes = self.nodes.len() + top.len();
        let blocks = self.blocks.len();
        let mut children = top.iter().flat_map(|node| node.children);
        let all_are_there = children.all(|child| child.is_within(nodes, blocks));
        assert!(
            all_are_there && root.is_within(nodes, blocks),
            "every child is a node or blocks of the same tree"
        );
        self.nodes.extend_from_slice(top);
        self.root = root;
    }

    /// Copies a member of other arrays behind the last one, and adds `slots` to the slots of its triangles. Drops the top.
    pub(crate) fn push_member(&mut self, from: &Self, member: &Member, slots: u32) {
        self.clear_top();
        let (nodes, blocks) = (self.nodes.len(), self.blocks.len());
        let by = (
            nodes.wrapping_sub(member.nodes.start),
            blocks.wrapping_sub(member.blocks.start),
        );
        reserve(&mut self.nodes, member.nodes.len());
        reserve(&mut self.blocks, member.blocks.len());
        self.nodes.extend_from_slice(&from.nodes[member.nodes()]);
        self.blocks.extend_from_slice(&from.blocks[member.blocks()]);
        self.end_member(member.root, by);
        self.add_to_slots(self.members.len() - 1, slots);
    }

    /// Copies one of the members behind the last one. Drops the top.
    pub(crate) fn push_again(&mut self, number: usize) {
        self.clear_top();
        let member = self.members[number].clone();
        let by = (
            self.nodes.len() - member.nodes.start,
            self.blocks.len() - member.blocks.start,
        );
        reserve(&mut self.nodes, member.nodes.len());
        reserve(&mut self.blocks, member.blocks.len());
        self.nodes.extend_from_within(member.nodes());
        self.blocks.extend_from_within(member.blocks());
        self.end_member(member.root, by);
    }

    /// Makes a member of the nodes and blocks behind the last one, whose indices moved `by` these numbers.
    fn end_member(&mut self, root: Child, by: (usize, usize)) {
        let last = self.members.last();
        let (nodes, blocks) = last.map_or((0, 0), |member| (member.nodes.end, member.blocks.end));
        if by != (0, 0) {
            let added = &mut self.nodes[nodes..];
            for child in added.iter_mut().flat_map(|node| &mut node.children) {
                *child = child.moved(by.0, by.1);
            }
        }
        self.members.push(Member {
            nodes: nodes..self.nodes.len(),
            blocks: blocks..self.blocks.len(),
            root: root.moved(by.0, by.1),
        });
    }

    /// Adds to the slots of all triangles of a member, modulo 2³².
    pub(crate) fn add_to_slots(&mut self, number: usize, slots: u32) {
        if slots == 0 {
            return;
        }
        let blocks = &mut self.blocks[self.members[number].blocks()];
        for slot in blocks.iter_mut().flat_map(Block::slots_mut) {
            *slot = slot.wrapping_add(slots);
        }
    }

    /// Removes the members from a number on. Drops the top.
    pub(crate) fn truncate_members(&mut self, number: usize) {
        self.clear_top();
        self.members.truncate(number);
        self.nodes.truncate(self.nodes_of_members());
        let blocks = self.members.last().map_or(0, |member| member.blocks.end);
        self.blocks.truncate(blocks);
    }
}

/// Reserves an eighth more than needed. (Doubling would waste as much memory as a large static scene takes.)
fn reserve<T>(all: &mut Vec<T>, more: usize) {
    let len = all.len() + more;
    if len > all.capacity() {
        all.reserve_exact(more + len / 8);
        large_pages::advise(all);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// Follows a chain down: its length, and the slot of its triangle.
    fn follow(arrays: &Arrays, number: usize) -> (usize, u32) {
        let mut child = arrays.members()[number].root();
        let mut length = 0;
        while !child.is_leaf() {
            let node = arrays.nodes()[child.index()];
            let lane = node.lanes().next().expect("one child");
            child = node.children[lane];
            length += 1;
        }
        (length, arrays.blocks()[child.blocks().start].triangles[0])
    }

    fn push(arrays: &mut Arrays, nodes: usize, slots: u32) {
        let from = chain(nodes);
        arrays.push_member(&from, &from.as_member(), slots);
    }

    #[test]
    fn members_are_copied_unchanged() {
        let mut arrays = Arrays::empty();
        for (nodes, slots) in [(2, 0), (9, 10), (4, 20)] {
            push(&mut arrays, nodes, slots);
        }
        assert_eq!(
            [0, 1, 2].map(|number| follow(&arrays, number)),
            [(2, 0), (9, 10), (4, 20)],
            "one after the other"
        );
        let mut others = Arrays::empty();
        for number in [2, 1] {
            others.push_member(&arrays, &arrays.members()[number], 0);
        }
        others.push_again(0);
        others.add_to_slots(1, 5);
        assert_eq!(
            [0, 1, 2].map(|number| follow(&others, number)),
            [(4, 20), (9, 15), (4, 20)],
            "copied, with new numbers"
        );
        arrays.truncate_members(1);
        push(&mut arrays, 3, 7);
        assert_eq!(
            [0, 1].map(|number| follow(&arrays, number)),
            [(2, 0), (3, 7)],
            "one in place of two"
        );
        assert_eq!(
            (arrays.nodes().len(), arrays.blocks().len()),
            (5, 2),
            "the others are removed"
        );
    }

    #[test]
    fn changing_members_drops_the_top() {
        let mut arrays = Arrays::empty();
        push(&mut arrays, 2, 0);
        let mut top = WideNode::EMPTY;
        top.children[0] = arrays.members()[0].root();
        arrays.set_top(&[top], Child::node(2));
        assert_eq!(arrays.nodes().len(), 3, "over the member");
        push(&mut arrays, 3, 0);
        assert_eq!(
            (arrays.root(), arrays.nodes().len()),
            (Child::NOTHING, 5),
            "gone"
        );
    }

    #[test]
    #[should_panic(expected = "every child is a node or blocks of the same tree")]
    fn a_top_over_missing_nodes_is_refused() {
        let mut top = WideNode::EMPTY;
        top.children[2] = Child::node(1);
        Arrays::empty().set_top(&[top], Child::node(0));
    }
}
