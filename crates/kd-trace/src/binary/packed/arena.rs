//! The binary layout of an arena, extended as the arena grows.

use kd_buffer::Buffer;
use kd_core::{Aabb, Arena, Node, NodeIndex, Pair, Slot};
use kd_simd::{LANES, Level};
use kd_wide::Block;

use super::PackedTree;
use glam::Vec3;

/// The binary layout of an [`Arena`], to which trees are added and from which they are removed. Only new nodes are packed, and
/// leaves that trees share have the same blocks.
///
/// ```
/// use kd_core::{Arena, Mesh, Ray};
/// use kd_sah::{BuildOptions, build};
/// use kd_trace::PackedArena;
///
/// let mesh = Mesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
/// let mut arena = Arena::new();
/// let root = arena.append_tree(&build(&mesh, &BuildOptions::default())?, 0)?;
/// arena.freeze(1)?;
///
/// let mut packed = PackedArena::new();
/// packed.extend(&arena, |slot| mesh.corners(slot.0));
/// packed.set_root(root, mesh.bounds());
/// let ray = Ray::new([0.25, 0.25, 2.0], [0.0, 0.0, -1.0]);
/// assert_eq!(packed.tree().intersect(&ray).map(|hit| hit.t), Some(2.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct PackedArena {
    tree: PackedTree,
    /// For the first reference of each leaf, the leaf's first block and its number of triangles.
    leaves: Vec<[u32; 2]>,
    segments: Vec<End>,
}

/// The end of a segment.
#[derive(Clone, Copy, Debug, Default)]
struct End {
    pairs: usize,
    refs: usize,
    blocks: usize,
}

impl PackedArena {
    /// No leaf starts at this reference.
    const NONE: [u32; 2] = [0, 0];

    /// An empty layout.
    pub fn new() -> Self {
        Self {
            tree: PackedTree {
                pairs: Buffer::new(),
                blocks: Buffer::new(),
                root: NodeIndex(0),
                bounds: Aabb::EMPTY,
                level: Level::detect(),
            },
            leaves: Vec::new(),
            segments: Vec::new(),
        }
    }

    /// Packs the nodes that were frozen in the arena since the last call. Rays hit nothing until a root is set. Linear in the
    /// number of new nodes and references.
    ///
    /// # Panics
    ///
    /// If the arena is not the one that was packed before, with more in it.
    pub fn extend(&mut self, arena: &Arena, corners: impl Fn(Slot) -> [Vec3; 3]) {
        let (nodes, refs) = (arena.nodes(), arena.refs());
        let first = 2 * self.tree.pairs.len();
        assert!(
            nodes.len() >= first && refs.len() >= self.leaves.len(),
            "the arena has grown"
        );
        self.forget_root();
        self.leaves.resize(refs.len(), Self::NONE);
        let more: Vec<Node> = nodes[first..]
            .iter()
            .map(|node| self.packed(*node, refs, &corners))
            .collect();
        let more = more.chunks_exact(2).map(|pair| Pair([pair[0], pair[1]]));
        self.tree.pairs.to_mut().extend(more);
        self.segments.resize(
            arena.segments(),
            End {
                pairs: self.tree.pairs.len(),
                refs: self.leaves.len(),
                blocks: self.tree.blocks.len(),
            },
        );
    }

    /// Removes all but the first `segments` frozen segments, as [`Arena::truncate`] does. Segments that one call packed are
    /// removed together.
    ///
    /// # Panics
    ///
    /// If fewer segments are packed.
    pub fn truncate(&mut self, segments: usize) {
        assert!(
            segments <= self.segments.len(),
            "no more segments than are packed"
        );
        self.forget_root();
        self.segments.truncate(segments);
        let end = self.segments.last().copied().unwrap_or_default();
        self.tree.pairs.to_mut().truncate(end.pairs);
        self.tree.blocks.to_mut().truncate(end.blocks);
        self.leaves.truncate(end.refs);
    }

    /// Chooses the tree of the arena that rays traverse, with the box around its triangles.
    ///
    /// # Panics
    ///
    /// If the node is not packed.
    pub fn set_root(&mut self, root: NodeIndex, bounds: Aabb) {
        assert!(root.index() < 2 * self.tree.pairs.len(), "it is packed");
        self.tree.root = root;
        self.tree.bounds = bounds;
    }

    /// The tree at the root, for rays; empty without a root.
    pub fn tree(&self) -> &PackedTree {
        &self.tree
    }

    fn forget_root(&mut self) {
        // No ray enters an empty box.
        self.tree.bounds = Aabb::EMPTY;
    }

    /// The node; a leaf refers to its blocks: those of the leaf that it is a copy of, or new ones.
    fn packed(&mut self, node: Node, refs: &[Slot], corners: &impl Fn(Slot) -> [Vec3; 3]) -> Node {
        if !node.is_leaf() {
            return node;
        }
        if node.count() == 0 {
            return Node::EMPTY_LEAF;
        }
        let (first, count) = (node.first_ref() as usize, node.count());
        let block = match self.leaves[first] {
            [block, known] if known == count => block,
            _ => self.pack(first, &refs[first..first + count as usize], corners),
        };
        Node::leaf(block, count).expect("a leaf's count fits a leaf")
    }

    /// The first of the new blocks of a leaf.
    fn pack(&mut self, first: usize, refs: &[Slot], corners: &impl Fn(Slot) -> [Vec3; 3]) -> u32 {
        let place = u32::try_from(self.tree.blocks.len());
        let place = place.expect("32 bits count references, and a block holds at least one");
        // A leaf of an earlier segment keeps its blocks.
        if first >= self.segments.last().map_or(0, |end| end.refs) {
            let count = u32::try_from(refs.len()).expect("a leaf's count fits a leaf");
            self.leaves[first] = [place, count];
        }
        for slots in refs.chunks(LANES) {
            let mut block = Block::EMPTY;
            for (lane, slot) in slots.iter().enumerate() {
                block.set(lane, slot.0, corners(*slot));
            }
            self.tree.blocks.to_mut().push(block);
        }
        place
    }
}

impl Default for PackedArena {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use kd_core::{Mesh, Ray};
    use kd_sah::{BuildOptions, build};

    use super::*;

    fn triangle_at(z: f32) -> Mesh {
        let corners = vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
        Mesh::new(corners, vec![[0, 1, 2]]).expect("valid")
    }

    fn hit(packed: &PackedArena) -> Option<(u32, f32)> {
        let ray = Ray::new([0.25, 0.25, 9.0], [0.0, 0.0, -1.0]);
        packed
            .tree()
            .intersect(&ray)
            .map(|hit| (hit.triangle, hit.t))
    }

    #[test]
    fn leaves_are_packed_once_and_removed_with_their_segments() {
        let meshes = [triangle_at(1.0), triangle_at(2.0)];
        let corners = |slot: Slot| meshes[slot.index()].corners(0);
        let both = meshes[0].bounds().union(&meshes[1].bounds());
        let trees = meshes
            .each_ref()
            .map(|mesh| build(mesh, &BuildOptions::default()).expect("built"));
        let (mut arena, mut packed) = (Arena::new(), PackedArena::new());
        let still = arena.append_tree(&trees[0], 0).expect("fits");
        arena.freeze(2).expect("valid");
        packed.extend(&arena, corners);
        assert_eq!(hit(&packed), None, "no root yet");
        packed.set_root(still, both);
        assert_eq!(hit(&packed), Some((0, 8.0)), "the first");

        let bytes = packed.tree().bytes();
        for _ in 0..3 {
            // A frame: the other tree, and a link to the first beside it.
            let moving = arena.append_tree(&trees[1], 1).expect("fits");
            let children = [still, moving].map(|root| arena.nodes()[root.index()]);
            // Parents come before their children.
            let place = arena.push(Pair([Node::EMPTY_LEAF; 2])).expect("fits");
            let first = arena.push(Pair(children)).expect("fits");
            let root = Node::interior(kd_core::Axis::Z, 1.5, first).expect("fits");
            arena.set(place, root);
            arena.freeze(2).expect("valid");
            packed.extend(&arena, corners);
            packed.set_root(place, both);
            assert_eq!(hit(&packed), Some((1, 7.0)), "the second");
            let grown = packed.tree().bytes().blocks - bytes.blocks;
            assert_eq!(grown, size_of::<Block>(), "the first is shared");
            arena.truncate(1);
            packed.truncate(1);
            assert_eq!(packed.tree().bytes(), bytes, "as before");
            packed.set_root(still, both);
            assert_eq!(hit(&packed), Some((0, 8.0)), "the first, as before");
        }
    }
}
