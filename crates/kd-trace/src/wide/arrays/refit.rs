//! A part whose triangles have moved: the same nodes with new boxes, and what they are worth.

use kd_core::{Aabb, Mesh};

use super::Arrays;
use crate::wide::collapse;
use crate::wide::node::{Child, WIDTH};

impl Arrays {
    /// Gives the triangles of a part, numbered from `first_slot` on, the corners they have in `mesh`, and makes its boxes
    /// fit. The top is dropped.
    ///
    /// Linear in the blocks of the part.
    ///
    /// # Panics
    ///
    /// If the mesh has fewer triangles.
    pub(crate) fn refit_part(&mut self, number: usize, mesh: &Mesh, first_slot: u32) {
        self.clear_top();
        let part = &self.parts[number];
        for block in &mut self.blocks[part.blocks()] {
            block.move_corners(mesh, first_slot);
        }
        let first = part.nodes().start;
        let mut bounds = vec![Aabb::EMPTY; part.nodes().len()];
        // Children come after their parents, so that their boxes are known before.
        for (place, node) in self.nodes[part.nodes()].iter_mut().enumerate().rev() {
            let mut around = Aabb::EMPTY;
            for lane in 0..WIDTH {
                let child = node.children[lane];
                if child == Child::NOTHING {
                    continue;
                }
                let of_child = if child.is_leaf() {
                    let blocks = self.blocks[child.blocks()].iter();
                    blocks.fold(Aabb::EMPTY, |around, block| around.union(&block.bounds()))
                } else {
                    bounds[child.index() - first]
                };
                node.set(lane, &of_child, child);
                around = around.union(&of_child);
            }
            node.order_by_centers();
            bounds[place] = around;
        }
    }

    /// The SAH cost of a part below its root: half areas of boxes, each times what a ray takes that enters it (see
    /// [`collapse`]).
    pub(crate) fn cost_of_part(&self, number: usize) -> f64 {
        let mut cost = 0.0;
        for node in &self.nodes[self.parts[number].nodes()] {
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
}
