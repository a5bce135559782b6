//! A binary tree of boxes whose nodes know their parents, so that it can be changed: the leaves of a [`BoxTree`] in another tree.

use glam::Vec3A;
use kd_core::{Aabb, Axis};

use crate::bins::half_area;
use crate::box_tree::{Added, BoxTree, Kind, Leaves};
use crate::divide::{Costed, MAX_DIVIDED_LEVELS};

/// No node.
pub(crate) const NONE: u32 = u32::MAX;

/// A box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linked {
    pub(crate) min: Vec3A,
    pub(crate) max: Vec3A,
    /// [`NONE`] for the root.
    pub(crate) parent: u32,
    pub(crate) below: Below,
}

/// What is in a box.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Below {
    /// This leaf of the [`BoxTree`].
    Leaf(u32),
    Both([u32; 2]),
}

impl Linked {
    /// The box of a leaf.
    pub(crate) fn leaf(bounds: &Aabb, number: u32) -> Self {
        Self {
            min: bounds.min.into(),
            max: bounds.max.into(),
            parent: NONE,
            below: Below::Leaf(number),
        }
    }

    /// The box around two nodes.
    pub(crate) fn around(children: [u32; 2], [a, b]: [&Self; 2]) -> Self {
        Self {
            min: a.min.min(b.min),
            max: a.max.max(b.max),
            parent: NONE,
            below: Below::Both(children),
        }
    }

    pub(crate) fn area(&self) -> f32 {
        half_area(self.max - self.min)
    }

    /// The half area of the box around both.
    pub(crate) fn area_with(&self, other: &Self) -> f32 {
        half_area(self.max.max(other.max) - self.min.min(other.min))
    }
}

/// A tree of at least one box.
pub(crate) struct LinkedTree {
    pub(crate) nodes: Vec<Linked>,
    pub(crate) root: u32,
}

impl LinkedTree {
    /// The same tree; `None` without boxes.
    pub(crate) fn of(boxes: &BoxTree) -> Option<Self> {
        let root = boxes.root()?;
        let mut nodes: Vec<Linked> = (0..boxes.count())
            .map(|number| {
                let node = boxes.node(number);
                let leaf = Linked::leaf(&node.bounds, number);
                match node.kind {
                    Kind::Leaf => leaf,
                    Kind::Split { children, .. } => Linked {
                        below: Below::Both(children),
                        ..leaf
                    },
                }
            })
            .collect();
        for number in 0..boxes.count() {
            if let Below::Both(children) = nodes[number as usize].below {
                for child in children {
                    nodes[child as usize].parent = number;
                }
            }
        }
        Some(Self { nodes, root })
    }

    #[inline(always)]
    pub(crate) fn at(&self, number: u32) -> &Linked {
        &self.nodes[number as usize]
    }

    /// The other child of the parent, which the node has.
    #[inline(always)]
    pub(crate) fn sibling(&self, number: u32) -> u32 {
        match self.at(self.at(number).parent).below {
            Below::Both([a, b]) => a ^ b ^ number,
            Below::Leaf(_) => unreachable!("a parent has children"),
        }
    }

    /// Boxes in the order of a division, and their cost. The leaves are those of `boxes`. `None` if the tree is too deep for a ray.
    pub(crate) fn to_boxes(&self, boxes: &BoxTree, per_area: f64) -> Option<Costed> {
        let mut to = BoxTree::with_room_for(boxes.all_items().len(), Leaves::Triangles);
        let root = self.add(self.root, 0, boxes, per_area, &mut to)?;
        Some((to, root.cost()))
    }

    fn add(
        &self,
        number: u32,
        level: usize,
        boxes: &BoxTree,
        per_area: f64,
        to: &mut BoxTree,
    ) -> Option<Added> {
        let children = match self.at(number).below {
            Below::Both(children) => children,
            Below::Leaf(leaf) => {
                let items = boxes.items(leaf).iter().copied();
                return Some(to.add_leaf_of(boxes.node(leaf).bounds, items, per_area));
            }
        };
        if level >= MAX_DIVIDED_LEVELS {
            return None;
        }
        let place = to.reserve();
        let (axis, children) = self.apart(children);
        let [lower, upper] = children.map(|child| self.add(child, level + 1, boxes, per_area, to));
        Some(to.set_split(place, axis, [lower?, upper?], per_area))
    }

    /// The axis along which the centers of two boxes are furthest apart, and the lower box first.
    fn apart(&self, [a, b]: [u32; 2]) -> (Axis, [u32; 2]) {
        let [of_a, of_b] = [a, b].map(|child| 0.5 * self.at(child).min + 0.5 * self.at(child).max);
        let between = of_b - of_a;
        let along = between.abs().max_position();
        if between[along] < 0.0 {
            (Axis::ALL[along], [b, a])
        } else {
            (Axis::ALL[along], [a, b])
        }
    }
}
