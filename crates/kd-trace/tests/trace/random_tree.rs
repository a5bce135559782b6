//! A builder that chooses planes badly: trees no sensible builder would make, and all of them valid.

use glam::Vec3;
use kd_core::{Aabb, Axis, CostModel, Mesh, Node, NodeIndex, Pair, Slot, Tree, clipped_bounds};

use crate::rng::Rng;

/// A tree whose planes are random, in the middle, through corners of triangles, on faces of the cell or outside of
/// it, and sometimes the same twice.
pub(crate) fn random_tree(mesh: &Mesh, seed: u64) -> Tree {
    let mut builder = Builder {
        mesh,
        rng: Rng(seed),
        pairs: vec![Pair([Node::EMPTY_LEAF; 2])],
        refs: Vec::new(),
    };
    let all = (0..u32::try_from(mesh.len()).expect("small")).collect();
    builder.pairs[0].0[0] = builder.grow(mesh.bounds(), all, 0);
    let slots = u32::try_from(mesh.len()).expect("small");
    Tree::from_parts(
        builder.pairs,
        builder.refs,
        mesh.bounds(),
        slots,
        CostModel::CLASSIC,
    )
    .expect("valid")
}

struct Builder<'a> {
    mesh: &'a Mesh,
    rng: Rng,
    pairs: Vec<Pair>,
    refs: Vec<Slot>,
}

impl Builder<'_> {
    fn grow(&mut self, cell: Aabb, triangles: Vec<u32>, depth: u32) -> Node {
        let is_full = self.refs.len() > 30 * self.mesh.len();
        if triangles.len() <= 1 || depth >= 14 || is_full || self.rng.chance(0.02) {
            return self.leaf(&triangles);
        }
        let axis = self.rng.pick(&Axis::ALL);
        let split = self.plane(&cell, &triangles, axis);
        let within = split.clamp(cell.min[axis.index()], cell.max[axis.index()]);
        let (lower_cell, upper_cell) = cell.split(axis, within);
        let (mut lower, mut upper) = (Vec::new(), Vec::new());
        for &triangle in &triangles {
            let (below, above) = self.sides(triangle, axis, split, &cell);
            if below {
                lower.push(triangle);
            }
            if above {
                upper.push(triangle);
            }
        }
        let pair = self.pairs.len();
        self.pairs.push(Pair([Node::EMPTY_LEAF; 2]));
        let lower = self.grow(lower_cell, lower, depth + 1);
        let upper = self.grow(upper_cell, upper, depth + 1);
        self.pairs[pair] = Pair([lower, upper]);
        let place = NodeIndex(u32::try_from(2 * pair).expect("small"));
        Node::interior(axis, split, place).expect("small")
    }

    fn leaf(&mut self, triangles: &[u32]) -> Node {
        let first = u32::try_from(self.refs.len()).expect("small");
        self.refs.extend(triangles.iter().map(|&t| Slot(t)));
        let count = u32::try_from(triangles.len()).expect("small");
        Node::leaf(first, count).expect("small")
    }

    fn plane(&mut self, cell: &Aabb, triangles: &[u32], axis: Axis) -> f32 {
        let (min, max) = (cell.min[axis.index()], cell.max[axis.index()]);
        match self.rng.below(16) {
            0 => min,
            1 => max,
            2 => min.next_up().min(max),
            3 => (2.0 * max - min).clamp(f32::MIN, f32::MAX),
            4..=5 => self.rng.between(min, max).clamp(min, max),
            6..=8 => 0.5 * min + 0.5 * max,
            _ => {
                let triangle = self.rng.pick(triangles);
                let corner: Vec3 = self.rng.pick(&self.mesh.corners(triangle));
                corner[axis.index()].clamp(min, max)
            }
        }
    }

    /// The sides of a triangle: as few as are right, at random for a triangle in the plane.
    fn sides(&mut self, triangle: u32, axis: Axis, split: f32, cell: &Aabb) -> (bool, bool) {
        let Some(part) = clipped_bounds(self.mesh.corners(triangle), cell) else {
            // Rounding: an earlier plane let it in, but nothing of it is left here. Keep it.
            return (true, true);
        };
        let (start, end) = (part.min[axis.index()], part.max[axis.index()]);
        match (start < split, end > split) {
            (false, false) => {
                let below = self.rng.chance(0.5);
                (below, !below)
            }
            sides => sides,
        }
    }
}
