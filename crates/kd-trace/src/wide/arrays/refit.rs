//! A part whose triangles have moved: the same nodes with new boxes, and what they are worth.

use kd_core::{Aabb, Mesh};

use super::Arrays;
use crate::wide::collapse;
use crate::wide::node::{Child, WIDTH};

/// What it costs rays to go through a part, by the surface area heuristic.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PartCost {
    /// Half areas of the boxes of all nodes and leaves below the root, each times what a ray takes that enters it, in visits
    /// of a node. Over the half area of a scene, it is what a random ray through that takes on average.
    pub cost: f64,
    /// The area of all triangles. (Twice those that are in two leaves.) What only moves, turns or is scaled keeps its cost
    /// for each unit of this, as far as boxes remain as tight.
    pub surface: f64,
}

impl PartCost {
    /// The cost for each unit of surface; 0 without any.
    pub fn per_surface(&self) -> f64 {
        if self.surface > 0.0 {
            self.cost / self.surface
        } else {
            0.0
        }
    }
}

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

    /// The SAH cost of a part.
    pub(crate) fn cost_of_part(&self, number: usize) -> PartCost {
        let part = &self.parts[number];
        let mut cost = 0.0;
        for node in &self.nodes[part.nodes()] {
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
        let blocks = self.blocks[part.blocks()].iter();
        PartCost {
            cost,
            surface: blocks.map(|block| f64::from(block.area())).sum(),
        }
    }
}
