//! Which children an any-hit ray visits first: those with the best chance of a hit for their cost.
//!
//! A random line that meets a convex body of surface S meets a patch of area A inside it 2A / S times on average. So a box with
//! triangles of area A has x = A / (half its surface) expected hits, and a chance of a hit of about x / (1 + x). Any order gives
//! the same answer. Rays that end at their first hit visit fewer boxes in descending order of chance / cost (T. Ize, C. Hansen,
//! *RTSAH Traversal Order for Occlusion Rays*, 2011).

use kd_core::{Aabb, Mesh};
use kd_simd::LANES;
use smallvec::SmallVec;

use crate::node::WIDTH;

/// Cost of a block of triangles, where a node costs 1. Three times that of the collapse: a visit of a leaf prepares the triangle test
/// first. (Chosen; other values were not tried.)
const BLOCK: f64 = 1.5;

/// The chance of a hit in a subtree, and its cost.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Prospect {
    /// The area of the triangles, each reference counted.
    area: f64,
    /// The expected cost of a ray that meets the box.
    cost: f64,
}

impl Prospect {
    /// Of a leaf of triangles.
    pub(super) fn of_triangles(mesh: &Mesh, triangles: &[u32]) -> Self {
        let area = |triangle: &u32| {
            let [a, b, c] = mesh.corners(*triangle).map(|corner| corner.as_dvec3());
            0.5 * (b - a).cross(c - a).length()
        };
        Self::of_leaf(triangles.iter().map(area).sum(), triangles.len())
    }

    /// Of a leaf of boxes. A line that meets a box meets its surface twice, so half of it counts.
    pub(super) fn of_boxes(boxes: &[Aabb], items: &[u32]) -> Self {
        let area = |item: &u32| boxes[*item as usize].half_area();
        Self::of_leaf(items.iter().map(area).sum(), items.len())
    }

    fn of_leaf(area: f64, items: usize) -> Self {
        Self {
            area,
            cost: BLOCK * items.div_ceil(LANES) as f64,
        }
    }

    /// Of a node, from its children and their boxes.
    pub(super) fn of_node(bounds: &Aabb, children: &[(Aabb, Self)]) -> Self {
        let per_area = 1.0 / positive(bounds.half_area());
        let cost = |(bounds, child): &(Aabb, Self)| child.cost * bounds.half_area() * per_area;
        Self {
            area: children.iter().map(|(_, child)| child.area).sum(),
            cost: 1.0 + children.iter().map(cost).sum::<f64>(),
        }
    }

    /// The chance of a hit over the cost.
    fn value(&self, bounds: &Aabb) -> f64 {
        let expected = self.area / positive(bounds.half_area());
        expected / (1.0 + expected) / positive(self.cost)
    }
}

/// Boxes may have no area, and finished subtrees no known cost.
fn positive(x: f64) -> f64 {
    x.max(f64::MIN_POSITIVE)
}

/// The lane of each child: ascending by value, equal ones in their order. Numbers without a child keep their lane.
pub(super) fn lanes(children: &[(Aabb, Prospect)]) -> [u32; WIDTH] {
    let mut sorted: SmallVec<[(f64, usize); WIDTH]> = children
        .iter()
        .map(|(bounds, prospect)| prospect.value(bounds))
        .zip(0..)
        .collect();
    sorted.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut lanes = [0, 1, 2, 3, 4, 5, 6, 7];
    for (lane, (_, child)) in (0..).zip(sorted) {
        lanes[child] = lane;
    }
    lanes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boxed(side: f32, area: f64, cost: f64) -> (Aabb, Prospect) {
        let bounds = Aabb::around([[0.0; 3].into(), [side; 3].into()]);
        (bounds, Prospect { area, cost })
    }

    #[test]
    fn the_last_lane_has_the_best_chance_for_its_cost() {
        let children = [
            boxed(1.0, 3.0, 1.5),
            boxed(1.0, 1e-6, 1.5),
            boxed(1.0, 3.0, 9.0),
            boxed(0.0, 0.0, 1.5),
            boxed(0.1, 3.0, 1.5),
        ];
        assert_eq!(lanes(&children), [3, 1, 2, 0, 4, 5, 6, 7]);
    }

    #[test]
    fn unknown_subtrees_and_the_largest_boxes_keep_their_order() {
        let unknown = [boxed(1.0, 0.0, 0.0); 3];
        assert_eq!(
            lanes(&unknown),
            [0, 1, 2, 3, 4, 5, 6, 7],
            "no cost is known"
        );
        let huge = boxed(3e38, 1e77, 1.5);
        assert!(huge.1.value(&huge.0).is_finite(), "{huge:?}");
        assert_eq!(lanes(&[huge; 8]), [0, 1, 2, 3, 4, 5, 6, 7], "equal");
    }

    #[test]
    fn a_node_costs_what_its_children_cost_a_ray_that_meets_it() {
        let children = [boxed(1.0, 2.0, 3.0), boxed(1.0, 1.0, 1.0)];
        let node = Prospect::of_node(&children[0].0, &children);
        assert_eq!((node.area, node.cost), (3.0, 5.0), "1 + 3 + 1");
    }
}
