//! A tree while it is put together: new nodes over subtrees that lie in an arena already.

use kd_core::{Arena, Axis, Node, NodeIndex, NodeView, Pair, Slot, TreeError};
use kd_sah::BuildError;

use crate::{Census, Merged};

/// New nodes and references. Nothing of the arena is changed until they are [written](Fresh::write).
#[derive(Debug)]
pub(crate) struct Draft<'a> {
    arena: &'a Arena,
    census: Option<&'a Census>,
    /// What this one goes on from, which other threads go on from too.
    base: Option<&'a Self>,
    fresh: Fresh,
    pub(crate) counts: Counts,
}

/// New nodes and references, apart from the arena that they are to go to.
#[derive(Debug, Default)]
pub(crate) struct Fresh {
    /// The numbers of the first node and the first reference here: those before are the base's.
    first_node: u32,
    first_ref: u32,
    nodes: Vec<New>,
    /// Levels and references below each.
    heights: Vec<usize>,
    references: Vec<u32>,
    refs: Vec<Slot>,
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

impl<'a> Draft<'a> {
    pub(crate) fn new(arena: &'a Arena) -> Self {
        Self {
            arena,
            census: None,
            base: None,
            fresh: Fresh::default(),
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
            Subtree::New(number) => match *self.fresh_with(number).node(number) {
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
        if !leaf.is_new {
            return &self.arena.refs()[leaf.first..][..leaf.count];
        }
        let mut draft = self;
        while let Some(base) = draft.base
            && leaf.first < draft.fresh.first_ref as usize
        {
            draft = base;
        }
        draft.fresh.refs(leaf.first, leaf.count)
    }

    /// A new leaf.
    pub(crate) fn leaf(&mut self, refs: &[Slot]) -> Subtree {
        if refs.is_empty() {
            return Subtree::Empty;
        }
        let (first, count) = (self.fresh.next_ref(), to_u32(refs.len()));
        self.fresh.refs.extend_from_slice(refs);
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
            Subtree::New(number) => self.fresh_with(number).height(number),
            Subtree::Empty => 0,
        }
    }

    /// References below a subtree; of those that are linked only with a census.
    pub(crate) fn references(&self, subtree: Subtree) -> u32 {
        match subtree {
            Subtree::Linked(place) => self.census.map_or(0, |census| census.references(place)),
            Subtree::New(number) => self.fresh_with(number).references(number),
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
        let number = self.fresh.next_node();
        self.fresh.nodes.push(node);
        self.fresh.heights.push(height);
        self.fresh.references.push(references);
        Subtree::New(number)
    }

    /// Those new nodes that a node is among.
    fn fresh_with(&self, number: u32) -> &Fresh {
        let mut draft = self;
        while let Some(base) = draft.base
            && number < draft.fresh.first_node
        {
            draft = base;
        }
        &draft.fresh
    }

    /// Makes two subtrees, on two threads if `is_parallel`. What comes out is the same, number by number.
    pub(crate) fn both(
        &mut self,
        is_parallel: bool,
        a: impl FnOnce(&mut Draft<'_>) -> Result<Subtree, BuildError> + Send,
        b: impl FnOnce(&mut Draft<'_>) -> Result<Subtree, BuildError> + Send,
    ) -> Result<[Subtree; 2], BuildError> {
        if !is_parallel {
            return Ok([a(self)?, b(self)?]);
        }
        let base = &*self;
        let (a, b) = kd_tasks::join(|| base.with_fork(a), |_| base.with_fork(b));
        Ok([self.absorb(a?), self.absorb(b?)])
    }

    /// What is made by going on from here, without changing what is here.
    fn with_fork(
        &self,
        work: impl FnOnce(&mut Draft<'_>) -> Result<Subtree, BuildError>,
    ) -> Result<(Fresh, Counts, Subtree), BuildError> {
        let mut fork = Draft {
            arena: self.arena,
            census: self.census,
            base: Some(self),
            fresh: Fresh {
                first_node: self.fresh.next_node(),
                first_ref: self.fresh.next_ref(),
                ..Fresh::default()
            },
            counts: Counts::default(),
        };
        let subtree = work(&mut fork)?;
        Ok((fork.fresh, fork.counts, subtree))
    }

    /// Appends what was made by going on from here.
    fn absorb(&mut self, (other, counts, root): (Fresh, Counts, Subtree)) -> Subtree {
        let fresh = &mut self.fresh;
        let node_shift = fresh.next_node() - other.first_node;
        let ref_shift = fresh.next_ref() - other.first_ref;
        let moved = |subtree| match subtree {
            Subtree::New(number) if number >= other.first_node => Subtree::New(number + node_shift),
            subtree => subtree,
        };
        fresh
            .nodes
            .extend(other.nodes.into_iter().map(|node| match node {
                New::Split { axis, split, parts } => New::Split {
                    axis,
                    split,
                    parts: parts.map(moved),
                },
                New::Leaf { first, count } => New::Leaf {
                    first: first + ref_shift,
                    count,
                },
            }));
        fresh.heights.extend(other.heights);
        fresh.references.extend(other.references);
        fresh.refs.extend(other.refs);
        self.counts.add(counts);
        moved(root)
    }

    /// Lets go of the arena.
    pub(crate) fn finish(self) -> (Fresh, Counts) {
        (self.fresh, self.counts)
    }
}

impl Counts {
    fn add(&mut self, other: Self) {
        self.cut += other.cut;
        self.dissolved += other.dissolved;
        self.rebuilt += other.rebuilt;
    }
}

fn to_u32(count: usize) -> u32 {
    u32::try_from(count).expect("fewer than 2^32 references, as in an arena")
}

impl Fresh {
    /// The number of the next node.
    fn next_node(&self) -> u32 {
        self.first_node + to_u32(self.nodes.len())
    }

    /// The number of the next reference.
    fn next_ref(&self) -> u32 {
        self.first_ref + to_u32(self.refs.len())
    }

    fn node(&self, number: u32) -> &New {
        &self.nodes[(number - self.first_node) as usize]
    }

    fn height(&self, number: u32) -> usize {
        self.heights[(number - self.first_node) as usize]
    }

    fn references(&self, number: u32) -> u32 {
        self.references[(number - self.first_node) as usize]
    }

    fn refs(&self, first: usize, count: usize) -> &[Slot] {
        &self.refs[first - self.first_ref as usize..][..count]
    }

    /// Appends what is below `root` to the arena, as a tree of its own, and gives its place.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if it does not fit. A part may have been written then; it is fresh, and can be truncated.
    pub(crate) fn write(
        &self,
        counts: Counts,
        arena: &mut Arena,
        root: Subtree,
    ) -> Result<Merged, TreeError> {
        let place = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
        let mut merged = Merged {
            root: place,
            new_nodes: 0,
            new_references: 0,
            links: 0,
            cut: counts.cut,
            dissolved: counts.dissolved,
            rebuilt: counts.rebuilt,
        };
        let node = self.write_node(arena, root, &mut merged)?;
        arena.set(place, node);
        Ok(merged)
    }

    /// A node whose children have been written.
    fn write_node(
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
        match *self.node(number) {
            New::Leaf { first, count } => {
                merged.new_references += count as usize;
                let refs = self.refs(first as usize, count as usize);
                let first = arena.push_refs(refs)?;
                Ok(Node::leaf(first, count).expect("as many as an arena has, which are fewer"))
            }
            New::Split { axis, split, parts } => {
                let place = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
                for (child, part) in [place, place.sibling()].into_iter().zip(parts) {
                    let node = self.write_node(arena, part, merged)?;
                    arena.set(child, node);
                }
                Ok(Node::interior(axis, split, place).expect("the arena has given the place"))
            }
        }
    }
}
