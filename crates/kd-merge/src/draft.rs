//! A tree while it is put together: new nodes over subtrees that lie in an arena already.

use kd_core::{Arena, Axis, Node, NodeIndex, NodeView, Pair, Slot, TreeError};

use crate::{Census, Merged};

/// New nodes and references. Nothing of the arena is changed until they are [written](Finished::write).
#[derive(Debug)]
pub(crate) struct Draft<'a> {
    arena: &'a Arena,
    census: Option<&'a Census>,
    new_nodes: Vec<New>,
    /// Levels and references below each.
    heights: Vec<usize>,
    references: Vec<u32>,
    new_refs: Vec<Slot>,
    pub(crate) counts: Counts,
}

/// What was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) cut: usize,
    pub(crate) dissolved: usize,
    pub(crate) rebuilt: usize,
}

/// A subtree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subtree {
    /// One of the arena, as it is.
    Linked(NodeIndex),
    /// One below a new node, by its number.
    New(u32),
    /// A leaf without references.
    Empty,
}

/// A new node.
#[derive(Clone, Copy, Debug)]
enum New {
    Split {
        axis: Axis,
        split: f32,
        parts: [Subtree; 2],
    },
    /// Of the new references.
    Leaf { first: u32, count: u32 },
}

/// What a subtree consists of.
#[derive(Clone, Copy, Debug)]
pub(crate) enum View {
    Split {
        axis: Axis,
        split: f32,
        /// The lower one first.
        parts: [Subtree; 2],
    },
    Leaf(Leaf),
}

/// Some references.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaf {
    is_new: bool,
    first: usize,
    count: usize,
}

/// New nodes and references of a [`Draft`], apart from the arena that they are to go to.
#[derive(Debug)]
pub(crate) struct Finished {
    new_nodes: Vec<New>,
    new_refs: Vec<Slot>,
    counts: Counts,
}

impl<'a> Draft<'a> {
    pub(crate) fn new(arena: &'a Arena) -> Self {
        Self {
            arena,
            census: None,
            new_nodes: Vec::new(),
            heights: Vec::new(),
            references: Vec::new(),
            new_refs: Vec::new(),
            counts: Counts::default(),
        }
    }

    /// One that knows how many references there are.
    pub(crate) fn with_census(arena: &'a Arena, census: &'a Census) -> Self {
        Self {
            census: Some(census),
            ..Self::new(arena)
        }
    }

    pub(crate) fn arena(&self) -> &'a Arena {
        self.arena
    }

    pub(crate) fn census(&self) -> Option<&'a Census> {
        self.census
    }

    /// What a subtree consists of.
    pub(crate) fn view(&self, subtree: Subtree) -> View {
        match subtree {
            Subtree::Linked(place) => match self.arena.nodes()[place.index()].view() {
                NodeView::Interior { axis, split, first } => View::Split {
                    axis,
                    split,
                    parts: [first, first.sibling()].map(Subtree::Linked),
                },
                NodeView::Leaf { first, count } => View::Leaf(Leaf {
                    is_new: false,
                    first: first as usize,
                    count: count as usize,
                }),
            },
            Subtree::New(number) => match self.new_nodes[number as usize] {
                New::Split { axis, split, parts } => View::Split { axis, split, parts },
                New::Leaf { first, count } => View::Leaf(Leaf {
                    is_new: true,
                    first: first as usize,
                    count: count as usize,
                }),
            },
            Subtree::Empty => View::Leaf(Leaf {
                is_new: true,
                first: 0,
                count: 0,
            }),
        }
    }

    pub(crate) fn refs_of(&self, leaf: Leaf) -> &[Slot] {
        let refs = if leaf.is_new {
            &self.new_refs
        } else {
            self.arena.refs()
        };
        &refs[leaf.first..][..leaf.count]
    }

    /// A new leaf.
    pub(crate) fn leaf(&mut self, refs: &[Slot]) -> Subtree {
        if refs.is_empty() {
            return Subtree::Empty;
        }
        let (first, count) = (to_u32(self.new_refs.len()), to_u32(refs.len()));
        self.new_refs.extend_from_slice(refs);
        self.add(New::Leaf { first, count }, 0, count)
    }

    /// A new node, or nothing over nothing.
    pub(crate) fn split(&mut self, axis: Axis, split: f32, parts: [Subtree; 2]) -> Subtree {
        if parts.iter().all(|part| self.is_empty(*part)) {
            return Subtree::Empty;
        }
        let heights = parts.map(|part| self.height(part));
        let references = parts.map(|part| self.references(part));
        self.add(
            New::Split { axis, split, parts },
            1 + heights[0].max(heights[1]),
            references[0].saturating_add(references[1]),
        )
    }

    /// Levels below a subtree, 0 for a leaf.
    pub(crate) fn height(&self, subtree: Subtree) -> usize {
        match subtree {
            Subtree::Linked(place) => {
                let height = self.arena.height(place);
                usize::from(height.expect("what is linked is frozen"))
            }
            Subtree::New(number) => self.heights[number as usize],
            Subtree::Empty => 0,
        }
    }

    /// References below a subtree; of those that are linked only with a census.
    pub(crate) fn references(&self, subtree: Subtree) -> u32 {
        match subtree {
            Subtree::Linked(place) => self.census.map_or(0, |census| census.references(place)),
            Subtree::New(number) => self.references[number as usize],
            Subtree::Empty => 0,
        }
    }

    /// All references below some subtrees, each slot once, in order.
    pub(crate) fn slots(&self, subtrees: impl IntoIterator<Item = Subtree>) -> Vec<Slot> {
        let mut slots = Vec::new();
        for subtree in subtrees {
            self.collect(subtree, &mut slots);
        }
        slots.sort_unstable();
        slots.dedup();
        slots
    }

    /// Adds all references below a subtree to a list.
    fn collect(&self, subtree: Subtree, to: &mut Vec<Slot>) {
        match self.view(subtree) {
            View::Leaf(leaf) => to.extend_from_slice(self.refs_of(leaf)),
            View::Split { parts, .. } => {
                for part in parts {
                    self.collect(part, to);
                }
            }
        }
    }

    /// Whether it is a leaf without references.
    pub(crate) fn is_empty(&self, subtree: Subtree) -> bool {
        matches!(self.view(subtree), View::Leaf(Leaf { count: 0, .. }))
    }

    fn add(&mut self, node: New, height: usize, references: u32) -> Subtree {
        self.new_nodes.push(node);
        self.heights.push(height);
        self.references.push(references);
        Subtree::New(to_u32(self.new_nodes.len() - 1))
    }

    /// Lets go of the arena.
    pub(crate) fn finish(self) -> Finished {
        Finished {
            new_nodes: self.new_nodes,
            new_refs: self.new_refs,
            counts: self.counts,
        }
    }
}

fn to_u32(count: usize) -> u32 {
    u32::try_from(count).expect("fewer than 2^32 references, as in an arena")
}

impl Finished {
    /// Appends what is below `root` to the arena, as a tree of its own, and gives its place.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if it does not fit. A part may have been written then; it is fresh, and can be truncated.
    pub(crate) fn write(&self, arena: &mut Arena, root: Subtree) -> Result<Merged, TreeError> {
        let place = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
        let mut merged = Merged {
            root: place,
            new_nodes: 0,
            new_references: 0,
            links: 0,
            cut: self.counts.cut,
            dissolved: self.counts.dissolved,
            rebuilt: self.counts.rebuilt,
        };
        let node = self.node(arena, root, &mut merged)?;
        arena.set(place, node);
        Ok(merged)
    }

    /// A node whose children have been written.
    fn node(
        &self,
        arena: &mut Arena,
        subtree: Subtree,
        merged: &mut Merged,
    ) -> Result<Node, TreeError> {
        let number = match subtree {
            Subtree::Empty => return Ok(Node::EMPTY_LEAF),
            Subtree::Linked(place) => {
                merged.links += 1;
                return Ok(arena.nodes()[place.index()]);
            }
            Subtree::New(number) => number,
        };
        merged.new_nodes += 1;
        match self.new_nodes[number as usize] {
            New::Leaf { first, count } => {
                merged.new_references += count as usize;
                let refs = &self.new_refs[first as usize..][..count as usize];
                let first = arena.push_refs(refs)?;
                Ok(Node::leaf(first, count).expect("as many as an arena has, which are fewer"))
            }
            New::Split { axis, split, parts } => {
                let place = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
                for (child, part) in [place, place.sibling()].into_iter().zip(parts) {
                    let node = self.node(arena, part, merged)?;
                    arena.set(child, node);
                }
                Ok(Node::interior(axis, split, place).expect("the arena has given the place"))
            }
        }
    }
}
