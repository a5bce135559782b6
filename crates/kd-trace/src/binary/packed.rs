//! The binary layout: the 8-byte nodes of a kd-tree over blocks of triangles.
//!
//! ```text
//!             word 0 (u32)            word 1 (u32)
//! interior    as in the tree
//! leaf        index of first block    number of triangles << 2 | 3
//!
//! ```
//! The triangles of a leaf fill its blocks in order; the last block may have empty lanes.

mod arena;
mod saved;

use std::ops::ControlFlow;

use bytemuck::{cast_slice, cast_slice_mut};
use kd_buffer::Buffer;
use kd_core::{Aabb, Hit, LayoutBytes, Mesh, Node, NodeIndex, Pair, Ray, RayPacket8, Tree};
use kd_simd::{LANES, Level};
use kd_wide::Block;

use crate::binary::walk::{Begin, Walkable};
use crate::collect::{Any, Closest, Collect, Ordered};
use crate::dispatch::WalkPacked;
use crate::probe::Probe;
use crate::ray_query::rest_of;
use crate::triangle::TriangleTest;

pub use arena::PackedArena;

/// The 8-byte nodes of a kd-tree over blocks of eight triangles: the layout that traverses the tree as it was built.
/// [`WideTree`](crate::WideTree) is faster. It holds copies: neither tree nor mesh is needed to trace.
///
/// Every answer equals that of the functions that take the [`Tree`] and its mesh, and so that of
/// [`brute_force`](crate::brute_force), to the bit and at every [`Level`].
///
/// Memory: 8 bytes a node and 320 bytes a block, of which a leaf of `n` triangles has `n / 8`, rounded up. A tree built
/// for a [`CostModel`](kd_core::CostModel) of 8 lanes, such as [`PACKED`](kd_core::CostModel::PACKED), fills them best.
#[derive(Clone, Debug)]
pub struct PackedTree {
    pairs: Buffer<Pair>,
    blocks: Buffer<Block>,
    root: NodeIndex,
    bounds: Aabb,
    level: Level,
}

/// A range of a tree's nodes, the same nodes packed, and the blocks of their leaves.
struct Range<'a> {
    sources: &'a [Node],
    nodes: &'a [Node],
    blocks: &'a mut [Block],
}

impl PackedTree {
    /// Packs the leaves of a tree over `mesh` on the calling thread, for the fastest [`Level`] of this processor.
    ///
    /// Linear in the number of nodes and references of the tree's arena. A leaf that is a copy of another gets blocks of
    /// its own.
    ///
    /// # Panics
    ///
    /// If `mesh` is not the one that the tree was built from, and has fewer triangles.
    pub fn new(tree: &Tree, mesh: &Mesh) -> Self {
        Self::filled_by(tree, |range| range.fill(tree, mesh))
    }

    /// [`new`](Self::new) on the threads of the pool in scope (rayon's). The result is the same.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub fn new_parallel(tree: &Tree, mesh: &Mesh) -> Self {
        Self::filled_by(tree, |range| range.fill_parallel(tree, mesh))
    }

    fn filled_by(tree: &Tree, fill: impl FnOnce(Range<'_>)) -> Self {
        #[allow(clippy::cast_possible_truncation, reason = "eight")]
        const PER_BLOCK: u32 = LANES as u32;
        let mut pairs: Vec<Pair> = bytemuck::pod_collect_to_vec(tree.nodes());
        let mut count = 0_u32;
        for node in cast_slice_mut::<Pair, Node>(&mut pairs) {
            if node.is_leaf() {
                let triangles = node.count();
                *node = Node::leaf(count, triangles).expect("a leaf's count fits a leaf");
                let blocks = triangles.div_ceil(PER_BLOCK);
                count = count
                    .checked_add(blocks)
                    .expect("32 bits count references, and a block holds at least one");
            }
        }
        // Zeroed pages of the system, untouched: threads share the work of touching them.
        let mut blocks: Vec<Block> = bytemuck::zeroed_vec(count as usize);
        fill(Range {
            sources: tree.nodes(),
            nodes: cast_slice(&pairs),
            blocks: &mut blocks,
        });
        Self {
            pairs: pairs.into(),
            blocks: blocks.into(),
            root: tree.root(),
            bounds: tree.bounds(),
            level: Level::detect(),
        }
    }

    /// The same tree, traced at another level.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        Self { level, ..self }
    }

    /// The level that rays are traced at.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Bytes of nodes and of blocks.
    pub fn bytes(&self) -> LayoutBytes {
        LayoutBytes {
            nodes: size_of_val(&*self.pairs),
            blocks: size_of_val(&*self.blocks),
        }
    }

    /// The box that the planes of the nodes divide; empty for a tree without triangles.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The index of the root node.
    pub fn root(&self) -> NodeIndex {
        self.root
    }

    /// All nodes. Child indices refer to this slice; leaves refer to blocks, by [`blocks_of`](Self::blocks_of).
    pub fn nodes(&self) -> &[Node] {
        cast_slice(&self.pairs)
    }

    /// The blocks of a leaf of this tree, which hold its triangles in order.
    #[inline(always)]
    pub fn blocks_of(&self, leaf: Node) -> &[Block] {
        let first = leaf.first_ref() as usize;
        let triangles = leaf.count() as usize;
        &self.blocks[first..first + triangles.div_ceil(LANES)]
    }

    /// Gives the collector every hit of the ray that it may want, at the level of the tree.
    #[inline]
    pub(crate) fn walk<C: Collect, P: Probe>(
        &self,
        ray: impl Begin,
        collector: &mut C,
        probe: &mut P,
    ) {
        self.level.run(WalkPacked {
            tree: self,
            ray,
            collector,
            probe,
        });
    }

    /// As [`intersect`](crate::intersect).
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = Closest::default();
        self.walk(ray, &mut closest, &mut ());
        closest.0
    }

    /// As [`occluded`](crate::occluded).
    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut any = Any::default();
        self.walk(ray, &mut any, &mut ());
        any.0
    }

    /// As [`hits`](crate::hits).
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        Ordered::fill(out, max, |ordered| self.walk(ray, ordered, &mut ()));
    }

    /// As [`hits_behind`](crate::RayQuery::hits_behind) of the trait.
    pub fn hits_behind(&self, ray: &Ray, last: &Hit, max: usize, out: &mut Vec<Hit>) {
        let rest = rest_of(ray, last);
        Ordered::fill_behind(out, Some(*last), max, |ordered| {
            self.walk(&rest, ordered, &mut ());
        });
    }

    /// [`intersect`](Self::intersect) for each ray, one after another.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn intersect_batch(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        assert_eq!(rays.len(), hits.len(), "one hit per ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.intersect(ray);
        }
    }

    /// [`occluded`](Self::occluded) for each ray, one after another.
    ///
    /// # Panics
    ///
    /// If the slices differ in length.
    pub fn occluded_batch(&self, rays: &[Ray], occluded: &mut [bool]) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        for (ray, occluded) in rays.iter().zip(occluded) {
            *occluded = self.occluded(ray);
        }
    }

    /// [`intersect`](Self::intersect) for the ray of each lane, one after another.
    pub fn intersect8(&self, packet: &RayPacket8) -> [Option<Hit>; 8] {
        packet.rays().map(|ray| self.intersect(&ray))
    }

    /// [`occluded`](Self::occluded) for the ray of each lane, one after another.
    pub fn occluded8(&self, packet: &RayPacket8) -> [bool; 8] {
        packet.rays().map(|ray| self.occluded(&ray))
    }
}

impl Range<'_> {
    fn fill(self, tree: &Tree, mesh: &Mesh) {
        let mut blocks = self.blocks.iter_mut();
        for leaf in self.sources.iter().filter(|node| node.is_leaf()) {
            for (triangles, block) in tree.leaf_refs(*leaf).chunks(LANES).zip(&mut blocks) {
                *block = Block::of(triangles.iter().map(|slot| slot.0), mesh);
            }
        }
    }

    fn fill_parallel(self, tree: &Tree, mesh: &Mesh) {
        /// Some tens of microseconds of work.
        const FEW_NODES: usize = 1024;
        if self.nodes.len() <= FEW_NODES {
            return self.fill(tree, mesh);
        }
        let (lower, upper) = self.halves();
        kd_tasks::join_if(
            true,
            || lower.fill_parallel(tree, mesh),
            || upper.fill_parallel(tree, mesh),
        );
    }

    /// Leaves refer to blocks in order, so each half has a range of blocks.
    fn halves(self) -> (Self, Self) {
        let first_block = |nodes: &[Node]| {
            let leaf = nodes.iter().find(|node| node.is_leaf());
            leaf.map(|leaf| leaf.first_ref() as usize)
        };
        let middle = self.nodes.len() / 2;
        let (nodes, upper_nodes) = self.nodes.split_at(middle);
        let (sources, upper_sources) = self.sources.split_at(middle);
        let blocks_before = match (first_block(nodes), first_block(upper_nodes)) {
            (Some(first), Some(middle)) => middle - first,
            (None, _) => 0,
            (Some(_), None) => self.blocks.len(),
        };
        let (blocks, upper_blocks) = self.blocks.split_at_mut(blocks_before);
        let lower = Range {
            sources,
            nodes,
            blocks,
        };
        let upper = Range {
            sources: upper_sources,
            nodes: upper_nodes,
            blocks: upper_blocks,
        };
        (lower, upper)
    }
}

impl<C: Collect> Walkable<C> for PackedTree {
    #[inline(always)]
    fn bounds(&self) -> Aabb {
        self.bounds
    }

    #[inline(always)]
    fn root(&self) -> NodeIndex {
        self.root
    }

    #[inline(always)]
    fn nodes(&self) -> &[Node] {
        cast_slice(&self.pairs)
    }

    #[inline(always)]
    fn visit<P: Probe>(
        &self,
        leaf: Node,
        test: &TriangleTest,
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        let mut triangles = leaf.count() as usize;
        for block in self.blocks_of(leaf) {
            probe.block();
            let left = test.may_hit(&block.corners, triangles);
            triangles = triangles.saturating_sub(LANES);
            for lane in left {
                probe.decision();
                let hit = test.decide(block.corners_of(lane), block.triangles[lane]);
                if let Some(hit) = hit {
                    collector.take(hit)?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use kd_core::CostModel;
    use kd_sah::BuildOptions;

    use super::*;

    /// Enough nodes for several tasks, in trees with leaves anywhere.
    #[test]
    fn threads_do_not_show() {
        let spike = |i: u16| {
            let x = f32::from(i % 97);
            let y = f32::from(i / 97);
            let z = f32::from(i % 13);
            [[x, y, 0.0], [x + 1.5, y, z], [x, y + 0.5, z]]
        };
        let positions: Vec<[f32; 3]> = (0..20_000).flat_map(spike).collect();
        let triangles = (0..20_000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(positions, triangles).expect("valid");
        for cost in [CostModel::PACKED, CostModel::CLASSIC] {
            let tree = kd_sah::build(&mesh, &BuildOptions::best().with_cost(cost)).expect("valid");
            let bytes = |packed: &PackedTree| -> Vec<u8> {
                let blocks: &[u8] = cast_slice(&packed.blocks);
                [cast_slice(&packed.pairs), blocks].concat()
            };
            let packed = PackedTree::new(&tree, &mesh);
            assert!(packed.pairs.len() > 700, "{}", packed.pairs.len());
            let parallel = PackedTree::new_parallel(&tree, &mesh);
            assert!(bytes(&packed) == bytes(&parallel), "the same bytes");
        }
    }
}
