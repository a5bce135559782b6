//! A tree under construction: new nodes over subtrees of an arena.

use kd_core::{Arena, Axis, Node, NodeIndex, NodeView, Pair, Slot, TreeError};
use kd_sah::BuildError;

use crate::{Census, Merged};

/// New nodes and references. The arena is unchanged until they are [written](Fresh::write).
///
/// A *fork* is a draft over a base draft, which stays unchanged: threads add nodes to forks of one base.
#[derive(Debug)]
pub(crate) struct Draft<'a> {
    arena: &'a Arena,
    census: Option<&'a Census>,
    /// The draft that this fork extends. Forks on other threads may share it.
    base: Option<&'a Self>,
    fresh: Fresh,
    pub(crate) counts: Counts,
}

/// New nodes and references, not yet written to an arena.
#[derive(Debug, Default)]
pub(crate) struct Fresh {
    /// The number of the first node here. Lower numbers belong to the base.
    first_node: u32,
    /// The number of the first reference here. Lower numbers belong to the base.
    first_ref: u32,
    nodes: Vec<NewNode>,
    /// The number of levels below each node.
    heights: Vec<usize>,
    /// The number of references below each node.
    references: Vec<u32>,
    refs: Vec<Slot>,
}

/// Operations counted for [`Merged`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) cut: usize,
    pub(crate) dissolved: usize,
    pub(crate) rebuilt: usize,
}

/// A subtree of a draft.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Subtree {
    /// A subtree of the arena, by the index of its root. It is shared.
    Linked(NodeIndex),
    /// A subtree whose root is a new node, by the number of that node.
    New(u32),
    /// A leaf without references.
    Empty,
}

/// A new node.
#[derive(Clone, Copy, Debug)]
enum NewNode {
    Split {
        axis: Axis,
        split: f32,
        children: [Subtree; 2],
    },
    /// A range of the new references.
    Leaf { first: u32, count: u32 },
}

/// The root of a subtree, linked or new.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SubtreeView {
    Split {
        axis: Axis,
        split: f32,
        /// The lower one first.
        children: [Subtree; 2],
    },
    Leaf(Leaf),
}

/// A range of references, of the arena or of the draft.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leaf {
    is_new: bool,
    first: usize,
    count: usize,
}

impl<'a> Draft<'a> {
    /// An empty draft.
    pub(crate) fn new(arena: &'a Arena) -> Self {
        Self {
            arena,
            census: None,
            base: None,
            fresh: Fresh::default(),
            counts: Counts::default(),
        }
    }

    /// An empty draft that knows the number of references below each node of the arena.
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

    /// The root of a subtree.
    pub(crate) fn view(&self, subtree: Subtree) -> SubtreeView {
        match subtree {
            Subtree::Linked(index) => match self.arena.nodes()[index.index()].view() {
                NodeView::Interior { axis, split, first } => SubtreeView::Split {
                    axis,
                    split,
                    children: [first, first.sibling()].map(Subtree::Linked),
                },
                NodeView::Leaf { first, count } => SubtreeView::Leaf(Leaf {
                    is_new: false,
                    first: first as usize,
                    count: count as usize,
                }),
            },
            Subtree::New(number) => match *self.fresh_with(number).node(number) {
                NewNode::Split {
                    axis,
                    split,
                    children,
                } => SubtreeView::Split {
                    axis,
                    split,
                    children,
                },
                NewNode::Leaf { first, count } => SubtreeView::Leaf(Leaf {
                    is_new: true,
                    first: first as usize,
                    count: count as usize,
                }),
            },
            Subtree::Empty => SubtreeView::Leaf(Leaf {
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

    /// Adds a leaf; [`Subtree::Empty`] without references.
    pub(crate) fn leaf(&mut self, refs: &[Slot]) -> Subtree {
        if refs.is_empty() {
            return Subtree::Empty;
        }
        let (first, count) = (self.fresh.next_ref(), to_u32(refs.len()));
        self.fresh.refs.extend_from_slice(refs);
        self.add(NewNode::Leaf { first, count }, 0, count)
    }

    /// Adds an interior node; [`Subtree::Empty`] if both children are empty.
    pub(crate) fn split(&mut self, axis: Axis, split: f32, children: [Subtree; 2]) -> Subtree {
        if children.iter().all(|child| self.is_empty(*child)) {
            return Subtree::Empty;
        }
        let heights = children.map(|child| self.height(child));
        let references = children.map(|child| self.references(child));
        self.add(
            NewNode::Split {
                axis,
                split,
                children,
            },
            1 + heights[0].max(heights[1]),
            references[0].saturating_add(references[1]),
        )
    }

    /// The number of levels below the root of a subtree, 0 for a leaf.
    pub(crate) fn height(&self, subtree: Subtree) -> usize {
        match subtree {
            Subtree::Linked(index) => {
                let height = self.arena.height(index);
                usize::from(height.expect("linked nodes are frozen"))
            }
            Subtree::New(number) => self.fresh_with(number).height(number),
            Subtree::Empty => 0,
        }
    }

    /// The number of references of a subtree. Without a census, linked subtrees count 0.
    pub(crate) fn references(&self, subtree: Subtree) -> u32 {
        match subtree {
            Subtree::Linked(index) => self.census.map_or(0, |census| census.references(index)),
            Subtree::New(number) => self.fresh_with(number).references(number),
            Subtree::Empty => 0,
        }
    }

    /// All slots that the leaves of some subtrees refer to, sorted, each once.
    pub(crate) fn slots(&self, subtrees: impl IntoIterator<Item = Subtree>) -> Vec<Slot> {
        let mut slots = Vec::new();
        for subtree in subtrees {
            self.collect(subtree, &mut slots);
        }
        slots.sort_unstable();
        slots.dedup();
        slots
    }

    /// Appends all references of a subtree to a list.
    fn collect(&self, subtree: Subtree, to: &mut Vec<Slot>) {
        match self.view(subtree) {
            SubtreeView::Leaf(leaf) => to.extend_from_slice(self.refs_of(leaf)),
            SubtreeView::Split { children, .. } => {
                for child in children {
                    self.collect(child, to);
                }
            }
        }
    }

    /// Whether a subtree is a leaf without references.
    pub(crate) fn is_empty(&self, subtree: Subtree) -> bool {
        matches!(self.view(subtree), SubtreeView::Leaf(Leaf { count: 0, .. }))
    }

    fn add(&mut self, node: NewNode, height: usize, references: u32) -> Subtree {
        let number = self.fresh.next_node();
        self.fresh.nodes.push(node);
        self.fresh.heights.push(height);
        self.fresh.references.push(references);
        Subtree::New(number)
    }

    /// The list that holds the new node `number`: that of this fork or of one of its bases.
    fn fresh_with(&self, number: u32) -> &Fresh {
        let mut draft = self;
        while let Some(base) = draft.base
            && number < draft.fresh.first_node
        {
            draft = base;
        }
        &draft.fresh
    }

    /// Makes two subtrees, on two threads if `is_parallel`. The result is identical, down to the numbers of nodes.
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

    /// Runs `work` on a fork of this draft and returns the nodes that it added.
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

    /// Appends the nodes of a fork and returns its subtree, renumbered.
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
                NewNode::Split {
                    axis,
                    split,
                    children,
                } => NewNode::Split {
                    axis,
                    split,
                    children: children.map(moved),
                },
                NewNode::Leaf { first, count } => NewNode::Leaf {
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

    /// Ends the borrow of the arena.
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
    u32::try_from(count).expect("an arena has fewer than 2^32 references")
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

    fn node(&self, number: u32) -> &NewNode {
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

    /// Appends the subtree `root` to the arena as a fresh tree.
    ///
    /// # Errors
    ///
    /// [`TreeError::TooLarge`] if it does not fit. Nodes may have been written by then; they are fresh and can be truncated.
    pub(crate) fn write(
        &self,
        counts: Counts,
        arena: &mut Arena,
        root: Subtree,
    ) -> Result<Merged, TreeError> {
        let index = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
        let mut merged = Merged {
            root: index,
            new_nodes: 0,
            new_references: 0,
            links: 0,
            cut: counts.cut,
            dissolved: counts.dissolved,
            rebuilt: counts.rebuilt,
        };
        let node = self.write_node(arena, root, &mut merged)?;
        arena.set(index, node);
        Ok(merged)
    }

    /// Writes everything below a subtree's root and returns the root, which is not yet written.
    fn write_node(
        &self,
        arena: &mut Arena,
        subtree: Subtree,
        merged: &mut Merged,
    ) -> Result<Node, TreeError> {
        let number = match subtree {
            Subtree::Empty => return Ok(Node::EMPTY_LEAF),
            Subtree::Linked(index) => {
                merged.links += 1;
                return Ok(arena.nodes()[index.index()]);
            }
            Subtree::New(number) => number,
        };
        merged.new_nodes += 1;
        match *self.node(number) {
            NewNode::Leaf { first, count } => {
                merged.new_references += count as usize;
                let refs = self.refs(first as usize, count as usize);
                let first = arena.push_refs(refs)?;
                Ok(Node::leaf(first, count).expect("a leaf has fewer than 2^30 references"))
            }
            NewNode::Split {
                axis,
                split,
                children,
            } => {
                let first = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
                for (index, child) in [first, first.sibling()].into_iter().zip(children) {
                    let node = self.write_node(arena, child, merged)?;
                    arena.set(index, node);
                }
                Ok(Node::interior(axis, split, first).expect("indices of the arena fit"))
            }
        }
    }
}
