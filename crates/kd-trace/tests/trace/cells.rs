//! Trees cut into cells, as if somebody had divided them where rays go.

use kd_core::{Aabb, Axis, MAX_DEPTH, Mesh, Node, NodeIndex, NodeView, Pair, Slot, Tree};
use kd_trace::lazy::{Entered, LazyCells};
use kd_trace::{Level, PackedTree};

/// The upper levels of a tree as cells, what lies below as trees of their own.
pub(crate) struct CutTree {
    bounds: Aabb,
    root: Cell,
}

pub(crate) enum Cell {
    Interior {
        axis: Axis,
        split: f32,
        children: Box<[Self; 2]>,
    },
    Subtree(PackedTree),
}

impl CutTree {
    /// Cut below the first levels, within subtrees, and at the leaves.
    pub(crate) fn both(tree: &Tree, mesh: &Mesh) -> [Self; 2] {
        [
            Self::new(tree, mesh, 3, Level::detect()),
            Self::new(tree, mesh, MAX_DEPTH, Level::portable()),
        ]
    }

    /// Divides cells down to this number of levels, and packs the trees there for a level of instructions.
    fn new(tree: &Tree, mesh: &Mesh, levels: usize, instructions: Level) -> Self {
        let cut = Cut {
            tree,
            mesh,
            instructions,
        };
        Self {
            bounds: tree.bounds(),
            root: cut.cell(tree.nodes()[tree.root().index()], levels),
        }
    }
}

impl LazyCells for CutTree {
    type Cell = Cell;

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn root(&self) -> &Cell {
        &self.root
    }

    fn enter<'a>(&'a self, cell: &'a Cell) -> Entered<'a, Cell> {
        match cell {
            Cell::Interior {
                axis,
                split,
                children,
            } => Entered::Interior {
                axis: *axis,
                split: *split,
                children,
            },
            Cell::Subtree(tree) => Entered::Subtree(tree),
        }
    }
}

struct Cut<'a> {
    tree: &'a Tree,
    mesh: &'a Mesh,
    instructions: Level,
}

impl Cut<'_> {
    fn cell(&self, node: Node, levels: usize) -> Cell {
        match node.view() {
            NodeView::Interior { axis, split, first } if levels > 0 => {
                let children = [first, first.sibling()]
                    .map(|child| self.cell(self.tree.nodes()[child.index()], levels - 1));
                Cell::Interior {
                    axis,
                    split,
                    children: Box::new(children),
                }
            }
            _ => Cell::Subtree(self.subtree(node)),
        }
    }

    fn subtree(&self, node: Node) -> PackedTree {
        let mut pairs = vec![Pair([Node::EMPTY_LEAF; 2])];
        let mut refs = Vec::new();
        let root = self.copy(node, &mut pairs, &mut refs);
        pairs[0].0[0] = root;
        let tree = Tree::from_parts(
            pairs,
            refs,
            self.tree.bounds(),
            self.tree.triangles(),
            *self.tree.cost(),
        );
        PackedTree::new(&tree.expect("valid"), self.mesh).with_level(self.instructions)
    }

    fn copy(&self, node: Node, pairs: &mut Vec<Pair>, refs: &mut Vec<Slot>) -> Node {
        match node.view() {
            NodeView::Leaf { count, .. } => {
                let first = u32::try_from(refs.len()).expect("small");
                refs.extend(self.tree.leaf_refs(node));
                Node::leaf(first, count).expect("small")
            }
            NodeView::Interior { axis, split, first } => {
                let pair = pairs.len();
                pairs.push(Pair([Node::EMPTY_LEAF; 2]));
                let children = [first, first.sibling()]
                    .map(|child| self.copy(self.tree.nodes()[child.index()], pairs, refs));
                pairs[pair] = Pair(children);
                let place = NodeIndex(u32::try_from(2 * pair).expect("small"));
                Node::interior(axis, split, place).expect("small")
            }
        }
    }
}
