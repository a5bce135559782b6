//! A validated tree.

use glam::DVec3;
use thiserror::Error;

use crate::{
    Aabb, Arena, CostModel, Mesh, Node, NodeIndex, NodeView, Pair, Slot, TreeError, TreeStats,
    stats,
};

/// A kd-tree over triangles: a root in an [`Arena`], and the box its planes divide.
///
/// It can only be made through validation and cannot be changed after, so traversals do not check again: see
/// [`Arena::freeze`] for what holds.
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
    /// A tree of its own arena from a builder's output, which is moved, not copied.
    ///
    /// Indices in `pairs` and `refs` count from 0; the root is the first node of the first pair, the other node of
    /// that pair is not used. `slots` is the number of triangles, `bounds` the box around them, and `cost` the model
    /// the tree was built for. Each node has one parent at most, so that a walk ends after as many steps as there are
    /// nodes, and leaves do not share references, so that what is derived from the tree is not much larger. Linear in the number of nodes and references.
    ///
    /// # Errors
    ///
    /// [`TreeError`] names the first broken node, or says what is wrong with the rest.
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

    /// The tree below a frozen node of an arena. Subtrees may have several parents: that is how merged trees share
    /// what stands still. Constant time.
    ///
    /// # Errors
    ///
    /// [`TreeError`] if the root is not frozen, the box neither finite nor empty, or the cost model out of range.
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

    /// The same tree with the builder's count of cells that it would have divided, had there been references left. It
    /// is a note on the build, not on the tree: files do not keep it.
    #[must_use]
    pub fn with_limited_cells(mut self, limited_cells: usize) -> Self {
        self.limited_cells = limited_cells;
        self
    }

    /// How many cells were not divided because the limit of references was reached, those below a node that was made a
    /// leaf afterwards included: 0 says that the tree is the one without a limit. Also 0 for trees that come from a file.
    pub fn limited_cells(&self) -> usize {
        self.limited_cells
    }

    pub(crate) fn arena(&self) -> &Arena {
        &self.arena
    }

    /// All nodes of the arena; indices in nodes refer to this slice. Unreachable ones may be among them.
    #[inline]
    pub fn nodes(&self) -> &[Node] {
        self.arena.nodes()
    }

    /// All references of the arena; leaves name ranges of this slice.
    #[inline]
    pub fn refs(&self) -> &[Slot] {
        self.arena.refs()
    }

    /// Where the tree starts.
    #[inline]
    pub fn root(&self) -> NodeIndex {
        self.root
    }

    /// The box around all triangles, not padded; empty if there are none.
    #[inline]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// How many triangles the tree is over.
    #[inline]
    pub fn triangles(&self) -> u32 {
        self.slots
    }

    /// The cost model the tree was built for.
    #[inline]
    pub fn cost(&self) -> &CostModel {
        &self.cost
    }

    /// Levels of interior nodes above the deepest leaf.
    pub fn depth(&self) -> usize {
        usize::from(self.depth)
    }

    /// The triangles of a leaf.
    #[inline]
    pub fn leaf_refs(&self, leaf: Node) -> &[Slot] {
        let first = leaf.first_ref() as usize;
        &self.refs()[first..first + leaf.count() as usize]
    }

    /// Bytes of nodes, references and heights.
    pub fn bytes(&self) -> usize {
        self.arena.bytes()
    }

    /// Counts, histograms and costs; linear in the number of nodes, each as often as there are paths to it.
    pub fn stats(&self) -> TreeStats {
        TreeStats::of(self)
    }

    /// What the surface area heuristic expects a ray to pay that meets the root's box, under any model: to compare trees
    /// that were built for different ones. Under the tree's own it is [`TreeStats::sah_cost_own`], up to rounding.
    pub fn sah_cost(&self, model: &CostModel) -> f64 {
        stats::sah_cost(self, model)
    }

    /// Checks that no part of any triangle is missing: the box is that of the mesh, and every cell that a triangle reaches into leads to a leaf that
    /// refers to it. A triangle lying in a plane needs to be on one side only.
    ///
    /// This is the builders' oracle, for tests and for files of unknown origin; traversal does not need it to be safe.
    /// Parts thinner than 10⁻⁹ of the box's diagonal are left to the padding of the traversal. Costs about as much
    /// as a build.
    ///
    /// # Errors
    ///
    /// The first triangle that is missing somewhere, and the leaf that should refer to it.
    pub fn check_coverage(&self, mesh: &Mesh) -> Result<(), Uncovered> {
        if self.bounds != mesh.bounds() {
            return Err(Uncovered::Bounds);
        }
        let slack = 1e-9 * (self.bounds.max.as_dvec3() - self.bounds.min.as_dvec3()).length();
        for (triangle, _) in (0_u32..).zip(mesh.triangles()) {
            let polygon: Vec<DVec3> = mesh.corners(triangle).map(|p| p.as_dvec3()).to_vec();
            let part = Part {
                place: self.root,
                polygon,
            };
            let mut missing = Vec::new();
            self.add_missing(Slot(triangle), part, slack, &mut missing);
            if let Some(Part { place: leaf, .. }) = missing.first() {
                let leaf = *leaf;
                return Err(Uncovered::Triangle { triangle, leaf });
            }
        }
        Ok(())
    }

    /// Adds the parts of a part of a triangle that reach into leaves which do not refer to it.
    fn add_missing(&self, slot: Slot, part: Part, slack: f64, missing: &mut Vec<Part>) {
        let Part { place, polygon } = part;
        let node = self.nodes()[place.index()];
        let (axis, split, first) = match node.view() {
            NodeView::Leaf { .. } => {
                if !self.leaf_refs(node).contains(&slot) {
                    missing.push(Part { place, polygon });
                }
                return;
            }
            NodeView::Interior { axis, split, first } => (axis.index(), f64::from(split), first),
        };
        let reaches_lower = polygon.iter().any(|p| p[axis] < split - slack);
        let reaches_upper = polygon.iter().any(|p| p[axis] > split + slack);
        let below = |polygon, missing: &mut Vec<Part>| {
            let place = first;
            self.add_missing(slot, Part { place, polygon }, slack, missing);
        };
        let above = |polygon, missing: &mut Vec<Part>| {
            let place = first.sibling();
            self.add_missing(slot, Part { place, polygon }, slack, missing);
        };
        if !(reaches_lower || reaches_upper) {
            // What lies in the plane is on one side, one part of it perhaps on this and another on that.
            let mut not_below = Vec::new();
            below(polygon, &mut not_below);
            for part in not_below {
                above(part.polygon, missing);
            }
            return;
        }
        // Clipped even where the other part is too thin to matter: it may be wide along another axis.
        if reaches_lower {
            below(part_below(&polygon, axis, split, 1.0), missing);
        }
        if reaches_upper {
            above(part_below(&polygon, axis, split, -1.0), missing);
        }
    }
}

/// A part of a triangle, and the node into whose cell it reaches.
struct Part {
    place: NodeIndex,
    polygon: Vec<DVec3>,
}

/// What a tree misses of its mesh.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum Uncovered {
    /// The box of the tree is not the box of the mesh.
    #[error("the bounds are not those of the mesh")]
    Bounds,
    /// A leaf should refer to a triangle and does not.
    #[error("triangle {triangle} reaches into leaf {leaf}, which does not refer to it")]
    Triangle {
        /// The triangle's number.
        triangle: u32,
        /// The leaf's place.
        leaf: NodeIndex,
    },
}

/// Without a second parent anywhere, there is one path to each node.
fn refuse_shared_children(nodes: &[Node]) -> Result<(), TreeError> {
    let mut has_parent = vec![false; nodes.len() / 2];
    for (place, node) in (0_u32..).zip(nodes) {
        if node.is_leaf() {
            continue;
        }
        let child = node.first_child();
        if std::mem::replace(&mut has_parent[child.index() / 2], true) {
            let node = NodeIndex(place);
            return Err(TreeError::SharedChild { node, child });
        }
    }
    Ok(())
}

/// A few leaves that all name the same long list would make a small file a large structure.
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
/// Deliberately not the clipping that builders use: an oracle should not share their mistakes.
fn part_below(polygon: &[DVec3], axis: usize, plane: f64, sign: f64) -> Vec<DVec3> {
    let height = |p: &DVec3| sign * (p[axis] - plane);
    let mut part = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        if height(a) <= 0.0 {
            part.push(*a);
        }
        if (height(a) < 0.0 && height(b) > 0.0) || (height(a) > 0.0 && height(b) < 0.0) {
            part.push(a.lerp(*b, height(a) / (height(a) - height(b))));
        }
    }
    part
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

    /// A merged tree has such planes: those of one tree above those of another, which sorted parts as it liked.
    #[test]
    fn parts_in_a_plane_may_be_on_either_side() {
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
        assert_eq!(covered(leaf(1)), Ok(()), "left below, right above");
        let missing = covered(Node::EMPTY_LEAF);
        let (triangle, leaf) = (0, NodeIndex(7));
        assert_eq!(
            missing,
            Err(Uncovered::Triangle { triangle, leaf }),
            "right nowhere"
        );
    }

    #[test]
    fn coverage_finds_what_is_missing() {
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
            "in the wrong leaf"
        );
        let straddled = split_at(0.5, leaf(0, 1), leaf(1, 1), &[Slot(0), Slot(1)]);
        assert_eq!(
            straddled.check_coverage(&two_triangles()),
            Err(Uncovered::Triangle {
                triangle: 0,
                leaf: NodeIndex(3)
            }),
            "half of it is missing"
        );
    }

    #[test]
    fn no_nodes_is_no_tree() {
        let error = Tree::from_parts(vec![], vec![], Aabb::EMPTY, 0, CostModel::CLASSIC);
        assert_eq!(
            error.err(),
            Some(TreeError::NoRoot),
            "even an empty tree has a root"
        );
    }

    #[test]
    fn what_does_not_belong_together_is_refused() {
        let leaf = || vec![Pair([Node::EMPTY_LEAF; 2])];
        let with = |bounds, cost| Tree::from_parts(leaf(), vec![], bounds, 0, cost).err();
        let unit = Aabb::around([glam::Vec3::ZERO, glam::Vec3::ONE]);
        assert_eq!(with(unit, CostModel::CLASSIC), None, "fine");
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
            "the box of something else"
        );
        let root = NodeIndex(2);
        let error = Tree::from_arena(Arena::new(), root, unit, CostModel::CLASSIC).err();
        assert_eq!(
            error,
            Some(TreeError::BadRoot { node: root }),
            "no such node"
        );
    }

    /// 64 levels of it would be 2⁶⁴ paths.
    #[test]
    fn a_parts_list_with_shared_children_is_refused() {
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

    /// A thousand leaves that name the same thousand triangles would pack to a million.
    #[test]
    fn a_parts_list_with_shared_references_is_refused() {
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
        assert_eq!(parts(1), Some(expected), "one of them twice");
        assert_eq!(parts(2), None, "each its own");
    }
}
