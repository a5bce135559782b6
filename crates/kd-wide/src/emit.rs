//! Emit: wide nodes and blocks from a collapsed tree of boxes.
//!
//! Nodes are stored in depth-first order, blocks in the order of their leaves. They are counted first, so that any number of
//! threads writes each at its final place. Leaves are triangles, or finished subtrees.
//!
//! The children of a node are in lanes by their [`Prospect`]: an any-hit ray visits the last lane first.

mod prospect;

use kd_core::{Aabb, Mesh};
use kd_simd::LANES;

use crate::block::Block;
use crate::box_tree::{BoxTree, Kind};
use crate::large_pages;
use crate::node::{Child, WIDTH, WideNode};
use prospect::Prospect;

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

/// How leaves are written.
trait WriteLeaves: Sync {
    fn counts(&self, items: &[u32]) -> Counts;

    /// Writes a leaf to exactly the space that it needs.
    fn write(&self, items: &[u32], bounds: Aabb, space: Space<'_>) -> Child;

    /// Of the leaf.
    fn prospect(&self, items: &[u32]) -> Prospect;
}

/// Blocks of the triangles of a mesh.
struct Triangles<'a>(&'a Mesh);

/// Finished subtrees.
struct Links<'a>(&'a [Child]);

/// Makes nodes and blocks.
struct Emitter<'a, L> {
    boxes: &'a BoxTree,
    leaves: &'a L,
    /// For each box that is a child of a wide node: the nodes and blocks that it becomes.
    counts: Vec<Counts>,
    is_parallel: bool,
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

/// The children of a wide node, as the binary tree that they come from.
#[derive(Debug)]
enum Group {
    /// The child of this number.
    Child(u32),
    /// The lower and the upper group on an axis.
    Split(usize, Box<[Self; 2]>),
}

/// Nodes over finished subtrees, and their root. The subtrees are items of the boxes by number, and `before` is the number of
/// nodes in the arrays.
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

/// All nodes and blocks, and the root.
pub(crate) fn emit(
    boxes: &BoxTree,
    mesh: &Mesh,
    is_parallel: bool,
) -> (Vec<WideNode>, Vec<Block>, Child) {
    let triangles = Triangles(mesh);
    let (mut nodes, blocks, mut child) =
        emit_leaves(boxes, &triangles, Counts::default(), is_parallel);
    if let (Some(root), true) = (boxes.root(), child.is_leaf()) {
        // A tree of one leaf needs a node for its box: rays that miss the box do not test its triangles.
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
    // Zeroed pages of the system, untouched: threads share the work of touching them.
    let mut nodes = bytemuck::zeroed_vec(counts.nodes);
    let mut blocks = bytemuck::zeroed_vec(counts.blocks);
    large_pages::advise(&nodes);
    large_pages::advise(&blocks);
    let space = Space {
        nodes: &mut nodes,
        blocks: &mut blocks,
        before,
    };
    let (child, _) = emitter.child(root, space);
    (nodes, blocks, child)
}

impl<L: WriteLeaves> Emitter<'_, L> {
    /// Counts the nodes and blocks of a subtree as a child, and stores the counts of it and of all below it.
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

    /// The children of the wide node that a box becomes.
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
                children: [lower, upper],
            } if children > 1 => {
                let of_lower = node.choice.lower(children);
                let shares = [(lower, of_lower), (upper, children - of_lower)];
                let groups = shares.map(|(part, most)| {
                    let most = self.boxes.node(part).choice.best(most);
                    self.share(part, most, parts)
                });
                Group::Split(axis.index(), Box::new(groups))
            }
            _ => {
                parts.push(index);
                let number = u32::try_from(parts.len() - 1).expect("at most eight");
                Group::Child(number)
            }
        }
    }

    /// Writes a subtree to exactly the space that it needs.
    fn child(&self, index: u32, mut space: Space<'_>) -> (Child, Prospect) {
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
        let (group, parts) = self.children(index);
        let tasks: Vec<(u32, Space<'_>)> = parts
            .iter()
            .map(|part| (*part, space.take(self.counts[*part as usize])))
            .collect();
        let children = self.all(tasks);
        let prospects: Vec<(Aabb, Prospect)> = parts
            .iter()
            .zip(&children)
            .map(|(part, (_, prospect))| (self.boxes.node(*part).bounds, *prospect))
            .collect();
        let lanes = prospect::lanes(&prospects);
        let mut node = WideNode::EMPTY;
        for ((bounds, _), ((child, _), lane)) in prospects.iter().zip(children.iter().zip(lanes)) {
            node.set(lane as usize, bounds, *child);
        }
        node.orders = [0, 1, 2, 3, 4, 5, 6, 7].map(|octant| group.order(octant, &lanes));
        own.nodes[0] = node;
        (Child::node(place), Prospect::of_node(&bounds, &prospects))
    }

    fn all(&self, tasks: Vec<(u32, Space<'_>)>) -> Vec<(Child, Prospect)> {
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

    fn prospect(&self, items: &[u32]) -> Prospect {
        Prospect::of_triangles(self.0, items)
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

/// A leaf of few triangles is one child. More triangles, which cannot be divided, are distributed over nodes.
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
    for (lane, (start, end)) in ranges(triangles.len()).enumerate() {
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
    /// All lanes from far to near for the directions of an octant, three bits each. `lanes` are those of the children.
    fn order(&self, octant: usize, lanes: &[u32; WIDTH]) -> u32 {
        let mut children = Vec::with_capacity(WIDTH);
        self.add_to(octant, &mut children);
        // Rays never enter lanes without a child.
        let lacking = (0..8_u32).skip(children.len());
        children.extend(lacking);
        let in_order = children.iter().rev();
        in_order.fold(0, |order, child| order << 3 | lanes[*child as usize])
    }

    fn add_to(&self, octant: usize, lanes: &mut Vec<u32>) {
        match self {
            Self::Child(number) => lanes.push(*number),
            Self::Split(axis, parts) => {
                let near = octant >> axis & 1;
                parts[near ^ 1].add_to(octant, lanes);
                parts[near].add_to(octant, lanes);
            }
        }
    }
}
