//! Candidate planes and their cost.

use kd_core::{Aabb, Axis, CostModel};

/// A plane to divide a cell by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) axis: Axis,
    pub(crate) position: f32,
    /// The side that receives primitives in the plane. They never go to both sides.
    pub(crate) planar_side: Side,
    /// The expected cost of the divided cell, for a ray that enters it.
    pub(crate) cost: f32,
}

/// One of the two sides of a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Side {
    Lower,
    Upper,
}

impl Side {
    pub(crate) fn other(self) -> Self {
        match self {
            Self::Lower => Self::Upper,
            Self::Upper => Self::Lower,
        }
    }
}

impl Plane {
    /// Whether this plane is preferred: by lower cost, then by axis, then by position, then by planar primitives below.
    ///
    /// The order is total, so the best plane does not depend on the order of candidates.
    pub(crate) fn is_better(&self, other: &Self) -> bool {
        let rank = |plane: &Self| (plane.axis, plane.position, plane.planar_side);
        self.cost < other.cost || (self.cost == other.cost && rank(self) < rank(other))
    }
}

/// Numbers of primitives by their position with respect to a plane. A primitive that straddles the plane counts as both
/// lower and upper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Primitives that reach below the plane.
    pub(crate) lower: usize,
    /// Primitives in the plane.
    pub(crate) planar: usize,
    /// Primitives that reach above the plane.
    pub(crate) upper: usize,
}

/// A number of primitives of a cell, or an estimate of it, in the type that the cost model takes.
#[inline]
#[allow(
    clippy::cast_possible_truncation,
    reason = "a cell holds each primitive once, and slots have 30 bits"
)]
pub(crate) fn as_count(primitives: usize) -> u32 {
    primitives as u32
}

/// The cost model with precomputed values, for use with every candidate.
///
/// Costs of planes are f32, so that eight fit into a vector. All code that computes them uses the same operations in the
/// same order, so that all choosers agree bit for bit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafCost {
    /// K_T.
    pub(crate) traverse: f32,
    /// The cost of one block of `lanes` primitives.
    pub(crate) block: f32,
    pub(crate) lanes: u32,
    pub(crate) empty_bonus: f32,
    /// log₂ of `lanes`, if it is an integer, to avoid a division for every candidate.
    shift: Option<u32>,
}

impl LeafCost {
    pub(crate) fn new(model: &CostModel) -> Self {
        Self {
            traverse: model.traverse,
            block: model.intersect * model.lanes as f32,
            lanes: model.lanes,
            empty_bonus: model.empty_bonus,
            shift: model
                .lanes
                .is_power_of_two()
                .then(|| model.lanes.trailing_zeros()),
        }
    }

    /// The cost of a leaf of `count` primitives.
    #[inline]
    pub(crate) fn of(&self, count: u32) -> f32 {
        let blocks = match self.shift {
            Some(shift) => (count + self.lanes - 1) >> shift,
            None => count.div_ceil(self.lanes),
        };
        // The conversion of a signed integer is one instruction, and the number of blocks fits.
        self.block * blocks.cast_signed() as f32
    }

    /// [`of`](Self::of) for several counts, without a branch between them.
    #[inline(always)]
    pub(crate) fn of_lanes<const N: usize>(&self, counts: &[u32; N]) -> [f32; N] {
        let mut costs = [0.0; N];
        if let Some(shift) = self.shift {
            for (cost, count) in costs.iter_mut().zip(counts) {
                let blocks = (count + self.lanes - 1) >> shift;
                *cost = self.block * blocks.cast_signed() as f32;
            }
        } else {
            for (cost, count) in costs.iter_mut().zip(counts) {
                *cost = self.of(*count);
            }
        }
        costs
    }

    /// The factor on the cost of a plane with these numbers of primitives on its sides.
    #[inline(always)]
    pub(crate) fn bonus(&self, lower: u32, upper: u32) -> f32 {
        if (lower == 0) | (upper == 0) {
            self.empty_bonus
        } else {
            1.0
        }
    }

    /// Whether a leaf of `count` primitives is at least as cheap as any subtree whose root plane has primitives on both
    /// sides.
    ///
    /// Such a subtree costs at least a node plus the cheaper of a block and a node: a ray that enters the cell enters at
    /// least one child, and a child that is not empty costs at least a block or a node.
    #[inline]
    pub(crate) fn is_settled(&self, count: u32) -> bool {
        self.of(count) <= self.traverse + self.block.min(self.traverse)
    }
}

/// The cost of planes in one cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellCost {
    pub(crate) leaf: LeafCost,
    pub(crate) axes: [AxisCost; 3],
    /// The axes of candidate planes.
    pub(crate) considered: &'static [Axis],
}

/// The probabilities of entering the children of a cell, as linear functions of the position of a plane along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisCost {
    pub(crate) min: f32,
    pub(crate) max: f32,
    /// The factor from a distance to `min` to a fraction of the cell. It is infinite if it overflows f32: planes across a
    /// cell that is so thin have no finite cost and are not considered.
    pub(crate) scale: f32,
    /// The probability of entering a child of zero thickness: the area of the cut face over the half area of the cell.
    pub(crate) face: f32,
    /// The increase of the probability for a child as thick as the cell.
    pub(crate) slope: f32,
}

impl AxisCost {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "computed in f64 so that areas neither overflow nor vanish, then rounded"
    )]
    fn of(cell: &Aabb, axis: Axis) -> Self {
        let extent = cell.max.as_dvec3() - cell.min.as_dvec3();
        let along = extent[axis.index()];
        let (a, b) = (
            extent[axis.next().index()],
            extent[axis.next().next().index()],
        );
        let inverse = 1.0 / cell.half_area();
        Self {
            min: cell.min[axis.index()],
            max: cell.max[axis.index()],
            scale: (1.0 / along) as f32,
            face: (a * b * inverse) as f32,
            slope: ((a + b) * along * inverse) as f32,
        }
    }

    /// A position as a fraction of the cell: 0 at the lower face, 1 at the upper face. Monotone in the position.
    #[inline]
    pub(crate) fn fraction(&self, position: f32) -> f32 {
        (position - self.min) * self.scale
    }

    /// Whether a plane at `position` is strictly inside the cell, and so divides it.
    #[inline]
    pub(crate) fn is_inside(&self, position: f32) -> bool {
        self.min < position && position < self.max
    }
}

impl CellCost {
    pub(crate) fn new(leaf: LeafCost, cell: &Aabb) -> Self {
        Self {
            leaf,
            axes: Axis::ALL.map(|axis| AxisCost::of(cell, axis)),
            considered: &Axis::ALL,
        }
    }

    /// The same with only the longest axis of the cell considered; the first of equally long ones.
    pub(crate) fn with_longest_axis(self, cell: &Aabb) -> Self {
        let extent = cell.extent();
        let longest = Axis::ALL
            .into_iter()
            .rev()
            .max_by(|a, b| extent[a.index()].total_cmp(&extent[b.index()]))
            .map_or(0, Axis::index);
        Self {
            considered: &Axis::ALL[longest..=longest],
            ..self
        }
    }

    /// The cost after MacDonald and Booth as in Wald and Havran 2006, eq. 4: K_T plus, for each child, its leaf cost times
    /// its half area over that of the cell, times a bonus if a child is empty. `lower` and `upper` are the fractions of the
    /// cell that the children take along the axis.
    ///
    /// Every operation is monotone, rounding included: a smaller child, or one with fewer primitives, never costs more. The
    /// lower bounds of costs rely on this ([`promising`](crate::promising)).
    #[inline]
    pub(crate) fn of_parts(
        &self,
        axis: Axis,
        (lower, lower_count): (f32, u32),
        (upper, upper_count): (f32, u32),
    ) -> f32 {
        let AxisCost { face, slope, .. } = self.axes[axis.index()];
        let cost = self.leaf.traverse
            + (face + slope * lower) * self.leaf.of(lower_count)
            + (face + slope * upper) * self.leaf.of(upper_count);
        cost * self.leaf.bonus(lower_count, upper_count)
    }
}

impl CellCost {
    /// [`of_parts`](Self::of_parts) for several planes, by the same operations, without a branch between them. The
    /// arguments are the fractions and counts of all lower children, then of all upper children.
    #[inline(always)]
    pub(crate) fn of_lanes<const N: usize>(
        &self,
        axis: Axis,
        (lower, lower_counts): (&[f32; N], &[u32; N]),
        (upper, upper_counts): (&[f32; N], &[u32; N]),
    ) -> [f32; N] {
        let AxisCost { face, slope, .. } = self.axes[axis.index()];
        let lower_leaves = self.leaf.of_lanes(lower_counts);
        let upper_leaves = self.leaf.of_lanes(upper_counts);
        let mut costs = [0.0; N];
        for lane in 0..N {
            let cost = self.leaf.traverse
                + (face + slope * lower[lane]) * lower_leaves[lane]
                + (face + slope * upper[lane]) * upper_leaves[lane];
            costs[lane] = cost * self.leaf.bonus(lower_counts[lane], upper_counts[lane]);
        }
        costs
    }
}

/// The best candidate plane of one cell so far. Every chooser offers its candidates here, or applies the same rules to
/// several candidates at once, so that all choosers agree on costs and ties.
#[derive(Clone, Copy)]
pub(crate) struct BestPlane<'a> {
    pub(crate) cost: &'a CellCost,
    best: Option<Plane>,
}

impl<'a> BestPlane<'a> {
    pub(crate) fn new(cost: &'a CellCost) -> Self {
        Self { cost, best: None }
    }

    /// Considers a plane twice, with planar primitives on the lower and on the upper side. A plane that is not strictly
    /// inside the cell is ignored.
    #[inline]
    pub(crate) fn offer(&mut self, axis: Axis, position: f32, counts: Counts) {
        let (lower, planar, upper) = (counts.lower, counts.planar, counts.upper);
        self.offer_side(axis, position, (lower + planar, upper), Side::Lower);
        if planar > 0 {
            self.offer_side(axis, position, (lower, planar + upper), Side::Upper);
        }
    }

    /// Considers a plane with `lower` primitives below and `upper` primitives above it. Planar primitives are included in
    /// the count of `planar_side`.
    #[inline]
    pub(crate) fn offer_side(
        &mut self,
        axis: Axis,
        position: f32,
        (lower, upper): (usize, usize),
        planar_side: Side,
    ) {
        let along = &self.cost.axes[axis.index()];
        if !along.is_inside(position) {
            return;
        }
        let fraction = along.fraction(position);
        let (lower, upper) = (as_count(lower), as_count(upper));
        let cost = self
            .cost
            .of_parts(axis, (fraction, lower), (1.0 - fraction, upper));
        let plane = Plane {
            axis,
            position,
            planar_side,
            cost,
        };
        self.take(plane);
    }

    /// Considers a plane whose cost is known. A plane without a finite cost is ignored: the cell has no area, or is too
    /// thin for f32.
    #[inline]
    pub(crate) fn take(&mut self, plane: Plane) {
        if plane.cost < f32::INFINITY && self.best.is_none_or(|best| plane.is_better(&best)) {
            self.best = Some(plane);
        }
    }

    pub(crate) fn found(self) -> Option<Plane> {
        self.best
    }

    /// The cost of the best plane so far; infinite without a plane.
    pub(crate) fn least_cost(&self) -> f32 {
        self.best.map_or(f32::INFINITY, |plane| plane.cost)
    }
}

/// Offers the planes that cut off empty space: the faces of the box `tight` around all `count` primitives of the cell.
pub(crate) fn offer_empty_cuts(best: &mut BestPlane<'_>, tight: &Aabb, count: usize) {
    for axis in Axis::ALL {
        best.offer_side(axis, tight.min[axis.index()], (0, count), Side::Upper);
        best.offer_side(axis, tight.max[axis.index()], (count, 0), Side::Lower);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn best_of(offers: &[(Axis, f32, Counts)]) -> Option<Plane> {
        let cell = Aabb::around([Vec3::ZERO, Vec3::splat(4.0)]);
        let cost = CellCost::new(LeafCost::new(&CostModel::CLASSIC), &cell);
        let mut best = BestPlane::new(&cost);
        for &(axis, position, counts) in offers {
            best.offer(axis, position, counts);
        }
        best.found()
    }

    const EVEN: Counts = Counts {
        lower: 4,
        planar: 0,
        upper: 4,
    };

    #[test]
    fn ties_do_not_depend_on_the_order_of_offers() {
        let mut offers = vec![
            (Axis::Z, 1.0, EVEN),
            (Axis::Y, 3.0, EVEN),
            (Axis::Y, 1.0, EVEN),
            (Axis::Z, 3.0, EVEN),
        ];
        for _ in 0..offers.len() {
            offers.rotate_left(1);
            let best = best_of(&offers).expect("a plane");
            assert_eq!(
                (best.axis, best.position),
                (Axis::Y, 1.0),
                "y before z, lower position before higher"
            );
        }
    }

    #[test]
    fn planar_primitives_go_to_the_cheaper_side() {
        let counts = Counts {
            lower: 0,
            planar: 5,
            upper: 9,
        };
        let low = best_of(&[(Axis::X, 1.0, counts)]).expect("a plane");
        assert_eq!(low.planar_side, Side::Lower, "the smaller side");
        let counts = Counts {
            lower: 5,
            planar: 5,
            upper: 5,
        };
        let middle = best_of(&[(Axis::X, 2.0, counts)]).expect("a plane");
        assert_eq!(middle.planar_side, Side::Lower, "the lower side in a tie");
    }

    #[test]
    fn empty_cuts_get_the_bonus_and_faces_of_the_cell_are_ignored() {
        let none = Counts {
            lower: 0,
            planar: 0,
            upper: 8,
        };
        let cut = best_of(&[(Axis::X, 2.0, none)]).expect("a plane");
        let expected = (15.0 + 2.0 / 3.0 * 160.0) * 0.9;
        assert!((cut.cost - expected).abs() < 1e-4, "{cut:?}");
        assert_eq!(
            best_of(&[(Axis::X, 0.0, EVEN), (Axis::X, 4.0, EVEN)]),
            None,
            "faces of the cell"
        );
    }

    #[test]
    fn leaf_costs_equal_those_of_the_model() {
        for lanes in [1, 3, 8, 100] {
            let model = CostModel {
                lanes,
                ..CostModel::CLASSIC
            };
            for count in [0, 1, 7, 8, 9, 300] {
                let prepared = f64::from(LeafCost::new(&model).of(as_count(count)));
                assert_eq!(prepared, model.leaf(count), "{count} in {lanes} lanes");
            }
        }
    }

    #[test]
    fn cells_whose_leaf_is_cheapest_are_settled() {
        let packed = LeafCost::new(&CostModel {
            traverse: 1.0,
            intersect: 0.1,
            lanes: 8,
            empty_bonus: 0.8,
        });
        assert!(
            packed.is_settled(16),
            "two blocks cost less than a node and a block"
        );
        assert!(!packed.is_settled(17), "three blocks cost more");
        let classic = LeafCost::new(&CostModel::CLASSIC);
        assert!(
            classic.is_settled(1) && !classic.is_settled(2),
            "20 and 40, compared with 15 + 15"
        );
    }
}
