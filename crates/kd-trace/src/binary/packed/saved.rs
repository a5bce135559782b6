//! Packed trees from saved nodes and blocks, with or without a check.

use bytemuck::{bytes_of, cast_slice};
use kd_buffer::Buffer;
use kd_core::{Aabb, LayoutError, Mesh, Node, NodeIndex, Pair, Tree};
use kd_simd::{LANES, Level};
use kd_wide::Block;

use super::PackedTree;

impl PackedTree {
    /// A tree of the pairs of [`nodes`](Self::nodes) and the [`blocks`](Self::blocks) of an earlier one, which are those that
    /// [`new`](Self::new) makes of `tree` and `mesh`. Linear.
    ///
    /// # Errors
    ///
    /// [`LayoutError`] names the first node or block that differs.
    pub fn from_buffers(
        pairs: Buffer<Pair>,
        blocks: Buffer<Block>,
        tree: &Tree,
        mesh: &Mesh,
    ) -> Result<Self, LayoutError> {
        check(cast_slice(&pairs), &blocks, tree, mesh)?;
        Ok(Self::from_trusted_buffers(
            pairs,
            blocks,
            tree.root(),
            tree.bounds(),
        ))
    }

    /// [`from_buffers`](Self::from_buffers) without a check, and without reading a node or a block.
    ///
    /// If they are not those of one tree, queries give wrong answers, panic or do not end; memory stays safe.
    pub fn from_trusted_buffers(
        pairs: Buffer<Pair>,
        blocks: Buffer<Block>,
        root: NodeIndex,
        bounds: Aabb,
    ) -> Self {
        Self {
            pairs,
            blocks,
            root,
            bounds,
            level: Level::detect(),
        }
    }

    /// All blocks, in the order of the leaves.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }
}

fn check(nodes: &[Node], blocks: &[Block], tree: &Tree, mesh: &Mesh) -> Result<(), LayoutError> {
    let missing = nodes.len().min(tree.nodes().len());
    if nodes.len() != tree.nodes().len() {
        return Err(LayoutError::BadNode { node: missing });
    }
    let mut next = 0;
    for (number, (node, source)) in nodes.iter().zip(tree.nodes()).enumerate() {
        let expected = if source.is_leaf() {
            let first = u32::try_from(next).expect("32 bits count references");
            Node::leaf(first, source.count()).expect("a leaf's count fits a leaf")
        } else {
            *source
        };
        if bytes_of(node) != bytes_of(&expected) {
            return Err(LayoutError::BadNode { node: number });
        }
        if !source.is_leaf() {
            continue;
        }
        for slots in tree.leaf_refs(*source).chunks(LANES) {
            let expected = Block::of(slots.iter().map(|slot| slot.0), mesh);
            match blocks.get(next) {
                Some(block) => check_block(next, block, &expected)?,
                None => return Err(count_error(blocks, tree)),
            }
            next += 1;
        }
    }
    if next == blocks.len() {
        Ok(())
    } else {
        Err(count_error(blocks, tree))
    }
}

fn check_block(number: usize, block: &Block, expected: &Block) -> Result<(), LayoutError> {
    if bytes_of(block) == bytes_of(expected) {
        return Ok(());
    }
    let lane_of = |block: &Block, lane: usize| {
        let corners = block.corners_of(lane).map(|corner| corner.to_array());
        (bytes_of(&corners).to_vec(), block.triangles[lane])
    };
    let lane = (0..LANES).find(|lane| lane_of(block, *lane) != lane_of(expected, *lane));
    Err(LayoutError::BadTriangle {
        block: number,
        lane: lane.expect("the lanes are all of a block"),
    })
}

fn count_error(blocks: &[Block], tree: &Tree) -> LayoutError {
    let leaves = tree.nodes().iter().filter(|node| node.is_leaf());
    LayoutError::BlockCount {
        blocks: blocks.len(),
        expected: leaves
            .map(|leaf| (leaf.count() as usize).div_ceil(LANES))
            .sum(),
    }
}

#[cfg(test)]
mod tests {
    use kd_sah::BuildOptions;

    use super::*;

    #[test]
    fn a_tree_passes_as_it_was_made_and_no_other_does() {
        let corner = |i: u32| {
            let i = i as f32;
            [(0.7 * i).sin(), (0.3 * i).cos(), 0.01 * i]
        };
        let triangles = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new((0..300).map(corner).collect(), triangles).expect("valid");
        let tree = kd_sah::build(&mesh, &BuildOptions::default()).expect("within limits");
        let packed = PackedTree::new(&tree, &mesh);
        let made = |change: &dyn Fn(&mut Vec<Pair>, &mut Vec<Block>)| {
            let (mut pairs, mut blocks) = (packed.pairs.to_vec(), packed.blocks.to_vec());
            change(&mut pairs, &mut blocks);
            PackedTree::from_buffers(pairs.into(), blocks.into(), &tree, &mesh)
        };
        let same = made(&|_, _| {}).expect("unchanged");
        assert_eq!(same.nodes(), packed.nodes());
        let refused = |change: &dyn Fn(&mut Vec<Pair>, &mut Vec<Block>)| {
            made(change).expect_err("changed").to_string()
        };
        let leaf = tree
            .nodes()
            .iter()
            .position(|node| node.is_leaf() && node.count() > 0);
        let leaf = leaf.expect("a leaf");
        assert_eq!(
            refused(&|pairs, _| pairs[leaf / 2].0[leaf % 2] = Node::EMPTY_LEAF),
            format!("node {leaf}: not that of the kd-tree")
        );
        assert_eq!(
            refused(&|_, blocks| blocks[3].triangles[0] ^= 1),
            "block 3, lane 0: not a triangle of the mesh"
        );
        assert_eq!(
            refused(&|_, blocks| blocks[2].corners[1][1][1] = 9.0),
            "block 2, lane 1: not a triangle of the mesh"
        );
        let count = packed.blocks().len();
        assert_eq!(
            refused(&|_, blocks| blocks.truncate(count - 1)),
            format!("{} blocks, the leaves refer to {count}", count - 1)
        );
        assert_eq!(
            refused(&|_, blocks| blocks.push(Block::EMPTY)),
            format!("{} blocks, the leaves refer to {count}", count + 1)
        );
        let nodes = tree.nodes().len();
        assert_eq!(
            refused(&|pairs, _| pairs.truncate(nodes / 2 - 1)),
            format!("node {}: not that of the kd-tree", nodes - 2)
        );
    }
}
