//! Emit: wide nodes and blocks from a collapsed tree of boxes.
//!
//! Nodes are stored in depth-first order, blocks in the order of their leaves. They are counted first, so that any number of
//! threads writes each at its final place. Leaves are blocks of [triangles](Triangles) or of [boxes](Boxes), or finished subtrees.
//!
//! The children of a node are in lanes by their [`Prospect`]: an any-hit ray visits the last lane first.

mod prospect;

use std::sync::atomic::{AtomicU32, Ordering};

use kd_buffer::advise_large_pages;
use kd_core::{Aabb, Mesh};
use kd_simd::LANES;
use kd_tasks::{Share, Tracker};
use smallvec::SmallVec;

use crate::block::Block;
use crate::box_tree::{BoxTree, Kind, to_u32};
use crate::node::{Child, WIDTH, WideNode};
use crate::work::Work;
use prospect::Prospect;

/// As many as a node has children, without an allocation.
type Few<T> = SmallVec<[T; WIDTH]>;

/// Items of a subtree that are worth a task for counting.
const COUNT_TASK: usize = 1 << 12;

/// Triangles that fit one leaf.
const MOST_TRIANGLES: usize = Child::MOST_BLOCKS as usize * LANES;

/// Numbers of nodes and blocks of a subtree.
#[derive(Clone, Copy, Debug, Default)]
struct Counts {
    nodes: usize,
    blocks: usize,
}

impl Counts {
    fn add(&mut self, other: Self) {
        self.nodes += other.nodes;
        self.blocks += other.blocks;
    }
}

/// Counts that one thread writes before another one reads them.
#[derive(Debug, Default)]
struct SharedCounts {
    nodes: AtomicU32,
    blocks: AtomicU32,
}

impl SharedCounts {
    fn set(&self, counts: Counts) {
        self.nodes.store(to_u32(counts.nodes), Ordering::Relaxed);
        self.blocks.store(to_u32(counts.blocks), Ordering::Relaxed);
    }

    fn get(&self) -> Counts {
        Counts {
            nodes: self.nodes.load(Ordering::Relaxed) as usize,
            blocks: self.blocks.load(Ordering::Relaxed) as usize,
        }
    }
}

/// How leaves are written.
trait WriteLeaves: Sync {
    fn counts(&self, items: &[u32]) -> Counts;

    /// Writes a leaf to exactly the space that it needs.
    fn write(&self, items: &[u32], bounds: Aabb, space: Space<'_>) -> Child;

    /// Of the leaf.
    fn prospect(&self, items: &[u32]) -> Prospect;
}

/// How the items of a leaf become blocks.
pub(crate) trait WriteBlocks: Sync {
    /// The block of up to eight items.
    fn block(&self, items: &[u32]) -> Block;

    /// [`block`](Self::block) for items that are in no leaf of the boxes.
    fn block_aside(&self, items: &[u32]) -> Block {
        self.block(items)
    }

    /// Of a leaf of any number of items.
    fn prospect(&self, items: &[u32]) -> Prospect;
}

/// The triangles of a mesh.
pub(crate) struct Triangles<'a> {
    pub(crate) mesh: &'a Mesh,
    /// Whether each of those in leaves of the boxes has an area. Those aside have none.
    pub(crate) all_have_area: bool,
}

/// Items in boxes.
pub(crate) struct Boxes<'a>(pub(crate) &'a [Aabb]);

/// Leaves of blocks.
struct Blocks<'a, W>(&'a W);

/// Finished subtrees.
struct Links<'a>(&'a [Child]);

/// Makes nodes and blocks.
struct Emitter<'a, L> {
    boxes: &'a BoxTree,
    leaves: &'a L,
    /// For each box that is a child of a wide node: the nodes and blocks that it becomes.
    counts: Vec<SharedCounts>,
    work: Work<'a>,
}

/// The memory of a subtree.
struct Space<'a> {
    nodes: &'a mut [WideNode],
    blocks: &'a mut [Block],
    /// The nodes and blocks before it.
    before: Counts,
}

impl<'a> Space<'a> {
    /// Takes the first ones.
    fn take(&mut self, counts: Counts) -> Self {
        let (nodes, later_nodes) = std::mem::take(&mut self.nodes).split_at_mut(counts.nodes);
        let (blocks, later_blocks) = std::mem::take(&mut self.blocks).split_at_mut(counts.blocks);
        let before = self.before;
        self.before.add(counts);
        (self.nodes, self.blocks) = (later_nodes, later_blocks);
        Self {
            nodes,
            blocks,
            before,
        }
    }
}

/// Children of a wide node in the orders that rays meet them.
#[derive(Clone, Copy, Debug)]
struct Orders {
    /// By octant of directions: the numbers of the children from far to near, three bits each.
    of: [u32; 8],
    count: u32,
}

/// Nodes over finished subtrees, and their root. The subtrees are items of the boxes by number, and `before` is the number of
/// nodes in the arrays.
pub(crate) fn emit_links(
    boxes: &BoxTree,
    links: &[Child],
    before: usize,
) -> (Vec<WideNode>, Child) {
    let Some(root) = boxes.root() else {
        return (Vec::new(), Child::NOTHING);
    };
    let tracker = Tracker::new(None);
    let leaves = Links(links);
    let emitter = Emitter::new(boxes, &leaves, Work::new(false, &tracker));
    let counts = emitter.count(root);
    let mut nodes = vec![WideNode::EMPTY; counts.nodes];
    let space = Space {
        nodes: &mut nodes,
        blocks: &mut [],
        before: Counts {
            nodes: before,
            blocks: 0,
        },
    };
    let (child, _) = emitter.child(root, space, None);
    (nodes, child)
}

/// All nodes and blocks, and the root. `aside` are items in no leaf of `boxes`, such as triangles of zero area: rays do not meet them,
/// but a refit does.
pub(crate) fn emit(
    boxes: &BoxTree,
    blocks_of: &impl WriteBlocks,
    aside: &[u32],
    work: Work<'_>,
) -> (Vec<WideNode>, Vec<Block>, Child) {
    if boxes.root().is_none() && aside.is_empty() {
        return (Vec::new(), Vec::new(), Child::NOTHING);
    }
    let leaves = Blocks(blocks_of);
    let emitter = Emitter::new(boxes, &leaves, work);
    let root = boxes.root();
    let of_boxes = root.map_or(Counts::default(), |root| emitter.count(root));
    let of_aside = counts_of_leaf(aside.len());
    // A tree of one leaf needs a node for its box: rays that miss the box do not test its triangles.
    let has_own_root = of_boxes.nodes == 0;
    let own_nodes = of_boxes.nodes + usize::from(has_own_root);
    // With a node for the link to those aside, in case no node has room for it. Zeroed pages of the system, untouched: threads share
    // the work of touching them.
    let mut nodes: Vec<WideNode> = bytemuck::zeroed_vec(own_nodes + 1 + of_aside.nodes);
    let mut blocks: Vec<Block> = bytemuck::zeroed_vec(of_boxes.blocks + of_aside.blocks);
    advise_large_pages(&nodes);
    advise_large_pages(&blocks);
    let mut space = Space {
        nodes: &mut nodes,
        blocks: &mut blocks,
        before: Counts::default(),
    };
    let above = space.take(Counts {
        nodes: usize::from(has_own_root),
        blocks: 0,
    });
    let written = root.map(|root| {
        let space = space.take(of_boxes);
        let (child, _) = emitter.child(root, space, Some(work.share));
        (boxes.node(root).bounds, child)
    });
    if let [node] = above.nodes {
        *node = WideNode::EMPTY;
        if let Some((bounds, child)) = written {
            node.set(0, &bounds, child);
        }
    }
    let root = match written {
        Some((_, child)) if !has_own_root => child,
        _ => Child::node(0),
    };
    if aside.is_empty() {
        nodes.truncate(own_nodes);
    } else {
        let first = link_aside(&mut nodes, own_nodes, of_aside, of_boxes.blocks);
        let before = Counts {
            nodes: first,
            blocks: of_boxes.blocks,
        };
        let space = Space {
            nodes: &mut nodes[first..],
            blocks: &mut blocks[of_boxes.blocks..],
            before,
        };
        let block_of = |items: &[u32]| blocks_of.block_aside(items);
        leaf(aside, Aabb::EMPTY, &block_of, space);
        nodes.truncate(first + of_aside.nodes);
    }
    (nodes, blocks, root)
}

/// Links what will be written aside, in an empty box: `count` nodes and blocks behind `own` nodes and `blocks`. Returns the place of
/// the first of these nodes.
///
/// The link is deep in the tree, so that no node above has a child less. The last node has leaves alone below it, and comes before all
/// that is aside, as parents do.
fn link_aside(nodes: &mut [WideNode], own: usize, count: Counts, blocks: usize) -> usize {
    let link = |first: usize| match count.nodes {
        0 => Child::leaf(blocks, count.blocks),
        _ => Child::node(first),
    };
    let last = &mut nodes[own - 1];
    let free = (0..WIDTH).find(|lane| last.children[*lane] == Child::NOTHING);
    if let Some(lane) = free {
        last.set(lane, &Aabb::EMPTY, link(own));
        return own;
    }
    // Another node takes the place of a leaf, and has that leaf and the link.
    let (bounds, moved) = (last.bounds(0), last.children[0]);
    last.set(0, &bounds, Child::node(own));
    let mut node = WideNode::EMPTY;
    node.set(0, &bounds, moved);
    node.set(1, &Aabb::EMPTY, link(own + 1));
    nodes[own] = node;
    own + 1
}

impl<'a, L: WriteLeaves> Emitter<'a, L> {
    fn new(boxes: &'a BoxTree, leaves: &'a L, work: Work<'a>) -> Self {
        Self {
            boxes,
            leaves,
            counts: (0..boxes.count())
                .map(|_| SharedCounts::default())
                .collect(),
            work,
        }
    }

    /// Counts the nodes and blocks of a subtree as a child, and stores the counts of it and of all below it.
    fn count(&self, index: u32) -> Counts {
        let counts = if self.boxes.node(index).choice.is_leaf() {
            self.leaves.counts(self.boxes.items(index))
        } else {
            let mut counts = Counts {
                nodes: 1,
                blocks: 0,
            };
            let (_, parts) = self.children(index);
            if self.work.is_parallel && self.boxes.items(index).len() > COUNT_TASK {
                let counted = kd_tasks::map(parts.to_vec(), true, |part| self.count(part));
                counted.into_iter().for_each(|more| counts.add(more));
            } else {
                parts
                    .into_iter()
                    .for_each(|part| counts.add(self.count(part)));
            }
            counts
        };
        self.counts[index as usize].set(counts);
        counts
    }

    /// The children of the wide node that a box becomes, by number, and their orders.
    fn children(&self, index: u32) -> (Orders, Few<u32>) {
        let mut parts = Few::new();
        let orders = self.share(index, WIDTH, &mut parts);
        (orders, parts)
    }

    fn share(&self, index: u32, children: usize, parts: &mut Few<u32>) -> Orders {
        let node = self.boxes.node(index);
        match node.kind {
            Kind::Split {
                axis,
                children: [lower, upper],
            } if children > 1 => {
                let of_lower = node.choice.lower(children);
                let shares = [(lower, of_lower), (upper, children - of_lower)];
                let orders = shares.map(|(part, most)| {
                    let most = self.boxes.node(part).choice.best(most);
                    self.share(part, most, parts)
                });
                Orders::both(axis.index(), orders)
            }
            _ => {
                parts.push(index);
                Orders::one(u32::try_from(parts.len() - 1).expect("at most eight"))
            }
        }
    }

    /// Writes a subtree to exactly the space that it needs, and reports its share of the work. Without a share, the caller does.
    fn child(&self, index: u32, mut space: Space<'_>, share: Option<Share>) -> (Child, Prospect) {
        /// Blocks between two reports.
        const REPORT: usize = 1 << 7;
        if let Some(share) = share {
            if space.blocks.len() <= REPORT {
                let child = self.child(index, space, None);
                // Larger subtrees ask whether the work was cancelled.
                let _ = self.work.tracker.done(share);
                return child;
            }
            if self.work.tracker.check().is_err() {
                return (Child::NOTHING, Prospect::default());
            }
        }
        let bounds = self.boxes.node(index).bounds;
        if self.boxes.node(index).choice.is_leaf() {
            let items = self.boxes.items(index);
            let child = self.leaves.write(items, bounds, space);
            return (child, self.leaves.prospect(items));
        }
        let place = space.before.nodes;
        let own = space.take(Counts {
            nodes: 1,
            blocks: 0,
        });
        let (orders, parts) = self.children(index);
        let children = self.all(&parts, space, share);
        let prospects: Few<(Aabb, Prospect)> = parts
            .iter()
            .zip(&children)
            .map(|(part, (_, prospect))| (self.boxes.node(*part).bounds, *prospect))
            .collect();
        let lanes = prospect::lanes(&prospects);
        let mut node = WideNode::EMPTY;
        for ((bounds, _), ((child, _), lane)) in prospects.iter().zip(children.iter().zip(lanes)) {
            node.set(lane as usize, bounds, *child);
        }
        node.orders = orders.of_lanes(&lanes);
        own.nodes[0] = node;
        (Child::node(place), Prospect::of_node(&bounds, &prospects))
    }

    /// Writes subtrees one behind the other, possibly at the same time.
    fn all(
        &self,
        parts: &[u32],
        mut space: Space<'_>,
        mut share: Option<Share>,
    ) -> Few<(Child, Prospect)> {
        /// Blocks: some hundreds of microseconds of work.
        const TASK: usize = 1 << 9;
        let mut blocks = space.blocks.len();
        let is_parallel = self.work.is_parallel && blocks > TASK;
        let shared = parts.iter().map(|part| {
            let counts = self.counts[*part as usize].get();
            blocks -= counts.blocks;
            let [of_part, rest] = match share {
                Some(share) => share.divide([counts.blocks, blocks]).map(Some),
                None => [None; 2],
            };
            share = rest;
            (*part, space.take(counts), of_part)
        });
        let write = |(part, space, share)| self.child(part, space, share);
        if is_parallel {
            kd_tasks::map(shared.collect(), true, write).into()
        } else {
            shared.map(write).collect()
        }
    }
}

impl<W: WriteBlocks> WriteLeaves for Blocks<'_, W> {
    fn counts(&self, items: &[u32]) -> Counts {
        counts_of_leaf(items.len())
    }

    fn write(&self, items: &[u32], bounds: Aabb, space: Space<'_>) -> Child {
        leaf(items, bounds, &|items: &[u32]| self.0.block(items), space)
    }

    fn prospect(&self, items: &[u32]) -> Prospect {
        self.0.prospect(items)
    }
}

impl WriteBlocks for Triangles<'_> {
    fn block(&self, items: &[u32]) -> Block {
        if self.all_have_area {
            Block::with_area(items, self.mesh)
        } else {
            self.block_aside(items)
        }
    }

    fn block_aside(&self, items: &[u32]) -> Block {
        Block::of(items.iter().copied(), self.mesh)
    }

    fn prospect(&self, items: &[u32]) -> Prospect {
        Prospect::of_triangles(self.mesh, items)
    }
}

impl WriteBlocks for Boxes<'_> {
    fn block(&self, items: &[u32]) -> Block {
        Block::of_boxes(items, self.0)
    }

    fn prospect(&self, items: &[u32]) -> Prospect {
        Prospect::of_boxes(self.0, items)
    }
}

impl WriteLeaves for Links<'_> {
    fn counts(&self, _: &[u32]) -> Counts {
        Counts::default()
    }

    fn write(&self, items: &[u32], _: Aabb, _: Space<'_>) -> Child {
        self.0[items[0] as usize]
    }

    /// Unknown: the lanes keep their order.
    fn prospect(&self, _: &[u32]) -> Prospect {
        Prospect::default()
    }
}

/// A leaf of few items is one child. More items, which cannot be divided, are distributed over nodes.
fn counts_of_leaf(triangles: usize) -> Counts {
    if triangles <= MOST_TRIANGLES {
        return Counts {
            nodes: 0,
            blocks: triangles.div_ceil(LANES),
        };
    }
    let mut counts = Counts {
        nodes: 1,
        blocks: 0,
    };
    for (start, end) in ranges(triangles) {
        counts.add(counts_of_leaf(end - start));
    }
    counts
}

/// Equal ranges of a number of triangles, in whole blocks, for the children of a node.
fn ranges(triangles: usize) -> impl Iterator<Item = (usize, usize)> {
    let part = triangles.div_ceil(WIDTH).next_multiple_of(LANES);
    (0..triangles)
        .step_by(part)
        .map(move |start| (start, (start + part).min(triangles)))
}

fn leaf(
    triangles: &[u32],
    bounds: Aabb,
    block_of: &impl Fn(&[u32]) -> Block,
    mut space: Space<'_>,
) -> Child {
    if triangles.len() <= MOST_TRIANGLES {
        for (block, triangles) in space.blocks.iter_mut().zip(triangles.chunks(LANES)) {
            *block = block_of(triangles);
        }
        return Child::leaf(space.before.blocks, triangles.len().div_ceil(LANES));
    }
    let place = space.before.nodes;
    let own = space.take(Counts {
        nodes: 1,
        blocks: 0,
    });
    let mut node = WideNode::EMPTY;
    for (lane, (start, end)) in ranges(triangles.len()).enumerate() {
        let space = space.take(counts_of_leaf(end - start));
        node.set(
            lane,
            &bounds,
            leaf(&triangles[start..end], bounds, block_of, space),
        );
    }
    own.nodes[0] = node;
    Child::node(place)
}

impl Orders {
    fn one(number: u32) -> Self {
        Self {
            of: [number; 8],
            count: 1,
        }
    }

    /// Those of two groups, the lower and the upper one on an axis: the near one follows the far one.
    fn both(axis: usize, [lower, upper]: [Self; 2]) -> Self {
        let mut of = [0; 8];
        for (octant, order) in of.iter_mut().enumerate() {
            let (far, near) = if octant >> axis & 1 == 0 {
                (&upper, &lower)
            } else {
                (&lower, &upper)
            };
            *order = far.of[octant] | near.of[octant] << (3 * far.count);
        }
        Self {
            of,
            count: lower.count + upper.count,
        }
    }

    /// The same orders of all lanes, where `lanes` are those of the children by number, and then those without a child, which rays
    /// never enter.
    fn of_lanes(&self, lanes: &[u32; WIDTH]) -> [u32; 8] {
        self.of.map(|order| {
            let mut in_lanes = 0;
            for (place, lane) in (0..).zip(lanes) {
                let lane = if place < self.count {
                    lanes[(order >> (3 * place) & 7) as usize]
                } else {
                    *lane
                };
                in_lanes |= lane << (3 * place);
            }
            in_lanes
        })
    }
}
