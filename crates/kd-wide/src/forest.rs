//! A forest: several wide trees in the same arrays, and the nodes that join them.

mod history;
mod join;
mod members;
mod refit;
mod room;
mod top;

use kd_core::{Aabb, Mesh};
use kd_simd::Level;

pub use join::{Join, Joined};
pub use refit::Refit;

use crate::arrays::{Arrays, State};
use crate::box_tree::to_u32;
use crate::frame::Frame;
use crate::node::Child;
use crate::tree::WideTree;
use history::History;
use members::{Member, Members};
use top::{Edits, Linked, Top};

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
    members: Members,
    /// Over the members as they were before `edits`. Kept only where it will be repaired.
    top: Option<Top>,
    edits: Edits,
    history: History,
}

impl WideForest {
    /// No members.
    pub fn new() -> Self {
        Self {
            tree: WideTree {
                arrays: Arrays::of_forest(),
                frame: Frame::new(&Aabb::EMPTY),
                level: Level::detect(),
            },
            members: Members::new(),
            top: None,
            edits: Edits::new(),
            history: History::new(),
        }
    }

    /// The number of members.
    pub fn len(&self) -> usize {
        self.members.count()
    }

    /// Whether the forest has no members.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds a copy of `tree` as a member, with `first_slot` added to the numbers of its triangles, modulo 2³². Returns the number of
    /// the member: that of the member that was removed last and whose number is free, or the next one.
    ///
    /// Linear in the size of the member.
    ///
    /// # Panics
    ///
    /// If `tree` is that of a forest.
    pub fn push(&mut self, tree: &WideTree, first_slot: u32) -> usize {
        let member = Member::all_of(&tree.arrays);
        let at = self.edit();
        let number =
            self.members
                .push(&mut self.tree.arrays, &tree.arrays, &member, first_slot, at);
        self.note_new(number)
    }

    /// Reserves memory for members of these sizes, so that the arrays grow once.
    pub fn reserve(&mut self, members: impl Iterator<Item = MemberSize>) {
        let all = members.fold(MemberSize::default(), |all, one| MemberSize {
            nodes: all.nodes + one.nodes,
            blocks: all.blocks + one.blocks,
        });
        let arrays = &mut self.tree.arrays;
        arrays.nodes.reserve(all.nodes);
        arrays.blocks.reserve(all.blocks);
    }

    /// The size of a member.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn size(&self, number: usize) -> MemberSize {
        let member = &self.members.all()[number];
        MemberSize {
            nodes: member.nodes().len(),
            blocks: member.blocks().len(),
        }
    }

    /// Adds a copy of a member of another forest, as [`push`](Self::push) does.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn push_copy(&mut self, from: &Self, number: usize) -> usize {
        let member = from.members.all()[number];
        let at = self.edit();
        let arrays = &mut self.tree.arrays;
        let number = self.members.push(arrays, &from.tree.arrays, &member, 0, at);
        self.note_new(number)
    }

    /// Adds a copy of a member of this forest, as [`push`](Self::push) does.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn push_again(&mut self, number: usize) -> usize {
        let at = self.edit();
        let arrays = &mut self.tree.arrays;
        let number = self.members.push_again(arrays, number, at);
        self.note_new(number)
    }

    /// Removes a member. The others keep their numbers.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn remove(&mut self, number: usize) {
        let at = self.edit();
        self.note(number);
        self.members.remove(number, at);
        // The nodes of a top that is kept refer to the member until they are repaired.
        if self.top.is_none() {
            self.members.trim(&mut self.tree.arrays);
        }
    }

    /// Adds to the slots of all triangles of a member, modulo 2³². Linear in the size of the member.
    ///
    /// # Panics
    ///
    /// If there is no such member.
    pub fn add_to_slots(&mut self, number: usize, slots: u32) {
        let at = self.edit();
        self.members
            .add_to_slots(&mut self.tree.arrays, number, slots, at);
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

    /// [`refit`](Self::refit) for several members. Parallel: on the threads of the pool in scope (rayon's), a task for each member, with
    /// the same result.
    ///
    /// # Panics
    ///
    /// If there is no such member, if a mesh has fewer triangles, or if a member is refitted twice.
    pub fn refit_all(&mut self, refits: &[Refit<'_>], is_parallel: bool) {
        let at = self.edit();
        for refit in refits {
            self.note(refit.number);
        }
        let arrays = &mut self.tree.arrays;
        refit::refit(arrays, self.members.all(), refits, is_parallel, at);
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
        refit::cost(&self.tree.arrays, &self.members.all()[number])
    }

    /// Joins the members, so that rays hit all of them. After any change of members, rays hit nothing until the next join.
    ///
    /// With a thousand members or more, a join after few changes repairs the nodes of the last join: its time is linear in the changed
    /// members, and usually logarithmic in all members. All members are joined again when the changes since then outnumber the members, or
    /// when the SAH cost of these nodes has grown by 5 %. The time of such a join is linear in the members that do not overlap.
    pub fn join(&mut self, options: Join) -> Joined {
        let at = self.edit();
        let top = match self.repaired(options, at) {
            Some(top) => top,
            None => {
                self.drop_top();
                let arrays = &mut self.tree.arrays;
                let is_kept = Top::is_kept(&self.members);
                if self.members.have_room() && (!is_kept || self.members.are_scattered(arrays)) {
                    self.members.move_together(arrays, at);
                }
                Top::new(arrays, &self.members, options, at)
            }
        };
        self.edits.clear();
        self.history.complete();
        let arrays = &mut self.tree.arrays;
        arrays.set_root(top.root());
        let bounds = match top.root() {
            Child::NOTHING => Aabb::EMPTY,
            root => arrays.nodes()[root.index()].around(),
        };
        self.tree.frame = Frame::new(&bounds);
        let joined = top.joined();
        self.top = Some(top);
        joined
    }

    /// Makes this forest equal to `with`. Copies only what has changed, if this is a copy of `with` as it was after one of its last 64
    /// joins.
    pub fn catch_up(&mut self, with: &Self) {
        let Some(since) = self.history.is_part_of(&with.history) else {
            self.clone_from(with);
            return;
        };
        self.tree.arrays.catch_up(&with.tree.arrays, since);
        self.tree.frame = with.tree.frame;
        self.tree.level = with.tree.level;
        self.members.catch_up(&with.members, since);
        self.top.clone_from(&with.top);
        self.edits.clone_from(&with.edits);
        self.history.clone_from(&with.history);
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
            ..self
        }
    }

    /// Begins a change.
    fn edit(&mut self) -> State {
        self.tree.arrays.clear_root();
        if !Top::is_kept(&self.members) {
            self.drop_top();
        }
        self.history.edit()
    }

    /// Notes that a member is about to change, for the next repair.
    fn note(&mut self, number: usize) {
        if self.top.is_none() {
            return;
        }
        let member = self.members.all()[number];
        let linked = (member.root() != Child::NOTHING).then(|| Linked {
            member,
            bounds: self.tree.arrays.nodes()[member.root().index()].around(),
        });
        let linked = linked.filter(|linked| !linked.bounds.is_empty());
        self.edits.entry(to_u32(number)).or_insert(linked);
        self.drop_top_of_many_edits();
    }

    /// Notes a new member.
    fn note_new(&mut self, number: usize) -> usize {
        if self.top.is_some() {
            self.edits.entry(to_u32(number)).or_insert(None);
            self.drop_top_of_many_edits();
        }
        number
    }

    fn drop_top_of_many_edits(&mut self) {
        if !Top::can_repair(&self.edits, &self.members) {
            self.drop_top();
        }
    }

    fn drop_top(&mut self) {
        self.edits.clear();
        if let Some(top) = self.top.take() {
            self.members.give_nodes(top.nodes());
        }
        self.members.trim(&mut self.tree.arrays);
    }

    /// The top after a repair; `None` where all members must be joined.
    fn repaired(&mut self, options: Join, at: State) -> Option<Top> {
        let arrays = &mut self.tree.arrays;
        if self.members.are_scattered(arrays) {
            return None;
        }
        let mut top = self.top.take()?;
        if top.repair(arrays, &self.members, &self.edits, options, at) {
            return Some(top);
        }
        self.top = Some(top);
        None
    }
}

/// How much of the arrays of a forest a member takes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemberSize {
    nodes: usize,
    blocks: usize,
}

impl MemberSize {
    /// That of a member that is a copy of a tree.
    pub fn of(tree: &WideTree) -> Self {
        Self {
            nodes: tree.nodes().len(),
            blocks: tree.blocks().len(),
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
        assert!(alone.tree == together.tree, "byte by byte");
    }

    #[test]
    #[should_panic(expected = "each member is refitted once")]
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
