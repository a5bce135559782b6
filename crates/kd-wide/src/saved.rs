//! Wide trees from saved nodes and blocks, with or without a check.

use bytemuck::bytes_of;
use kd_buffer::Buffer;
use kd_core::{Aabb, LayoutError, Mesh};
use kd_simd::{LANES, Level};

use crate::arrays::Arrays;
use crate::block::Block;
use crate::divide::MAX_LEVELS;
use crate::frame::Frame;
use crate::node::{Child, WIDTH, WideNode};
use crate::tree::WideTree;

impl WideTree {
    /// A tree of the [`nodes`](Self::nodes), the [`blocks`](Self::blocks) and the [`root`](Self::root) of an earlier one over `mesh`.
    ///
    /// Checks that rays end, at any node, and that every block holds triangles of the mesh. Does not check that boxes contain what is
    /// below them, so that a forged tree may lose hits. Linear.
    ///
    /// # Errors
    ///
    /// [`LayoutError`] names the first node or block that is not valid.
    #[allow(
        unsafe_code,
        reason = "children are checked here, with an error for each"
    )]
    pub fn from_buffers(
        nodes: Buffer<WideNode>,
        blocks: Buffer<Block>,
        root: Child,
        mesh: &Mesh,
    ) -> Result<Self, LayoutError> {
        check_nodes(&nodes, blocks.len(), root)?;
        for (number, block) in blocks.iter().enumerate() {
            check_block(number, block, mesh)?;
        }
        // SAFETY: `check_nodes` has checked the root and every child.
        Ok(unsafe { Self::from_trusted_buffers(nodes, blocks, root, &mesh.bounds()) })
    }

    /// [`from_buffers`](Self::from_buffers) without a check, and without reading a node or a block. `bounds` are those of the mesh.
    ///
    /// # Safety
    ///
    /// Nodes, blocks and root are those of one [`WideTree`], and do not change.
    #[allow(unsafe_code, reason = "passes the contract on to the arrays")]
    pub unsafe fn from_trusted_buffers(
        nodes: Buffer<WideNode>,
        blocks: Buffer<Block>,
        root: Child,
        bounds: &Aabb,
    ) -> Self {
        Self {
            // SAFETY: those of a tree were checked when it was made.
            arrays: unsafe { Arrays::new_unchecked(nodes, blocks, root) },
            frame: Frame::new(bounds),
            level: Level::detect(),
        }
    }
}

/// Checks that children are there, that one path leads to each node, and that a ray's stack holds what is pending on it.
fn check_nodes(nodes: &[WideNode], blocks: usize, root: Child) -> Result<(), LayoutError> {
    if !root.is_within(nodes.len(), blocks) {
        return Err(LayoutError::MissingRoot);
    }
    // Parents come first, so one pass knows the level of a parent before those of its children. 0 is a node without a parent.
    let mut levels = vec![0_u8; nodes.len()];
    for (number, node) in nodes.iter().enumerate() {
        for (lane, child) in node.children.into_iter().enumerate() {
            let node = number;
            if !child.is_within(nodes.len(), blocks) {
                return Err(LayoutError::MissingChild { node, lane });
            }
            if child.is_leaf() {
                continue;
            }
            if child.index() <= number {
                return Err(LayoutError::ChildNotBehind { node, lane });
            }
            let level = usize::from(levels[number]) + 1;
            if level >= MAX_LEVELS {
                return Err(LayoutError::TooDeep {
                    levels: level + 1,
                    most: MAX_LEVELS,
                });
            }
            if levels[child.index()] > 0 {
                return Err(LayoutError::SharedChild { node, lane });
            }
            levels[child.index()] = u8::try_from(level).expect("as checked");
        }
        for (octant, order) in node.orders.iter().enumerate() {
            let lanes = (0..WIDTH).fold(0, |lanes, place| lanes | 1 << (order >> (3 * place) & 7));
            if lanes != (1 << WIDTH) - 1 {
                return Err(LayoutError::BadOrder {
                    node: number,
                    octant,
                });
            }
        }
    }
    Ok(())
}

const _: () = assert!(MAX_LEVELS <= u8::MAX as usize, "a byte counts levels");

/// Checks that a block equals the one that its numbers make.
fn check_block(number: usize, block: &Block, mesh: &Mesh) -> Result<(), LayoutError> {
    let bad = |lane| LayoutError::BadTriangle {
        block: number,
        lane,
    };
    let count = block.count() as usize;
    let triangles = &block.triangles[..count];
    let missing = |triangle: &u32| *triangle as usize >= mesh.len();
    if let Some(lane) = triangles.iter().position(missing) {
        return Err(bad(lane));
    }
    let expected = Block::of(triangles.iter().copied(), mesh);
    let differs = |lane: &usize| {
        let corners = |block: &Block| block.corners_of(*lane).map(|corner| corner.to_array());
        bytes_of(&corners(block)) != bytes_of(&corners(&expected))
    };
    match (0..LANES).find(differs) {
        Some(lane) => Err(bad(lane)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> (Mesh, WideTree) {
        let corner = |i: u32| {
            let i = i as f32;
            [(0.7 * i).sin(), (0.3 * i).cos(), 0.01 * i]
        };
        let positions = (0..9000).map(corner).collect();
        let triangles = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
        // Triangles without an area have lanes, too.
        let triangles = triangles.chain([[0, 0, 1], [5, 5, 5]]).collect();
        let mesh = Mesh::new(positions, triangles).expect("valid");
        let tree = WideTree::from_objects(&mesh);
        (mesh, tree)
    }

    #[test]
    fn a_tree_passes_as_it_was_made() {
        for mesh in [
            example().0,
            Mesh::new(vec![], vec![]).expect("an empty one"),
        ] {
            let tree = WideTree::from_objects(&mesh);
            let (nodes, blocks) = (tree.nodes().to_vec(), tree.blocks().to_vec());
            let same = WideTree::from_buffers(nodes.into(), blocks.into(), tree.root(), &mesh);
            assert!(same.expect("valid") == tree, "{} triangles", mesh.len());
        }
    }

    type Change<'a> = &'a dyn Fn(&mut Vec<WideNode>, &mut Vec<Block>, &mut Child);

    #[test]
    fn what_is_not_a_tree_is_refused() {
        let (mesh, tree) = example();
        let refused = |change: Change<'_>| {
            let (mut nodes, mut blocks) = (tree.nodes().to_vec(), tree.blocks().to_vec());
            let mut root = tree.root();
            change(&mut nodes, &mut blocks, &mut root);
            let tree = WideTree::from_buffers(nodes.into(), blocks.into(), root, &mesh);
            tree.expect_err("changed").to_string()
        };
        let [first, second, ..] = tree.nodes()[0].children;
        assert!(
            !first.is_leaf() && !second.is_leaf(),
            "nodes below the root"
        );
        let blocks = tree.blocks().len();
        assert_eq!(
            refused(&|_, _, root| *root = Child::node(9999)),
            "the root is not in the layout"
        );
        assert_eq!(
            refused(&|nodes, _, _| nodes[0].children[1] = Child::leaf(blocks - 1, 2)),
            "node 0, child 1: not in the layout"
        );
        assert_eq!(
            refused(&|nodes, _, _| nodes[1].children[0] = Child::node(1)),
            "node 1, child 0: not stored behind the node"
        );
        assert_eq!(
            refused(&|nodes, _, _| nodes[0].children[1] = nodes[0].children[0]),
            "node 0, child 1: has another parent"
        );
        assert_eq!(
            refused(&|nodes, _, _| nodes[0].orders[3] = 0o76_543_211),
            "node 0: octant 3 does not order all children"
        );
        assert_eq!(
            refused(&|_, blocks, _| blocks[1].triangles[2] = 3002),
            "block 1, lane 2: not a triangle of the mesh"
        );
        assert_eq!(
            refused(&|_, blocks, _| blocks[0].corners[2][1][1] += 0.5),
            "block 0, lane 1: not a triangle of the mesh"
        );
        assert_eq!(
            refused(&|_, blocks, _| blocks[0].corners[0][0][0] = Block::EMPTY.corners[0][0][0]),
            "block 0, lane 0: not a triangle of the mesh"
        );
        assert_eq!(
            refused(&|nodes, _, _| {
                let chain = (0..MAX_LEVELS).map(|level| {
                    let mut node = WideNode::EMPTY;
                    if level + 1 < MAX_LEVELS {
                        node.children[0] = Child::node(level + 1);
                    }
                    node
                });
                *nodes = chain.chain([WideNode::EMPTY]).collect();
                nodes[MAX_LEVELS - 1].children[0] = Child::node(MAX_LEVELS);
            }),
            format!(
                "{} levels of nodes, at most {MAX_LEVELS} are valid",
                MAX_LEVELS + 1
            )
        );
    }
}
