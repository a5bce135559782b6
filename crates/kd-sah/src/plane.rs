//! Candidate planes and their cost.

use kd_core::{Aabb, Axis, CostModel};

/// A plane to divide a cell by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Plane {
    pub(crate) axis: Axis,
    pub(crate) position: f32,
    /// Where primitives go that lie in the plane itself: never to both sides.
    pub(crate) planar_side: Side,
    /// Expected cost of the cell when divided here, for a ray that enters it.
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
    /// The order in which planes are preferred: lower cost, then axis, then position, then planar primitives below.
    ///
    /// It is total, so the winner does not depend on the order in which candidates are looked at.
    pub(crate) fn is_better(&self, other: &Self) -> bool {
        let rank = |plane: &Self| (plane.axis, plane.position, plane.planar_side);
        self.cost < other.cost || (self.cost == other.cost && rank(self) < rank(other))
    }
}

/// How many primitives lie where, as seen from a plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Reaching below the plane.
    pub(crate) lower: usize,
    /// Lying in it.
    pub(crate) planar: usize,
    /// Reaching above it. One that straddles the plane counts below and above.
    pub(crate) upper: usize,
}

/// How many primitives a cell holds, or an estimate of it, as the cost model takes it.
#[inline]
#[allow(
    clippy::cast_possible_truncation,
    reason = "a cell holds each primitive once, and primitives are numbered by 30 bits"
)]
pub(crate) fn as_count(primitives: usize) -> u32 {
    primitives as u32
}

/// The cost model, prepared for asking it about every candidate.
///
/// Costs of planes are f32, so that eight fit into a vector, and are computed by the same operations in the same order
/// wherever that is done: all choosers agree to the bit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafCost {
    /// K_T.
    pub(crate) traverse: f32,
    /// What one block of `lanes` costs.
    pub(crate) block: f32,
    pub(crate) lanes: u32,
    pub(crate) empty_bonus: f32,
    /// log₂ of `lanes`, if it is whole: whoever asks for every candidate is spared a division.
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

    /// Cost of a leaf.
    #[inline]
    pub(crate) fn of(&self, count: u32) -> f32 {
        let blocks = match self.shift {
            Some(shift) => (count + self.lanes - 1) >> shift,
            None => count.div_ceil(self.lanes),
        };
        // Signed, which is one instruction; there are no more than fit.
        self.block * blocks.cast_signed() as f32
    }

    /// [`of`](Self::of) several counts, with no branch between them.
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

    /// What the cost of a plane with so many primitives on its sides is multiplied by.
    #[inline(always)]
    pub(crate) fn bonus(&self, lower: u32, upper: u32) -> f32 {
        if (lower == 0) | (upper == 0) {
            self.empty_bonus
        } else {
            1.0
        }
    }

    /// Whether no plane with primitives on both sides can make the cell cheaper than a leaf of `count`, however it is
    /// divided further: a node, and below it at least one ray's worth of the cheapest there is, cost as much.
    ///
    /// (A ray that enters the cell enters at least one of its parts; a part that is not empty costs at least a block,
    /// or a node.)
    #[inline]
    pub(crate) fn is_settled(&self, count: u32) -> bool {
        self.of(count) <= self.traverse + self.block.min(self.traverse)
    }
}

/// What planes in one cell cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellCost {
    pub(crate) leaf: LeafCost,
    pub(crate) axes: [AxisCost; 3],
    /// The axes across which planes are looked for.
    pub(crate) considered: &'static [Axis],
}

/// The chances of entering either part of a cell, as linear functions of where it is cut along an axis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisCost {
    pub(crate) min: f32,
    pub(crate) max: f32,
    /// Turns a distance from `min` into a fraction of the cell. Infinite where f32 does not hold it; planes across
    /// so thin a cell have no finite cost, and are not considered.
    pub(crate) scale: f32,
    /// Chance of entering a part of no thickness: the area of the face cut out, over the half area of the cell.
    pub(crate) face: f32,
    /// What the whole thickness adds.
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

    /// Where a position lies: 0 at the lower face of the cell, 1 at the upper one. Never decreases along the axis.
    #[inline]
    pub(crate) fn fraction(&self, position: f32) -> f32 {
        (position - self.min) * self.scale
    }

    /// Whether a plane there divides the cell at all.
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

    /// Considers planes across the longest axis of the cell only, the first one among equals.
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

    /// Cost after MacDonald and Booth as in Wald and Havran 2006, eq. 4: K_T plus each side's leaf cost times its half
    /// area over the cell's, with a bonus where a side is empty. `lower` and `upper` are fractions of the cell that the
    /// two parts take along the axis.
    ///
    /// Every operation is monotone, rounding included: less of either part, or fewer in it, never costs more. Bounds
    /// of costs rely on that ([`exact`](crate::choose::Exact)).
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
    /// [`of_parts`](Self::of_parts) several planes, by the same operations, with no branch between them: the fractions
    /// and counts of all lower parts, then of all upper ones.
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

/// Looks for the best plane of one cell; every chooser offers its candidates here, or does what is done here to many
/// at once, so that they agree on cost and ties.
#[derive(Clone, Copy)]
pub(crate) struct BestPlane<'a> {
    pub(crate) cost: &'a CellCost,
    best: Option<Plane>,
}

impl<'a> BestPlane<'a> {
    pub(crate) fn new(cost: &'a CellCost) -> Self {
        Self { cost, best: None }
    }

    /// Considers a plane, with planar primitives on either side. Only planes strictly inside the cell divide it.
    #[inline]
    pub(crate) fn offer(&mut self, axis: Axis, position: f32, counts: Counts) {
        let (lower, planar, upper) = (counts.lower, counts.planar, counts.upper);
        self.offer_side(axis, position, (lower + planar, upper), Side::Lower);
        if planar > 0 {
            self.offer_side(axis, position, (lower, planar + upper), Side::Upper);
        }
    }

    /// Considers a plane with so many primitives below and above it, planar ones among those of their side.
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

    /// Considers a plane whose cost is known. One without a finite cost is worse than none: the cell has no area, or
    /// is too thin for f32.
    #[inline]
    pub(crate) fn take(&mut self, plane: Plane) {
        if plane.cost < f32::INFINITY && self.best.is_none_or(|best| plane.is_better(&best)) {
            self.best = Some(plane);
        }
    }

    pub(crate) fn found(self) -> Option<Plane> {
        self.best
    }

    /// The cost of the best so far; infinite if there is none.
    pub(crate) fn least_cost(&self) -> f32 {
        self.best.map_or(f32::INFINITY, |plane| plane.cost)
    }
}

/// The planes that cut off what is empty: the faces of the box `tight` around all `count` primitives of the cell.
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
                "y before z, low before high"
            );
        }
    }

    #[test]
    fn planar_primitives_go_where_they_cost_less() {
        let counts = Counts {
            lower: 0,
            planar: 5,
            upper: 9,
        };
        let low = best_of(&[(Axis::X, 1.0, counts)]).expect("a plane");
        assert_eq!(low.planar_side, Side::Lower, "the small side");
        let counts = Counts {
            lower: 5,
            planar: 5,
            upper: 5,
        };
        let middle = best_of(&[(Axis::X, 2.0, counts)]).expect("a plane");
        assert_eq!(middle.planar_side, Side::Lower, "a tie goes below");
    }

    #[test]
    fn empty_space_has_a_bonus_and_faces_are_no_planes() {
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
    fn leaves_cost_what_the_model_says() {
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
    fn a_settled_cell_is_a_leaf_whatever_is_done() {
        let packed = LeafCost::new(&CostModel {
            traverse: 1.0,
            intersect: 0.1,
            lanes: 8,
            empty_bonus: 0.8,
        });
        assert!(
            packed.is_settled(16),
            "two blocks are less than a node and a block"
        );
        assert!(!packed.is_settled(17), "three are not");
        let classic = LeafCost::new(&CostModel::CLASSIC);
        assert!(
            classic.is_settled(1) && !classic.is_settled(2),
            "20 and 40 against 15 + 15"
        );
    }
}
