//! A forest: several wide trees in the same arrays, and the nodes that join them.

use kd_core::Mesh;
use kd_simd::Level;

use crate::arrays::{Arrays, Refit};
use crate::frame::Frame;
use crate::join::{Join, Joined, join};
use crate::tree::WideTree;

/// Several trees that are traced as one [`WideTree`]: its *members*, numbered from 0.
///
/// Members share one array of nodes and one of blocks. Unchanged members are not read when others change: [`join`](Self::join)
/// makes new nodes over all members, and reads only their uppermost nodes, and nodes further down where members overlap.
///
/// The slot of a triangle is its number in its tree plus the `first_slot` of its member, modulo 2³², so a hit identifies the member
/// if the slots of members are distinct. Every 32-bit number is a valid slot. Among equal `t` the lower slot is reported, in any
/// order of members.
///
/// ```
/// use kd_core::{Mesh, Ray};
/// use kd_trace::RayQuery;
/// use kd_wide::{Join, WideForest, WideTree};
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
/// let hit = forest.tree().intersect(&ray).expect("the other one");
/// assert_eq!((hit.triangle, hit.t), (0, 2.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct WideForest {
    tree: WideTree,
}

impl WideForest {
    /// No members.
    pub fn new() -> Self {
        Self {
            tree: WideTree {
                arrays: Arrays::empty(),
                frame: Frame::new(&kd_core::Aabb::EMPTY),
                level: Level::detect(),
            },
        }
    }

    /// The number of members.
    pub fn len(&self) -> usize {
        self.tree.arrays.members().len()
    }

    /// Whether the forest has no members.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a copy of `tree` as the last member, with `first_slot` added to the numbers of its triangles, modulo 2³².
    ///
    /// Linear in the size of the member.
    ///
    /// # Panics
    ///
    /// If `tree` is that of a forest.
    pub fn push(&mut self, tree: &WideTree, first_slot: u32) {
        let member = tree.arrays.as_member();
        self.tree
            .arrays
            .push_member(&tree.arrays, &member, first_slot);
    }

    /// Adds a copy of a member of another forest as the last member. Linear in the size of the member.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn push_copy(&mut self, from: &Self, number: usize) {
        let from = &from.tree.arrays;
        self.tree
            .arrays
            .push_member(from, &from.members()[number], 0);
    }

    /// Adds a copy of a member of this forest as the last member. Linear in the size of the member.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn push_again(&mut self, number: usize) {
        self.tree.arrays.push_again(number);
    }

    /// Removes the members from a number on.
    pub fn truncate(&mut self, members: usize) {
        self.tree.arrays.truncate_members(members);
    }

    /// Adds to the slots of all triangles of a member, modulo 2³². Linear in the size of the member.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn add_to_slots(&mut self, number: usize, slots: u32) {
        self.tree.arrays.add_to_slots(number, slots);
    }

    /// Moves the triangles of a member to their positions in `mesh`, which has as many as the member was made from. The nodes
    /// stay, with boxes around the moved triangles. `first_slot` is that of [`push`](Self::push).
    ///
    /// Linear in the size of the member. Rays become slow where neighboring triangles move apart: [`cost`](Self::cost)
    /// measures it.
    ///
    /// # Panics
    ///
    /// If there is no such member; if the mesh has fewer triangles.
    pub fn refit(&mut self, number: usize, mesh: &Mesh, first_slot: u32) {
        let refit = Refit {
            number,
            mesh,
            first_slot,
        };
        self.refit_all(&[refit], false);
    }

    /// [`refit`](Self::refit) for several members, in ascending order of their numbers. Parallel: on the threads of the pool in
    /// scope (rayon's), a task for each member, with the same result.
    ///
    /// # Panics
    ///
    /// If there is no such member, if a mesh has fewer triangles, or if the numbers do not ascend.
    pub fn refit_all(&mut self, refits: &[Refit<'_>], is_parallel: bool) {
        self.tree.arrays.refit_members(refits, is_parallel);
    }

    /// The SAH cost of a member: the half areas of the boxes of all nodes and leaves below its root, in squared scene units, each
    /// times the cost of a ray that enters it, in visits of a node. Divided by the half area of a scene, it is the average cost
    /// of a random ray through the scene in this member.
    ///
    /// Linear in the size of the member.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn cost(&self, number: usize) -> f64 {
        self.tree.arrays.cost_of_member(number)
    }

    /// Joins the members, so that rays hit all of them. After any change of members, rays hit nothing until the next join.
    ///
    /// Members that do not overlap cost time by their number alone.
    pub fn join(&mut self, options: Join) -> Joined {
        let (joined, bounds) = join(&mut self.tree.arrays, options);
        self.tree.frame = Frame::new(&bounds);
        joined
    }

    /// The joined members, for rays.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of members that overlap with their neighbors, and their later positions.
    fn forest_of_many(count: u32) -> (WideForest, Vec<Mesh>) {
        let member = |number: u32, shift: f32| {
            let x = number as f32 * 0.3 + shift;
            let positions = (0..300).map(|i| {
                let i = i as f32;
                [x + 0.1 * i, (7.3 * i + x).sin(), (3.1 * i).cos() * shift]
            });
            let triangles = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            Mesh::new(positions.collect(), triangles).expect("valid")
        };
        let mut forest = WideForest::new();
        for number in 0..count {
            let tree = WideTree::from_objects(&member(number, 1.0));
            forest.push(&tree, 100 * number);
        }
        (
            forest,
            (0..count).map(|number| member(number, 1.5)).collect(),
        )
    }

    #[test]
    fn threads_change_nothing() {
        let (forest, moved) = forest_of_many(1000);
        let made = |is_parallel| {
            let mut forest = forest.clone();
            let moved = moved.iter().enumerate().step_by(2);
            let refits = moved.map(|(number, mesh)| Refit {
                number,
                mesh,
                first_slot: 100 * u32::try_from(number).expect("few"),
            });
            forest.refit_all(&refits.collect::<Vec<_>>(), is_parallel);
            let joined = forest.join(Join {
                open_above: 0.01,
                is_parallel,
            });
            (joined, forest)
        };
        let ((joined, alone), (same, together)) = (made(false), made(true));
        assert!(joined.opened > 0 && joined.links > 1000, "{joined:?}");
        assert_eq!(joined, same, "the same work");
        let [alone, together] = [alone, together].map(|forest| format!("{:?}", forest.tree.arrays));
        assert!(alone == together, "byte by byte");
    }

    #[test]
    #[should_panic(expected = "the numbers of members ascend")]
    fn a_part_is_refitted_once() {
        let (mut forest, moved) = forest_of_many(2);
        let refit = Refit {
            number: 1,
            mesh: &moved[1],
            first_slot: 100,
        };
        forest.refit_all(&[refit, refit], false);
    }
}
