//! Wide nodes and blocks from a tree of boxes.
//!
//! Nodes lie in order of depth first, blocks in the order in which their leaves are met. How many there are is counted
//! first, so that all of them are written where they stay, on any number of threads. Leaves are triangles, or subtrees that
//! were written before.

use kd_core::{Aabb, Mesh};
use kd_simd::LANES;

use crate::block::Block;
use crate::box_tree::{BoxTree, Kind};
use crate::node::{Child, WIDTH, WideNode};

/// What fits one leaf.
const MOST_TRIANGLES: usize = Child::MOST_BLOCKS as usize * LANES;

/// Nodes and blocks of a part of a tree.
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

/// What leaves become.
trait WriteLeaves: Sync {
    fn counts(&self, items: &[u32]) -> Counts;

    /// Writes a leaf, to exactly the space it needs.
    fn write(&self, items: &[u32], bounds: Aabb, space: Space<'_>) -> Child;
}

/// Blocks of the triangles of a mesh.
struct Triangles<'a>(&'a Mesh);

/// Nodes that are there already.
struct Links<'a>(&'a [Child]);

/// Makes nodes and blocks.
struct Emitter<'a, L> {
    boxes: &'a BoxTree,
    leaves: &'a L,
    /// What each node of the boxes becomes, where it is a child of a wide node.
    counts: Vec<Counts>,
    is_parallel: bool,
}

/// Where a part of a tree goes.
struct Space<'a> {
    nodes: &'a mut [WideNode],
    blocks: &'a mut [Block],
    /// What comes before it.
    before: Counts,
}

impl<'a> Space<'a> {
    /// The first so many of what is left.
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

/// The children of a wide node, as their binary tree.
#[derive(Debug)]
enum Group {
    /// In this lane.
    Child(u32),
    /// The lower and the upper part on an axis.
    Parts(usize, Box<[Self; 2]>),
}

/// Nodes over subtrees, by their numbers, that are written already, in arrays that have so many nodes before; and the root.
pub(crate) fn emit_links(
    boxes: &BoxTree,
    links: &[Child],
    before: usize,
) -> (Vec<WideNode>, Child) {
    let before = Counts {
        nodes: before,
        blocks: 0,
    };
    let (nodes, _, root) = emit_leaves(boxes, &Links(links), before, false);
    (nodes, root)
}

/// All nodes and blocks, and where the root is.
pub(crate) fn emit(
    boxes: &BoxTree,
    mesh: &Mesh,
    is_parallel: bool,
) -> (Vec<WideNode>, Vec<Block>, Child) {
    let triangles = Triangles(mesh);
    let (mut nodes, blocks, mut child) =
        emit_leaves(boxes, &triangles, Counts::default(), is_parallel);
    if let (Some(root), true) = (boxes.root(), child.is_leaf()) {
        // Nothing else has the box of a tree that is one leaf, and rays that miss it should not pay for its triangles.
        let mut node = WideNode::EMPTY;
        node.set(0, &boxes.node(root).bounds, child);
        nodes.push(node);
        child = Child::node(nodes.len() - 1);
    }
    (nodes, blocks, child)
}

fn emit_leaves<L: WriteLeaves>(
    boxes: &BoxTree,
    leaves: &L,
    before: Counts,
    is_parallel: bool,
) -> (Vec<WideNode>, Vec<Block>, Child) {
    let Some(root) = boxes.root() else {
        return (Vec::new(), Vec::new(), Child::NOTHING);
    };
    let mut emitter = Emitter {
        boxes,
        leaves,
        counts: vec![Counts::default(); boxes.len()],
        is_parallel,
    };
    let counts = emitter.count(root);
    // The pages come from the system, zeroed and not yet touched, so that threads share the work of touching them.
    let mut nodes = bytemuck::zeroed_vec(counts.nodes);
    let mut blocks = bytemuck::zeroed_vec(counts.blocks);
    let space = Space {
        nodes: &mut nodes,
        blocks: &mut blocks,
        before,
    };
    let child = emitter.child(root, space);
    (nodes, blocks, child)
}

impl<L: WriteLeaves> Emitter<'_, L> {
    /// Counts what a part becomes as a child, and notes it for it and for all below it.
    fn count(&mut self, index: u32) -> Counts {
        let counts = if self.boxes.node(index).choice.is_leaf() {
            self.leaves.counts(self.boxes.items(index))
        } else {
            let mut counts = Counts {
                nodes: 1,
                blocks: 0,
            };
            let (_, parts) = self.children(index);
            for part in parts {
                counts.add(self.count(part));
            }
            counts
        };
        self.counts[index as usize] = counts;
        counts
    }

    /// The children of the wide node that a part becomes.
    fn children(&self, index: u32) -> (Group, Vec<u32>) {
        let mut parts = Vec::with_capacity(WIDTH);
        let group = self.share(index, WIDTH, &mut parts);
        (group, parts)
    }

    fn share(&self, index: u32, children: usize, parts: &mut Vec<u32>) -> Group {
        let node = self.boxes.node(index);
        match node.kind {
            Kind::Split {
                axis,
                parts: [lower, upper],
            } if children > 1 => {
                let of_lower = node.choice.lower(children);
                let shares = [(lower, of_lower), (upper, children - of_lower)];
                let groups = shares.map(|(part, most)| {
                    let most = self.boxes.node(part).choice.best(most);
                    self.share(part, most, parts)
                });
                Group::Parts(axis.index(), Box::new(groups))
            }
            _ => {
                parts.push(index);
                let lane = u32::try_from(parts.len() - 1).expect("at most eight");
                Group::Child(lane)
            }
        }
    }

    /// Writes a part, to exactly the space it needs.
    fn child(&self, index: u32, mut space: Space<'_>) -> Child {
        if self.boxes.node(index).choice.is_leaf() {
            let bounds = self.boxes.node(index).bounds;
            return self.leaves.write(self.boxes.items(index), bounds, space);
        }
        let place = space.before.nodes;
        let own = space.take(Counts {
            nodes: 1,
            blocks: 0,
        });
        let (group, parts) = self.children(index);
        let tasks: Vec<(u32, Space<'_>)> = parts
            .iter()
            .map(|part| (*part, space.take(self.counts[*part as usize])))
            .collect();
        let children = self.all(tasks);
        let mut node = WideNode::EMPTY;
        for (lane, (part, child)) in parts.iter().zip(children).enumerate() {
            node.set(lane, &self.boxes.node(*part).bounds, child);
        }
        node.orders = [0, 1, 2, 3, 4, 5, 6, 7].map(|octant| group.order(octant));
        own.nodes[0] = node;
        Child::node(place)
    }

    fn all(&self, tasks: Vec<(u32, Space<'_>)>) -> Vec<Child> {
        /// Some hundreds of microseconds of work.
        const TASK: usize = 1 << 10;
        let blocks: usize = tasks.iter().map(|(_, space)| space.blocks.len()).sum();
        let is_parallel = self.is_parallel && blocks > TASK;
        kd_tasks::map(tasks, is_parallel, |(part, space)| self.child(part, space))
    }
}

impl WriteLeaves for Triangles<'_> {
    fn counts(&self, items: &[u32]) -> Counts {
        counts_of_leaf(items.len())
    }

    fn write(&self, items: &[u32], bounds: Aabb, space: Space<'_>) -> Child {
        leaf(items, bounds, self.0, space)
    }
}

impl WriteLeaves for Links<'_> {
    fn counts(&self, _: &[u32]) -> Counts {
        Counts::default()
    }

    fn write(&self, items: &[u32], _: Aabb, _: Space<'_>) -> Child {
        self.0[items[0] as usize]
    }
}

/// A leaf of few triangles is one child; more that could not be divided are dealt out to nodes.
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
    for (start, end) in dealt(triangles) {
        counts.add(counts_of_leaf(end - start));
    }
    counts
}

/// Equal parts of so many triangles, in whole blocks, for the children of a node.
fn dealt(triangles: usize) -> impl Iterator<Item = (usize, usize)> {
    let part = triangles.div_ceil(WIDTH).next_multiple_of(LANES);
    (0..triangles)
        .step_by(part)
        .map(move |start| (start, (start + part).min(triangles)))
}

fn leaf(triangles: &[u32], bounds: Aabb, mesh: &Mesh, mut space: Space<'_>) -> Child {
    if triangles.len() <= MOST_TRIANGLES {
        for (block, triangles) in space.blocks.iter_mut().zip(triangles.chunks(LANES)) {
            *block = Block::of(triangles.iter().copied(), mesh);
        }
        return Child::leaf(space.before.blocks, triangles.len().div_ceil(LANES));
    }
    let place = space.before.nodes;
    let own = space.take(Counts {
        nodes: 1,
        blocks: 0,
    });
    let mut node = WideNode::EMPTY;
    for (lane, (start, end)) in dealt(triangles.len()).enumerate() {
        let space = space.take(counts_of_leaf(end - start));
        node.set(
            lane,
            &bounds,
            leaf(&triangles[start..end], bounds, mesh, space),
        );
    }
    own.nodes[0] = node;
    Child::node(place)
}

impl Group {
    /// All lanes from far to near for directions of an octant, three bits each.
    fn order(&self, octant: usize) -> u32 {
        let mut lanes = Vec::with_capacity(WIDTH);
        self.add_to(octant, &mut lanes);
        // Lanes without a child are never met.
        let lacking = (0..8_u32).skip(lanes.len());
        lanes.extend(lacking);
        lanes.iter().rev().fold(0, |order, lane| order << 3 | lane)
    }

    fn add_to(&self, octant: usize, lanes: &mut Vec<u32>) {
        match self {
            Self::Child(lane) => lanes.push(*lane),
            Self::Parts(axis, parts) => {
                let near = octant >> axis & 1;
                parts[near ^ 1].add_to(octant, lanes);
                parts[near].add_to(octant, lanes);
            }
        }
    }
}
