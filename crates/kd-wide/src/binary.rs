//! Wide nodes from binary trees that were made elsewhere.

use kd_core::{Axis, MAX_DEPTH, Mesh};

use crate::box_tree::{Added, BoxTree, Item, Leaves};
use crate::divide::{MAX_LEVELS, per_area};

const _: () = assert!(MAX_DEPTH <= MAX_LEVELS, "a ray's stack is large enough");

/// A binary tree over the triangles of a mesh, each in at least one leaf: the input of
/// [`WideTree::from_binary`](crate::WideTree::from_binary). It needs no boxes.
///
/// ```
/// use kd_core::{Axis, Mesh, Ray};
/// use kd_trace::RayQuery;
/// use kd_wide::{BinaryNode, BinaryTree, WideTree};
///
/// /// One triangle on each side.
/// struct Two;
///
/// impl BinaryTree for Two {
///     fn root(&self) -> Option<u32> {
///         Some(0)
///     }
///
///     fn node(&self, index: u32) -> BinaryNode<'_> {
///         match index {
///             0 => BinaryNode::Split { axis: Axis::Z, children: [1, 2] },
///             1 => BinaryNode::Leaf(&[1]),
///             _ => BinaryNode::Leaf(&[0]),
///         }
///     }
/// }
///
/// let at = |z: f32| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]];
/// let mesh = Mesh::new([at(2.0), at(1.0)].concat(), vec![[0, 1, 2], [3, 4, 5]])?;
/// let wide = WideTree::from_binary(&Two, &mesh);
/// let hit = wide.intersect(&Ray::new([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]));
/// assert_eq!(hit.map(|hit| (hit.triangle, hit.t)), Some((1, 1.0)));
/// # Ok::<(), kd_core::MeshError>(())
/// ```
pub trait BinaryTree {
    /// The root; `None` without triangles.
    fn root(&self) -> Option<u32>;

    /// The node of the root's index or of a child's.
    fn node(&self, index: u32) -> BinaryNode<'_>;
}

/// A node of a [`BinaryTree`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinaryNode<'a> {
    /// The triangles of a leaf, at least one.
    Leaf(&'a [u32]),
    /// Two subtrees.
    Split {
        /// Rays with a positive direction on this axis visit the first child first.
        axis: Axis,
        /// The lower child on the axis, then the upper one.
        children: [u32; 2],
    },
}

/// The boxes of a binary tree.
pub(crate) fn boxes_of_binary(tree: &impl BinaryTree, mesh: &Mesh) -> BoxTree {
    let mut copy = Copy {
        tree,
        mesh,
        per_area: per_area(&mesh.bounds()),
        items: Vec::new(),
        boxes: BoxTree::new(Leaves::Triangles),
    };
    if let Some(root) = tree.root() {
        copy.add(root, 0);
    }
    copy.boxes
}

struct Copy<'a, T> {
    tree: &'a T,
    mesh: &'a Mesh,
    /// One over the half area of the root's box.
    per_area: f64,
    /// Scratch: the items of one leaf.
    items: Vec<Item>,
    boxes: BoxTree,
}

impl<T: BinaryTree> Copy<'_, T> {
    fn add(&mut self, index: u32, depth: usize) -> Added {
        match self.tree.node(index) {
            BinaryNode::Leaf(triangles) => {
                assert!(!triangles.is_empty(), "a leaf has triangles");
                self.items.clear();
                let items = triangles
                    .iter()
                    .map(|&triangle| Item::whole(triangle, self.mesh));
                self.items.extend(items);
                self.boxes.add_leaf(&self.items, self.per_area)
            }
            BinaryNode::Split { axis, children } => {
                assert!(
                    depth < MAX_DEPTH,
                    "a leaf is at most {MAX_DEPTH} levels below the root"
                );
                let place = self.boxes.reserve();
                let parts = children.map(|child| self.add(child, depth + 1));
                self.boxes.set_split(place, axis, parts, self.per_area)
            }
        }
    }
}
