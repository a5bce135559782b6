//! The binary tree of boxes that collapses into wide nodes.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3A, Vec4};
use kd_buffer::advise_large_pages;
use kd_core::{Aabb, Axis, Mesh};

use crate::collapse::{self, Choice, Costs};

/// A binary tree of tight boxes over triangles, or over finished subtrees. Children follow their parents; the root is first.
#[derive(Debug)]
pub(crate) struct BoxTree {
    of: Leaves,
    nodes: Vec<BoxNode>,
    /// The items of all leaves, leaf by leaf.
    items: Vec<u32>,
}

/// The kind of leaves of a tree of boxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leaves {
    /// Triangles: small subtrees may become leaves.
    Triangles,
    /// One finished subtree each.
    Links,
}

/// A node, and how it becomes children of a wide node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxNode {
    pub(crate) bounds: Aabb,
    pub(crate) choice: Choice,
    pub(crate) kind: Kind,
    /// The range of the items of the subtree.
    first: u32,
    count: u32,
}

/// The kind of a node.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// All its items.
    Leaf,
    /// Two children, the lower one on the axis first.
    Split { axis: Axis, children: [u32; 2] },
}

/// A triangle, the part of one in a cell, or a subtree, in its box. What an [`ObjectSplit`](crate::ObjectSplit) divides.
///
/// 32 bytes: a division moves items, and its time is that of reading and writing memory.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Item {
    /// The lowest corner, and nothing.
    low: Vec4,
    /// The highest corner, and the bits of the number, with [`ORDINARY`](Self::ORDINARY) changed.
    high: Vec4,
}

/// A subtree that was just added.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Added {
    index: u32,
    costs: Costs,
}

impl Added {
    /// Its SAH cost as one child.
    pub(crate) fn cost(&self) -> f32 {
        self.costs[0]
    }
}

impl Item {
    /// A triangle of a mesh.
    ///
    /// # Panics
    ///
    /// If the mesh lacks it.
    pub fn whole(triangle: u32, mesh: &Mesh) -> Self {
        Self::within(Aabb::around(mesh.corners(triangle)), triangle)
    }

    /// An item in a box.
    #[inline(always)]
    pub fn within(bounds: Aabb, number: u32) -> Self {
        Self {
            low: bounds.min.extend(0.0),
            high: bounds.max.extend(f32::from_bits(number ^ Self::ORDINARY)),
        }
    }

    /// Makes a small number the bits of a float in [2, 4): arithmetic on all four lanes is slow where one is subnormal.
    const ORDINARY: u32 = 0x4000_0000;

    /// The lowest corner of the box, in scene units.
    #[inline(always)]
    pub fn min(&self) -> Vec3A {
        Vec3A::from_vec4(self.low)
    }

    /// The highest corner.
    #[inline(always)]
    pub fn max(&self) -> Vec3A {
        Vec3A::from_vec4(self.high)
    }

    /// A coordinate of the lowest corner. (In place: a vector in registers has no cheap index.)
    #[inline(always)]
    pub(crate) fn min_on(&self, axis: usize) -> f32 {
        self.low[axis]
    }

    /// A coordinate of the highest corner.
    #[inline(always)]
    pub(crate) fn max_on(&self, axis: usize) -> f32 {
        self.high[axis]
    }

    /// The triangle, or the number of the subtree.
    #[inline(always)]
    pub fn number(&self) -> u32 {
        self.high.w.to_bits() ^ Self::ORDINARY
    }

    /// Whether the box is empty.
    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.low.x > self.high.x
    }

    /// Changes the number and returns the one before.
    pub(crate) fn replace_number(&mut self, number: u32) -> u32 {
        let before = self.number();
        self.high.w = f32::from_bits(number ^ Self::ORDINARY);
        before
    }

    /// The box around items; empty without items.
    pub fn around(items: &[Self]) -> Aabb {
        let nothing = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (min, max) = items.iter().fold(nothing, |(min, max), item| {
            (min.min(item.min()), max.max(item.max()))
        });
        Aabb {
            min: min.into(),
            max: max.into(),
        }
    }

    /// The box.
    pub fn bounds(&self) -> Aabb {
        Aabb {
            min: self.min().into(),
            max: self.max().into(),
        }
    }
}

const _: () = assert!(size_of::<Item>() == 32, "two to a cache line");

impl BoxTree {
    pub(crate) fn new(of: Leaves) -> Self {
        Self::with_room_for(0, of)
    }

    /// An empty tree with memory for the boxes of this many items, as divisions usually make them.
    pub(crate) fn with_room_for(items: usize, of: Leaves) -> Self {
        let tree = Self {
            of,
            nodes: Vec::with_capacity(items / 2),
            items: Vec::with_capacity(items),
        };
        advise_large_pages(&tree.nodes);
        advise_large_pages(&tree.items);
        tree
    }

    pub(crate) fn root(&self) -> Option<u32> {
        (!self.nodes.is_empty()).then_some(0)
    }

    /// The number of nodes, which have the numbers below it.
    pub(crate) fn count(&self) -> u32 {
        to_u32(self.nodes.len())
    }

    /// The items of all leaves.
    pub(crate) fn all_items(&self) -> &[u32] {
        &self.items
    }

    pub(crate) fn node(&self, index: u32) -> &BoxNode {
        &self.nodes[index as usize]
    }

    /// The numbers of the items of a subtree.
    pub(crate) fn items(&self, index: u32) -> &[u32] {
        let node = self.node(index);
        &self.items[node.first as usize..][..node.count as usize]
    }

    /// Adds a leaf. `per_area` is one over the half area of the root's box.
    pub(crate) fn add_leaf(&mut self, items: &[Item], per_area: f64) -> Added {
        let numbers = items.iter().map(Item::number);
        self.add_leaf_of(Item::around(items), numbers, per_area)
    }

    /// Adds a leaf of these items, whose boxes are within `bounds`.
    pub(crate) fn add_leaf_of(
        &mut self,
        bounds: Aabb,
        items: impl ExactSizeIterator<Item = u32>,
        per_area: f64,
    ) -> Added {
        let count = items.len();
        let (choice, costs) = match self.of {
            Leaves::Triangles => collapse::leaf(relative_area(&bounds, per_area), count),
            Leaves::Links => collapse::link(),
        };
        let first = to_u32(self.items.len());
        self.items.extend(items);
        self.nodes.push(BoxNode {
            bounds,
            choice,
            kind: Kind::Leaf,
            first,
            count: to_u32(count),
        });
        Added {
            index: to_u32(self.nodes.len() - 1),
            costs,
        }
    }

    /// Reserves the place of a node whose children are added next.
    pub(crate) fn reserve(&mut self) -> u32 {
        self.nodes.push(BoxNode {
            bounds: Aabb::EMPTY,
            choice: Choice::default(),
            kind: Kind::Leaf,
            first: to_u32(self.items.len()),
            count: 0,
        });
        to_u32(self.nodes.len() - 1)
    }

    /// Fills a reserved place. The two children hold everything that was added since.
    pub(crate) fn set_split(
        &mut self,
        place: u32,
        axis: Axis,
        children: [Added; 2],
        per_area: f64,
    ) -> Added {
        let bounds = children.map(|child| self.node(child.index).bounds);
        let bounds = bounds[0].union(&bounds[1]);
        let first = self.node(place).first;
        let count = to_u32(self.items.len()) - first;
        let area = relative_area(&bounds, per_area);
        let most_in_leaf = match self.of {
            Leaves::Triangles => collapse::MOST_TRIANGLES,
            Leaves::Links => 1,
        };
        let costs = children.map(|child| child.costs);
        let (choice, costs) = collapse::split(area, count as usize, most_in_leaf, &costs);
        self.nodes[place as usize] = BoxNode {
            bounds,
            choice,
            kind: Kind::Split {
                axis,
                children: children.map(|child| child.index),
            },
            first,
            count,
        };
        Added {
            index: place,
            costs,
        }
    }

    /// Adds all of another tree, whose root was added to it last as `root`, and `number` to the numbers of its items.
    pub(crate) fn append(&mut self, other: &Self, root: Added, number: u32) -> Added {
        let (nodes, items) = (to_u32(self.nodes.len()), to_u32(self.items.len()));
        self.items
            .extend(other.items.iter().map(|item| item + number));
        self.nodes.extend(other.nodes.iter().map(|node| BoxNode {
            kind: match node.kind {
                Kind::Leaf => Kind::Leaf,
                Kind::Split { axis, children } => Kind::Split {
                    axis,
                    children: children.map(|child| child + nodes),
                },
            },
            first: node.first + items,
            ..*node
        }));
        Added {
            index: root.index + nodes,
            ..root
        }
    }
}

#[allow(clippy::cast_possible_truncation, reason = "a fraction of 1")]
fn relative_area(bounds: &Aabb, per_area: f64) -> f32 {
    (bounds.half_area() * per_area) as f32
}

/// References are counted in 32 bits, and nodes and items are no more than references.
pub(crate) fn to_u32(count: usize) -> u32 {
    u32::try_from(count).expect("32 bits count references")
}
