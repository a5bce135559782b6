//! The 32-byte node.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use kd_core::{Aabb, Axis};

/// A node of a [`Bvh`](crate::Bvh): a box with two children or with triangles.
///
/// ```text
///             words 0 to 2    word 3                    words 4 to 6    word 7
/// interior    min             index of second child     max             axis 0, 1, 2
/// leaf        min             first in triangle list    max             number of triangles << 2 | 3
/// ```
///
/// Nodes are stored in depth-first order, so that the first child of an interior node is the next node (M. Pharr, G. Humphreys,
/// *Physically Based Rendering*; Shi 2011, figure 2.5). The box is never empty.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BvhNode {
    min: Vec3,
    place: u32,
    max: Vec3,
    tag: u32,
}

const _: () = assert!(size_of::<BvhNode>() == 32, "two to a cache line");

/// The tag of a leaf, below its count.
const LEAF: u32 = 3;

/// The kind of a node, with its contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvhNodeView {
    /// Two children, whose boxes may overlap. The first is the next node.
    Interior {
        /// The axis with the largest distance between the centers of the children's boxes. The first child is the lower one.
        axis: Axis,
        /// The index of the second child.
        second: u32,
    },
    /// Triangles.
    Leaf {
        /// The index of the first one in [`Bvh::triangles`](crate::Bvh::triangles).
        first: u32,
        /// Number of triangles, at least one.
        count: u32,
    },
}

impl BvhNode {
    pub(crate) fn leaf(bounds: &Aabb, first: u32, count: u32) -> Self {
        Self {
            min: bounds.min,
            place: first,
            max: bounds.max,
            tag: count << 2 | LEAF,
        }
    }

    #[allow(clippy::cast_possible_truncation, reason = "below 3")]
    pub(crate) fn interior(bounds: &Aabb, axis: Axis, second: u32) -> Self {
        Self {
            min: bounds.min,
            place: second,
            max: bounds.max,
            tag: axis.index() as u32,
        }
    }

    /// The box around all triangles in the node.
    #[inline]
    pub fn bounds(&self) -> Aabb {
        Aabb {
            min: self.min,
            max: self.max,
        }
    }

    /// Whether it holds triangles.
    #[inline]
    pub fn is_leaf(&self) -> bool {
        self.tag & LEAF == LEAF
    }

    /// The kind of the node, with its contents.
    #[inline]
    pub fn view(&self) -> BvhNodeView {
        match self.tag & LEAF {
            LEAF => BvhNodeView::Leaf {
                first: self.place,
                count: self.tag >> 2,
            },
            axis => BvhNodeView::Interior {
                axis: Axis::ALL[axis as usize],
                second: self.place,
            },
        }
    }

    /// The same node in a subtree that is stored `nodes` nodes later. Indices of triangles stay.
    pub(crate) fn moved(self, nodes: u32) -> Self {
        if self.is_leaf() {
            self
        } else {
            Self {
                place: self.place + nodes,
                ..self
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_return_what_nodes_were_made_from() {
        let bounds = Aabb::around([Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)]);
        for axis in Axis::ALL {
            let node = BvhNode::interior(&bounds, axis, 7);
            let second = 7;
            assert_eq!(node.view(), BvhNodeView::Interior { axis, second });
            let second = 9;
            let moved = node.moved(2);
            assert_eq!(moved.view(), BvhNodeView::Interior { axis, second });
        }
        let most = (1 << 30) - 1;
        for (first, count) in [(0, 1), (5, 3), (most, most)] {
            let node = BvhNode::leaf(&bounds, first, count);
            assert_eq!(node.view(), BvhNodeView::Leaf { first, count });
            assert_eq!(node.moved(2), node, "triangles do not move");
            assert_eq!((node.bounds(), node.is_leaf()), (bounds, true), "the box");
        }
    }
}
