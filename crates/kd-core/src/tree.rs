//! A validated tree.

use glam::DVec3;
use thiserror::Error;

use crate::{
    Aabb, Arena, CostModel, Mesh, Node, NodeIndex, NodeView, Pair, Slot, TreeError, TreeStats,
    stats,
};

/// A kd-tree over triangles: a root in an [`Arena`], and the box that its planes divide.
///
/// Every tree has been validated and is immutable, so that traversals check nothing again. [`Arena::freeze`] lists the
/// validated properties.
#[derive(Clone, Debug)]
pub struct Tree {
    arena: Arena,
    root: NodeIndex,
    bounds: Aabb,
    slots: u32,
    depth: u8,
    cost: CostModel,
    limited_cells: usize,
}

impl Tree {
    /// A tree with an arena of its own, from a builder's output, which is moved, not copied.
    ///
    /// Indices in `pairs` and `refs` count from 0. The root is the first node of the first pair; the second node of that
    /// pair is not used. `slots` is the number of triangles, `bounds` the box around them, and `cost` the model that the
    /// tree was built for.
    ///
    /// Each node must have at most one parent, so that a traversal visits each node at most once. Leaves must not share
    /// references, so that the size of a layout is linear in the size of the tree. Linear in the number of nodes and
    /// references.
    ///
    /// # Errors
    ///
    /// [`TreeError`] names the first invalid node or reference, or the argument that is out of range.
    pub fn from_parts(
        pairs: Vec<Pair>,
        refs: Vec<Slot>,
        bounds: Aabb,
        slots: u32,
        cost: CostModel,
    ) -> Result<Self, TreeError> {
        if pairs.is_empty() {
            return Err(TreeError::NoRoot);
        }
        let mut arena = Arena::from_vecs(pairs, refs)?;
        arena.freeze(slots)?;
        refuse_shared_children(arena.nodes())?;
        refuse_shared_refs(arena.nodes(), arena.refs().len())?;
        Self::from_arena(arena, NodeIndex(0), bounds, cost)
    }

    /// The tree below a frozen node of an arena. A subtree may have several parents: merged trees share unchanged subtrees
    /// in this way. Constant time.
    ///
    /// # Errors
    ///
    /// [`TreeError`] if the root is not frozen, the box is neither finite nor empty, or the cost model is out of range.
    pub fn from_arena(
        arena: Arena,
        root: NodeIndex,
        bounds: Aabb,
        cost: CostModel,
    ) -> Result<Self, TreeError> {
        if let Some((field, rule)) = cost.problem() {
            return Err(TreeError::BadCost { field, rule });
        }
        let is_finite = bounds.min.is_finite() && bounds.max.is_finite();
        if bounds != Aabb::EMPTY && !is_finite {
            return Err(TreeError::BadBounds);
        }
        let depth = arena
            .height(root)
            .ok_or(TreeError::BadRoot { node: root })?;
        let slots = arena.slots();
        Ok(Self {
            arena,
            root,
            bounds,
            slots,
            depth,
            cost,
            limited_cells: 0,
        })
    }

    /// The same tree with the number of cells that the builder left undivided because the limit of references was reached.
    /// The number describes the build; files do not store it.
    #[must_use]
    pub fn with_limited_cells(mut self, limited_cells: usize) -> Self {
        self.limited_cells = limited_cells;
        self
    }

    /// The number of cells that were not divided because the limit of references was reached, including cells below a node
    /// that was made a leaf afterwards. If it is 0, the tree equals the one built without a limit. It is also 0 for trees
    /// read from a file.
    pub fn limited_cells(&self) -> usize {
        self.limited_cells
    }

    pub(crate) fn arena(&self) -> &Arena {
        &self.arena
    }

    /// All nodes of the arena; indices in nodes refer to this slice. Some nodes may be unreachable from the root.
    #[inline]
    pub fn nodes(&self) -> &[Node] {
        self.arena.nodes()
    }

    /// All references of the arena; leaves refer to ranges of this slice.
    #[inline]
    pub fn refs(&self) -> &[Slot] {
        self.arena.refs()
    }

    /// The index of the root node.
    #[inline]
    pub fn root(&self) -> NodeIndex {
        self.root
    }

    /// The box around all triangles, not padded; empty for a tree without triangles.
    #[inline]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The number of triangles of the mesh; slots of references are below it.
    #[inline]
    pub fn triangles(&self) -> u32 {
        self.slots
    }

    /// The cost model that the tree was built for.
    #[inline]
    pub fn cost(&self) -> &CostModel {
        &self.cost
    }

    /// The number of interior nodes above the deepest leaf, at most [`MAX_DEPTH`](crate::MAX_DEPTH).
    pub fn depth(&self) -> usize {
        usize::from(self.depth)
    }

    /// The references of a leaf of this tree.
    #[inline]
    pub fn leaf_refs(&self, leaf: Node) -> &[Slot] {
        let first = leaf.first_ref() as usize;
        &self.refs()[first..first + leaf.count() as usize]
    }

    /// Bytes of nodes, references and heights.
    pub fn bytes(&self) -> usize {
        self.arena.bytes()
    }

    /// Counts, histograms and costs. Linear in the number of paths from the root to nodes; a subtree with several parents is
    /// visited once per path.
    pub fn stats(&self) -> TreeStats {
        TreeStats::of(self)
    }

    /// The expected cost, by the surface area heuristic, of a ray that meets the root's box, under any cost model. It
    /// compares trees that were built for different models. Under the tree's own model it equals
    /// [`TreeStats::sah_cost_own`] up to rounding. Cost as for [`stats`](Self::stats).
    pub fn sah_cost(&self, model: &CostModel) -> f64 {
        stats::sah_cost(self, model)
    }

    /// Checks that the tree covers a mesh: the tree's box is that of the mesh, and every leaf whose cell a triangle reaches
    /// into refers to that triangle. A triangle that lies in a split plane needs to be on one side only.
    ///
    /// This is the oracle for builders, for tests and for files of unknown origin. Traversals are safe without it. It
    /// ignores pieces of triangles thinner than 10⁻⁹ of the box's diagonal, which the padding of the traversal covers. It
    /// takes about as long as a build.
    ///
    /// # Errors
    ///
    /// [`Uncovered`] names the first triangle that is missing in a leaf, and that leaf.
    pub fn check_coverage(&self, mesh: &Mesh) -> Result<(), Uncovered> {
        if self.bounds != mesh.bounds() {
            return Err(Uncovered::Bounds);
        }
        let slack = 1e-9 * (self.bounds.max.as_dvec3() - self.bounds.min.as_dvec3()).length();
        for (triangle, _) in (0_u32..).zip(mesh.triangles()) {
            let polygon: Vec<DVec3> = mesh.corners(triangle).map(|p| p.as_dvec3()).to_vec();
            let piece = Piece {
                node: self.root,
                polygon,
            };
            let mut missing = Vec::new();
            self.add_missing(Slot(triangle), piece, slack, &mut missing);
            if let Some(Piece { node: leaf, .. }) = missing.first() {
                let leaf = *leaf;
                return Err(Uncovered::Triangle { triangle, leaf });
            }
        }
        Ok(())
    }

    /// Divides a piece of the triangle `slot` down to leaves, and adds to `missing` what reaches into leaves that do not
    /// refer to the triangle.
    fn add_missing(&self, slot: Slot, piece: Piece, slack: f64, missing: &mut Vec<Piece>) {
        let Piece {
            node: index,
            polygon,
        } = piece;
        let node = self.nodes()[index.index()];
        let (axis, split, first) = match node.view() {
            NodeView::Leaf { .. } => {
                if !self.leaf_refs(node).contains(&slot) {
                    missing.push(Piece {
                        node: index,
                        polygon,
                    });
                }
                return;
            }
            NodeView::Interior { axis, split, first } => (axis.index(), f64::from(split), first),
        };
        let reaches_lower = polygon.iter().any(|p| p[axis] < split - slack);
        let reaches_upper = polygon.iter().any(|p| p[axis] > split + slack);
        let add_below = |polygon, missing: &mut Vec<Piece>| {
            let node = first;
            self.add_missing(slot, Piece { node, polygon }, slack, missing);
        };
        let add_above = |polygon, missing: &mut Vec<Piece>| {
            let node = first.sibling();
            self.add_missing(slot, Piece { node, polygon }, slack, missing);
        };
        if !(reaches_lower || reaches_upper) {
            // A polygon in the plane must be covered by the two sides together: each piece of it on either side.
            let mut not_below = Vec::new();
            add_below(polygon, &mut not_below);
            for piece in not_below {
                add_above(piece.polygon, missing);
            }
            return;
        }
        // Clip even where the other piece is too thin to matter: it may be wide along another axis.
        if reaches_lower {
            add_below(clipped_below(&polygon, axis, split, 1.0), missing);
        }
        if reaches_upper {
            add_above(clipped_below(&polygon, axis, split, -1.0), missing);
        }
    }
}

/// A piece of a triangle, and the node whose cell it reaches into.
struct Piece {
    node: NodeIndex,
    polygon: Vec<DVec3>,
}

/// The reason why a tree does not cover a mesh.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Uncovered {
    /// The box of the tree is not the box of the mesh.
    #[error("the bounds of the tree differ from those of the mesh")]
    Bounds,
    /// A triangle reaches into the cell of a leaf that does not refer to it.
    #[error("triangle {triangle} reaches into leaf {leaf}, which does not refer to it")]
    Triangle {
        /// The number of the triangle.
        triangle: u32,
        /// The index of the leaf.
        leaf: NodeIndex,
    },
}

/// Fails if two nodes have the same children. Otherwise one path leads to each node.
fn refuse_shared_children(nodes: &[Node]) -> Result<(), TreeError> {
    let mut has_parent = vec![false; nodes.len() / 2];
    for (index, node) in (0_u32..).zip(nodes) {
        if node.is_leaf() {
            continue;
        }
        let child = node.first_child();
        if std::mem::replace(&mut has_parent[child.index() / 2], true) {
            let node = NodeIndex(index);
            return Err(TreeError::SharedChild { node, child });
        }
    }
    Ok(())
}

/// Fails if leaves have more references in total than the list holds. Many leaves that share one long list would turn a
/// small file into a large layout.
fn refuse_shared_refs(nodes: &[Node], refs: usize) -> Result<(), TreeError> {
    let leaves = nodes.iter().filter(|node| node.is_leaf());
    let used = leaves.map(|leaf| u64::from(leaf.count())).sum();
    if used > refs as u64 {
        return Err(TreeError::SharedRefs { used, refs });
    }
    Ok(())
}

/// The part of a polygon where `sign * coordinate <= sign * plane`.
///
/// This is deliberately not the clipping code of builders: the oracle must not share its errors.
fn clipped_below(polygon: &[DVec3], axis: usize, plane: f64, sign: f64) -> Vec<DVec3> {
    let height = |p: &DVec3| sign * (p[axis] - plane);
    let mut clipped = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        if height(a) <= 0.0 {
            clipped.push(*a);
        }
        if (height(a) < 0.0 && height(b) > 0.0) || (height(a) > 0.0 && height(b) < 0.0) {
            clipped.push(a.lerp(*b, height(a) / (height(a) - height(b))));
        }
    }
    clipped
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Axis;

    fn two_triangles() -> Mesh {
        let positions = vec![
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [3.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [3.0, 1.0, 0.0],
        ];
        Mesh::new(positions, vec![[0, 1, 2], [3, 4, 5]]).expect("valid")
    }

    fn split_at(split: f32, lower: Node, upper: Node, refs: &[Slot]) -> Tree {
        let root = Node::interior(Axis::X, split, NodeIndex(2)).expect("small");
        let pairs = [Pair([root, Node::EMPTY_LEAF]), Pair([lower, upper])];
        let mesh = two_triangles();
        Tree::from_parts(
            pairs.to_vec(),
            refs.to_vec(),
            mesh.bounds(),
            2,
            CostModel::CLASSIC,
        )
        .expect("valid")
    }

    /// Merged trees contain such planes: a plane of one tree above planes of another, whose builder chose the side of a
    /// coplanar piece independently.
    #[test]
    fn pieces_in_a_plane_may_be_on_either_side() {
        let positions = vec![[0.0, 0.0, 0.5], [2.0, 0.0, 0.5], [0.0, 2.0, 0.5]];
        let mesh = Mesh::new(positions, vec![[0, 1, 2]]).expect("valid");
        let node =
            |axis, split, first| Node::interior(axis, split, NodeIndex(first)).expect("small");
        let leaf = |first| Node::leaf(first, 1).expect("small");
        let covered = |right: Node| {
            let pairs = vec![
                Pair([node(Axis::Z, 0.5, 2), Node::EMPTY_LEAF]),
                Pair([node(Axis::X, 1.0, 4), node(Axis::X, 1.0, 6)]),
                Pair([leaf(0), Node::EMPTY_LEAF]),
                Pair([Node::EMPTY_LEAF, right]),
            ];
            let refs = vec![Slot(0), Slot(0)];
            let tree = Tree::from_parts(pairs, refs, mesh.bounds(), 1, CostModel::CLASSIC);
            tree.expect("valid").check_coverage(&mesh)
        };
        assert_eq!(
            covered(leaf(1)),
            Ok(()),
            "the left half is below, the right half above"
        );
        let missing = covered(Node::EMPTY_LEAF);
        let (triangle, leaf) = (0, NodeIndex(7));
        assert_eq!(
            missing,
            Err(Uncovered::Triangle { triangle, leaf }),
            "the right half is missing"
        );
    }

    #[test]
    fn check_coverage_finds_missing_references() {
        let leaf = |first, count| Node::leaf(first, count).expect("small");
        let good = split_at(2.0, leaf(0, 1), leaf(1, 1), &[Slot(0), Slot(1)]);
        assert_eq!(
            good.check_coverage(&two_triangles()),
            Ok(()),
            "each in its own leaf"
        );
        let swapped = split_at(2.0, leaf(1, 1), leaf(0, 1), &[Slot(0), Slot(1)]);
        assert_eq!(
            swapped.check_coverage(&two_triangles()),
            Err(Uncovered::Triangle {
                triangle: 0,
                leaf: NodeIndex(2)
            }),
            "each in the wrong leaf"
        );
        let straddled = split_at(0.5, leaf(0, 1), leaf(1, 1), &[Slot(0), Slot(1)]);
        assert_eq!(
            straddled.check_coverage(&two_triangles()),
            Err(Uncovered::Triangle {
                triangle: 0,
                leaf: NodeIndex(3)
            }),
            "the upper part of the triangle is missing"
        );
    }

    #[test]
    fn a_tree_without_nodes_is_refused() {
        let error = Tree::from_parts(vec![], vec![], Aabb::EMPTY, 0, CostModel::CLASSIC);
        assert_eq!(
            error.err(),
            Some(TreeError::NoRoot),
            "an empty tree has a root too"
        );
    }

    #[test]
    fn invalid_bounds_cost_and_root_are_refused() {
        let leaf = || vec![Pair([Node::EMPTY_LEAF; 2])];
        let with = |bounds, cost| Tree::from_parts(leaf(), vec![], bounds, 0, cost).err();
        let unit = Aabb::around([glam::Vec3::ZERO, glam::Vec3::ONE]);
        assert_eq!(with(unit, CostModel::CLASSIC), None, "valid");
        let mut infinite = unit;
        infinite.max.x = f32::INFINITY;
        assert_eq!(
            with(infinite, CostModel::CLASSIC),
            Some(TreeError::BadBounds),
            "infinite"
        );
        let no_lanes = CostModel {
            lanes: 0,
            ..CostModel::CLASSIC
        };
        assert!(
            matches!(with(unit, no_lanes), Some(TreeError::BadCost { .. })),
            "no lanes"
        );
        let tree = Tree::from_parts(leaf(), vec![], unit, 0, CostModel::CLASSIC).expect("valid");
        let uncovered = tree.check_coverage(&two_triangles());
        assert_eq!(
            uncovered,
            Err(Uncovered::Bounds),
            "the bounds of another mesh"
        );
        let root = NodeIndex(2);
        let error = Tree::from_arena(Arena::new(), root, unit, CostModel::CLASSIC).err();
        assert_eq!(
            error,
            Some(TreeError::BadRoot { node: root }),
            "no such node"
        );
    }

    /// 64 levels of shared children would have 2⁶⁴ paths.
    #[test]
    fn shared_children_are_refused() {
        let to = |first| Node::interior(Axis::X, 0.5, NodeIndex(first)).expect("small");
        let pairs = vec![
            Pair([to(2), Node::EMPTY_LEAF]),
            Pair([to(4), to(4)]),
            Pair([Node::EMPTY_LEAF; 2]),
        ];
        let unit = Aabb::around([glam::Vec3::ZERO, glam::Vec3::ONE]);
        let error = Tree::from_parts(pairs, vec![], unit, 0, CostModel::CLASSIC).err();
        let expected = TreeError::SharedChild {
            node: NodeIndex(3),
            child: NodeIndex(4),
        };
        assert_eq!(error, Some(expected), "the second parent");
    }

    /// The layout of a thousand leaves that share a thousand references would hold a million triangles.
    #[test]
    fn shared_references_are_refused() {
        let unit = Aabb::around([glam::Vec3::ZERO, glam::Vec3::ONE]);
        let root = Node::interior(Axis::X, 0.5, NodeIndex(2)).expect("small");
        let parts = |second| {
            let leaf = |first| Node::leaf(first, 2).expect("small");
            let pairs = vec![
                Pair([root, Node::EMPTY_LEAF]),
                Pair([leaf(0), leaf(second)]),
            ];
            let refs = vec![Slot(0); 2 + second as usize];
            Tree::from_parts(pairs, refs, unit, 1, CostModel::CLASSIC).err()
        };
        let expected = TreeError::SharedRefs { used: 4, refs: 3 };
        assert_eq!(parts(1), Some(expected), "one reference is shared");
        assert_eq!(parts(2), None, "each leaf has its own references");
    }
}
