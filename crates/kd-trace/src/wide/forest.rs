//! Several wide trees in the same arrays, and the nodes that join them.

use kd_core::Mesh;

use super::arrays::Arrays;
use super::join::{Join, Joined, join};
use super::{Frame, WideTree};
use crate::Level;

/// Parts, one after the other, that are traced as one [`WideTree`].
///
/// A part lies in the same memory as the others and is never looked at again until it changes. What joins them is made anew
/// by [`join`](Self::join), which only looks at the uppermost nodes of parts, and further down where parts overlap.
///
/// Triangles have the numbers of their parts plus what is told when a part is put in, so that hits tell which part they are
/// of. Equal `t` goes to the lower of these numbers, whatever the order of parts here.
///
/// ```
/// use kd_core::{Mesh, Ray};
/// use kd_trace::{Join, WideForest, WideTree};
///
/// let at = |z: f32| Mesh::new(vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]], vec![[0, 1, 2]]);
/// let mut forest = WideForest::new();
/// forest.push(&WideTree::from_objects(&at(1.0)?), 0);
/// forest.push(&WideTree::from_objects(&at(2.0)?), 100);
/// forest.join(Join::default());
///
/// let ray = Ray::new([0.25, 0.25, 3.0], [0.0, 0.0, -1.0]);
/// let hit = forest.tree().intersect(&ray).expect("both are in the way");
/// assert_eq!((hit.triangle, hit.t), (100, 1.0));
///
/// forest.refit(1, &at(0.5)?, 100);
/// forest.join(Join::default());
/// let hit = forest.tree().intersect(&ray).expect("still");
/// assert_eq!((hit.triangle, hit.t), (0, 2.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct WideForest {
    tree: WideTree,
}

impl WideForest {
    /// No parts.
    pub fn new() -> Self {
        Self {
            tree: WideTree {
                arrays: Arrays::empty(),
                frame: Frame::new(&kd_core::Aabb::EMPTY),
                level: Level::detect(),
            },
        }
    }

    /// How many parts there are.
    pub fn len(&self) -> usize {
        self.tree.arrays.parts().len()
    }

    /// Whether there are no parts.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a copy of `tree` after the other parts, with `first_slot` added to the numbers of its triangles.
    ///
    /// Linear in the size of the part.
    ///
    /// # Panics
    ///
    /// If `tree` is that of a forest. Where a number of a triangle does not fit 32 bits, it is wrapped.
    pub fn push(&mut self, tree: &WideTree, first_slot: u32) {
        let part = tree.arrays.as_part();
        self.tree.arrays.push_part(&tree.arrays, &part, first_slot);
    }

    /// Adds a copy of a part of another forest after the other parts. Linear in the size of the part.
    ///
    /// # Panics
    ///
    /// If there is no such part.
    pub fn push_copy(&mut self, from: &Self, number: usize) {
        let from = &from.tree.arrays;
        self.tree.arrays.push_part(from, &from.parts()[number], 0);
    }

    /// Adds a copy of one of the parts after the others. Linear in the size of the part.
    ///
    /// # Panics
    ///
    /// If there is no such part.
    pub fn push_again(&mut self, number: usize) {
        self.tree.arrays.push_again(number);
    }

    /// Takes out the parts from a number on.
    pub fn truncate(&mut self, parts: usize) {
        self.tree.arrays.truncate_parts(parts);
    }

    /// Adds to the numbers of all triangles of a part, modulo 2³². Linear in the size of the part.
    ///
    /// # Panics
    ///
    /// If there is no such part.
    pub fn add_to_slots(&mut self, number: usize, slots: u32) {
        self.tree.arrays.add_to_slots(number, slots);
    }

    /// Moves the triangles of a part to where they are in `mesh`, which has as many as it was made from: it keeps its
    /// nodes, with boxes around what is now in them. `first_slot` is that of [`push`](Self::push).
    ///
    /// Linear in the size of the part. Where triangles that were neighbours part, rays become slow: [`cost`](Self::cost)
    /// tells.
    ///
    /// # Panics
    ///
    /// If there is no such part; if the mesh has fewer triangles.
    pub fn refit(&mut self, number: usize, mesh: &Mesh, first_slot: u32) {
        self.tree.arrays.refit_part(number, mesh, first_slot);
    }

    /// What a part costs by the surface area heuristic: half areas of the boxes of all nodes and leaves below its root, each
    /// times what a ray takes that enters it, in visits of a node. Over the half area of a scene, it is what a random ray
    /// through that takes in this part, on average.
    ///
    /// Linear in the size of the part.
    ///
    /// # Panics
    ///
    /// If there is no such part.
    pub fn cost(&self, number: usize) -> f64 {
        self.tree.arrays.cost_of_part(number)
    }

    /// Joins the parts, after which all of them can be traced. Until then, since the last change, nothing is hit.
    ///
    /// Where parts lie apart, this takes time by their number alone.
    pub fn join(&mut self, options: Join) -> Joined {
        let (joined, bounds) = join(&mut self.tree.arrays, options);
        self.tree.frame = Frame::new(&bounds);
        joined
    }

    /// What rays are traced through: the parts, as they were joined.
    pub fn tree(&self) -> &WideTree {
        &self.tree
    }

    /// The same forest, traced at another level.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        Self {
            tree: self.tree.with_level(level),
        }
    }
}

impl Default for WideForest {
    fn default() -> Self {
        Self::new()
    }
}
