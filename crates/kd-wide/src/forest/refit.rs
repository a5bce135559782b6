//! Refitting: the same nodes with new boxes, after triangles have moved, and their SAH cost.

use kd_core::{Aabb, Mesh};

use super::members::Member;
use crate::arrays::{Arrays, State};
use crate::block::Block;
use crate::collapse;
use crate::node::{Child, WIDTH, WideNode};

/// The new positions of the triangles of a member of a [`WideForest`](crate::WideForest).
#[derive(Clone, Copy, Debug)]
pub struct Refit<'a> {
    /// The number of the member.
    pub number: usize,
    /// The triangles at their new positions; as many as the member was made from.
    pub mesh: &'a Mesh,
    /// The `first_slot` of [`WideForest::push`](crate::WideForest::push).
    pub first_slot: u32,
}

/// A member to refit, and its memory.
struct Task<'a> {
    refit: Refit<'a>,
    nodes: &'a mut [WideNode],
    blocks: &'a mut [Block],
    /// The indices of the first of each.
    first_node: usize,
    first_block: usize,
}

/// Moves the triangles of members to their positions in the meshes, and fits the boxes. Linear in the blocks of these members.
///
/// # Panics
///
/// If a mesh has fewer triangles; if a member is refitted twice.
pub(crate) fn refit(
    arrays: &mut Arrays,
    members: &[Member],
    refits: &[Refit<'_>],
    is_parallel: bool,
    at: State,
) {
    let of = |refit: &Refit<'_>| members[refit.number];
    let nodes: Vec<_> = refits.iter().map(|refit| of(refit).nodes()).collect();
    let blocks: Vec<_> = refits.iter().map(|refit| of(refit).blocks()).collect();
    let nodes = arrays.nodes.write_each(&nodes, at);
    let blocks = arrays.blocks.write_each(&blocks, at);
    let memory = nodes.into_iter().zip(blocks);
    let tasks = refits
        .iter()
        .zip(memory)
        .map(|(refit, (nodes, blocks))| Task {
            refit: *refit,
            first_node: of(refit).nodes().start,
            first_block: of(refit).blocks().start,
            nodes,
            blocks,
        });
    kd_tasks::map(tasks.collect(), is_parallel, Task::run);
}

/// The SAH cost of a member below its root: the half area of each box times the cost of a ray that enters it (see [`collapse`]).
pub(crate) fn cost(arrays: &Arrays, member: &Member) -> f64 {
    let mut cost = 0.0;
    for node in &arrays.nodes()[member.nodes()] {
        for lane in node.lanes() {
            let child = node.children[lane];
            let blocks = if child.is_leaf() {
                child.blocks().len()
            } else {
                0
            };
            cost += node.bounds(lane).half_area() * f64::from(collapse::visit(blocks));
        }
    }
    cost
}

impl Task<'_> {
    fn run(self) {
        for block in &mut *self.blocks {
            block.move_corners(self.refit.mesh, self.refit.first_slot);
        }
        let mut bounds = vec![Aabb::EMPTY; self.nodes.len()];
        // Children follow their parents, so their boxes are known first.
        for (place, node) in self.nodes.iter_mut().enumerate().rev() {
            let mut around = Aabb::EMPTY;
            for lane in 0..WIDTH {
                let child = node.children[lane];
                if child == Child::NOTHING {
                    continue;
                }
                let of_child = if child.is_leaf() {
                    let range = child.blocks();
                    let blocks =
                        &self.blocks[range.start - self.first_block..range.end - self.first_block];
                    let boxes = blocks.iter().map(Block::bounds);
                    boxes.fold(Aabb::EMPTY, |around, bounds| around.union(&bounds))
                } else {
                    bounds[child.index() - self.first_node]
                };
                node.set(lane, &of_child, child);
                around = around.union(&of_child);
            }
            node.order_by_centers();
            bounds[place] = around;
        }
    }
}
