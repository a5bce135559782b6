//! Trees that move with their primitives.

use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use crate::{Aabb, Arena, Axis, Node, NodeIndex, NodeView, Pair, PrimSource, Tree, TreeError};

/// The primitives of another source by their boxes alone, not by their shapes.
///
/// A tree over it refers to a primitive in every cell that its box reaches into, which is more than a tree over the source
/// itself does; but it stays right when it is [moved](Tree::moved).
#[derive(Clone, Copy, Debug)]
pub struct Boxes<'a, S>(pub &'a S);

impl<S: PrimSource> PrimSource for Boxes<'_, S> {
    type Shape = Aabb;

    fn count(&self) -> u32 {
        self.0.count()
    }

    fn bounds(&self, primitive: u32) -> Aabb {
        self.0.bounds(primitive)
    }

    fn shape(&self, primitive: u32) -> Aabb {
        self.0.bounds(primitive)
    }

    fn clipped_bounds(&self, bounds: &Aabb, cell: &Aabb) -> Option<Aabb> {
        let part = bounds.intersection(cell);
        (!part.is_empty()).then_some(part)
    }
}

impl Tree {
    /// Whether a transform only translates, and scales or mirrors along the axes, so that planes stay planes across axes and
    /// a tree can be [moved](Self::moved) by it.
    pub fn can_be_moved(by: &Affine3A) -> bool {
        let scale = by.matrix3;
        Mat3A::from_diagonal(scale.diagonal().into()) == scale && by.is_finite()
    }

    /// The tree of the same primitives, all of them moved by a transform ([`Mesh::transformed`](crate::Mesh::transformed)):
    /// planes move with them, and children change places where an axis is mirrored.
    ///
    /// Rounding keeps the order of coordinates, so that a box that reaches into a cell still does so: a tree over [`Boxes`]
    /// is right wherever it is moved. One over shapes that were clipped need not be: the corner of a cell that a triangle
    /// just missed may, rounded, be in it, and rays that pass there may miss the triangle. (Of 800 such trees of
    /// four generated scenes, moved by up to 1000 times their size, [`check_coverage`](Self::check_coverage) found that in 600. 16
    /// million random rays met none.)
    ///
    /// Subtrees with several parents are copied for each. Linear in nodes and references: a sixtieth of a build by
    /// `BuildOptions::fast`, and SAH costs of trees over boxes are 1.00 to 1.08 of those over shapes. (Throw-away programs of
    /// 2026-11-28; balls of size 2 and gears of size 3, one thread, medians of 15.)
    ///
    /// (Eleftheriades 2010 moves polygons and builds their tree anew for every frame.)
    ///
    /// # Errors
    ///
    /// [`TreeError::NotAlongAxes`] if the transform turns or shears, [`TreeError::SplitNotFinite`] or
    /// [`TreeError::BadBounds`] if something is moved to where f32 ends.
    pub fn moved(&self, by: &Affine3A) -> Result<Self, TreeError> {
        if !Self::can_be_moved(by) {
            return Err(TreeError::NotAlongAxes);
        }
        let mut arena = Arena::new();
        let root = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
        let node = self.moved_node(self.root(), by, &mut arena)?;
        arena.set(root, node);
        arena.freeze(self.triangles())?;
        let bounds = moved_bounds(&self.bounds(), by);
        let tree = Self::from_arena(arena, root, bounds, *self.cost())?;
        Ok(tree.with_limited_cells(self.limited_cells()))
    }

    /// A node whose children have been written.
    fn moved_node(
        &self,
        place: NodeIndex,
        by: &Affine3A,
        arena: &mut Arena,
    ) -> Result<Node, TreeError> {
        let node = self.nodes()[place.index()];
        match node.view() {
            NodeView::Leaf { count, .. } => {
                let first = arena.push_refs(self.leaf_refs(node))?;
                Ok(Node::leaf(first, count).expect("as many as it had"))
            }
            NodeView::Interior { axis, split, first } => {
                let to = arena.push(Pair([Node::EMPTY_LEAF; 2]))?;
                let is_mirrored = by.matrix3.diagonal()[axis.index()] < 0.0;
                let from = [first, first.sibling()];
                let from = if is_mirrored {
                    [from[1], from[0]]
                } else {
                    from
                };
                for (from, to) in from.into_iter().zip([to, to.sibling()]) {
                    let node = self.moved_node(from, by, arena)?;
                    arena.set(to, node);
                }
                let split = moved_coordinate(by, axis, split);
                Ok(Node::interior(axis, split, to).expect("the arena has given the place"))
            }
        }
    }
}

/// Where a coordinate goes, by the very steps in which vertices are moved.
fn moved_coordinate(by: &Affine3A, axis: Axis, coordinate: f32) -> f32 {
    let mut point = Vec3A::ZERO;
    point[axis.index()] = coordinate;
    by.transform_point3a(point)[axis.index()]
}

fn moved_bounds(bounds: &Aabb, by: &Affine3A) -> Aabb {
    if bounds.is_empty() {
        return Aabb::EMPTY;
    }
    let corners = [bounds.min, bounds.max].map(|corner| by.transform_point3a(corner.into()));
    Aabb::around(corners.map(Vec3::from))
}
