//! A binary tree of boxes: what wide nodes are collapsed from.

use glam::Vec3A;
use kd_core::{Aabb, Axis, Mesh};

use super::collapse::{self, Choice, Costs};

/// A binary tree of tight boxes over triangles. Children come after their parents; the root is the first.
#[derive(Debug, Default)]
pub(crate) struct BoxTree {
    nodes: Vec<BoxNode>,
    /// Those of each leaf together.
    triangles: Vec<u32>,
}

/// A node and how to make it into children of a wide node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoxNode {
    pub(crate) bounds: Aabb,
    pub(crate) choice: Choice,
    pub(crate) kind: Kind,
    /// The triangles of the subtree, which lie together.
    first: u32,
    count: u32,
}

/// What a node is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    /// All its triangles.
    Leaf,
    /// Two parts, the one that is lower on an axis first.
    Split { axis: Axis, parts: [u32; 2] },
}

/// A triangle, or a part of one, in its box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Item {
    pub(crate) min: Vec3A,
    pub(crate) max: Vec3A,
    pub(crate) triangle: u32,
}

/// A subtree that was just added.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Added {
    index: u32,
    costs: Costs,
}

impl Item {
    /// A whole triangle.
    pub(crate) fn whole(triangle: u32, mesh: &Mesh) -> Self {
        Self::within(Aabb::around(mesh.corners(triangle)), triangle)
    }

    pub(crate) fn within(bounds: Aabb, triangle: u32) -> Self {
        Self {
            min: bounds.min.into(),
            max: bounds.max.into(),
            triangle,
        }
    }

    /// The box of all of them.
    pub(crate) fn around(items: &[Self]) -> Aabb {
        let nothing = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (min, max) = items.iter().fold(nothing, |(min, max), item| {
            (min.min(item.min), max.max(item.max))
        });
        Aabb {
            min: min.into(),
            max: max.into(),
        }
    }

    pub(crate) fn bounds(&self) -> Aabb {
        Aabb {
            min: self.min.into(),
            max: self.max.into(),
        }
    }
}

impl BoxTree {
    pub(crate) fn root(&self) -> Option<u32> {
        (!self.nodes.is_empty()).then_some(0)
    }

    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(crate) fn node(&self, index: u32) -> &BoxNode {
        &self.nodes[index as usize]
    }

    /// The triangles of a subtree.
    pub(crate) fn triangles(&self, index: u32) -> &[u32] {
        let node = self.node(index);
        &self.triangles[node.first as usize..][..node.count as usize]
    }

    /// Adds a leaf. `per_area` is one over the half area of the root's box.
    pub(crate) fn add_leaf(&mut self, items: &[Item], per_area: f64) -> Added {
        let bounds = Item::around(items);
        let (choice, costs) = collapse::leaf(relative_area(&bounds, per_area), items.len());
        let first = to_u32(self.triangles.len());
        self.triangles
            .extend(items.iter().map(|item| item.triangle));
        self.nodes.push(BoxNode {
            bounds,
            choice,
            kind: Kind::Leaf,
            first,
            count: to_u32(items.len()),
        });
        Added {
            index: to_u32(self.nodes.len() - 1),
            costs,
        }
    }

    /// Leaves a place for a node whose parts are added next.
    pub(crate) fn reserve(&mut self) -> u32 {
        self.nodes.push(BoxNode {
            bounds: Aabb::EMPTY,
            choice: Choice::default(),
            kind: Kind::Leaf,
            first: to_u32(self.triangles.len()),
            count: 0,
        });
        to_u32(self.nodes.len() - 1)
    }

    /// Fills a reserved place: everything that has been added since is in the two parts.
    pub(crate) fn set_split(
        &mut self,
        place: u32,
        axis: Axis,
        parts: [Added; 2],
        per_area: f64,
    ) -> Added {
        let bounds = parts.map(|part| self.node(part.index).bounds);
        let bounds = bounds[0].union(&bounds[1]);
        let first = self.node(place).first;
        let count = to_u32(self.triangles.len()) - first;
        let area = relative_area(&bounds, per_area);
        let (choice, costs) = collapse::split(area, count as usize, &parts.map(|part| part.costs));
        self.nodes[place as usize] = BoxNode {
            bounds,
            choice,
            kind: Kind::Split {
                axis,
                parts: parts.map(|part| part.index),
            },
            first,
            count,
        };
        Added {
            index: place,
            costs,
        }
    }

    /// Adds all of another tree, whose root was added to it last as `root`.
    #[cfg(feature = "parallel")]
    pub(crate) fn append(&mut self, other: &Self, root: Added) -> Added {
        let (nodes, triangles) = (to_u32(self.nodes.len()), to_u32(self.triangles.len()));
        self.triangles.extend(&other.triangles);
        self.nodes.extend(other.nodes.iter().map(|node| BoxNode {
            kind: match node.kind {
                Kind::Leaf => Kind::Leaf,
                Kind::Split { axis, parts } => Kind::Split {
                    axis,
                    parts: parts.map(|part| part + nodes),
                },
            },
            first: node.first + triangles,
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

/// References are counted in 32 bits, and there are no more nodes or triangles than those.
fn to_u32(count: usize) -> u32 {
    u32::try_from(count).expect("32 bits count references")
}
