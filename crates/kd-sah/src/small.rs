//! The plane of least SAH cost for a cell of few primitives: every candidate counted against every primitive, many
//! candidates at a time.
//!
//! This is the naive method, and the fastest for few primitives: no sorting, no branches that depend on the data. It is
//! compiled for each [`Level`]. Comparisons, integers and single operations on f32 round alike at all levels, so all give
//! the same plane.

use kd_core::Axis;
use kd_simd::{Level, Number, Simd, Task, U32x8};

use crate::plane::{AxisCost, BestPlane, CellCost, Plane, Side};
use crate::prim::Prim;

/// The largest number of primitives of a small cell.
pub(crate) const SMALL: usize = 64;

/// Candidates that are counted together.
const LANES: usize = 16;

/// A number for each candidate.
type Lanes<T> = [T; LANES];

/// The best plane at a start or end of a primitive; `None` if none divides the cell.
///
/// # Panics
///
/// If there are more than [`SMALL`] primitives.
pub(crate) fn best_plane(prims: &[Prim], cost: &CellCost) -> Option<Plane> {
    Level::detect().run(FindBestPlane { prims, cost })
}

/// [`best_plane`] at some level.
struct FindBestPlane<'a> {
    prims: &'a [Prim],
    cost: &'a CellCost,
}

impl<S: Simd> Task<S> for FindBestPlane<'_> {
    type Output = Option<Plane>;

    #[inline(always)]
    fn run(self, simd: S) -> Option<Plane> {
        best_plane_by(simd, self.prims, self.cost)
    }
}

/// For each candidate, the number of primitives that start below it, and of those that end above it.
struct BelowAndAbove<'a> {
    candidates: &'a Lanes<f32>,
    starts: &'a [f32],
    ends: &'a [f32],
}

impl<S: Simd> Task<S> for BelowAndAbove<'_> {
    type Output = (Lanes<u32>, Lanes<u32>);

    #[inline(always)]
    fn run(self, simd: S) -> Self::Output {
        let [first, second] = bytemuck::must_cast_ref::<Lanes<f32>, [[f32; 8]; 2]>(self.candidates);
        let (first, second) = (simd.load(first), simd.load(second));
        let none = simd.splat_u32(0);
        let (mut below, mut above) = ([none; 2], [none; 2]);
        for (&start, &end) in self.starts.iter().zip(self.ends) {
            let (start, end) = (simd.splat(start), simd.splat(end));
            below[0] = below[0].count(start.lt(first));
            below[1] = below[1].count(start.lt(second));
            above[0] = above[0].count(first.lt(end));
            above[1] = above[1].count(second.lt(end));
        }
        let below = [below[0].to_array(), below[1].to_array()];
        let above = [above[0].to_array(), above[1].to_array()];
        (bytemuck::must_cast(below), bytemuck::must_cast(above))
    }
}

#[inline(always)]
fn best_plane_by<S: Simd>(simd: S, prims: &[Prim], cost: &CellCost) -> Option<Plane> {
    let number = prims.len();
    assert!(number <= SMALL, "{number} are too many");
    let mut best = BestPlane::new(cost);
    for &axis in cost.considered {
        let (mut starts, mut ends) = ([0.0; SMALL], [0.0; SMALL]);
        let mut is_any_planar = false;
        for ((start, end), prim) in starts.iter_mut().zip(&mut ends).zip(prims) {
            // -0.0 and 0.0 are one plane, named 0.0.
            *start = prim.start(axis) + 0.0;
            *end = prim.end(axis) + 0.0;
            is_any_planar |= *start == *end;
        }
        let (starts, ends) = (&starts[..number], &ends[..number]);
        let judge = Judge::new(cost, axis);
        if is_any_planar {
            judge.offer_all::<true, S>(simd, starts, ends, &mut best);
        } else {
            judge.offer_all::<false, S>(simd, starts, ends, &mut best);
        }
    }
    best.found()
}

/// [`CellCost`] for many planes across one axis.
struct Judge<'a> {
    cost: &'a CellCost,
    axis: Axis,
    along: AxisCost,
    /// Lanes of the model, at most [`SMALL`], beyond which they make no difference.
    lanes: u32,
    /// 2¹⁶ over `lanes`, rounded up: multiplying by it and shifting divides such small counts exactly.
    reciprocal: u32,
}

impl<'a> Judge<'a> {
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "two digits")]
    fn new(cost: &'a CellCost, axis: Axis) -> Self {
        let lanes = cost.leaf.lanes.min(SMALL as u32);
        Self {
            cost,
            axis,
            along: cost.axes[axis.index()],
            lanes,
            reciprocal: (1_u32 << 16).div_ceil(lanes),
        }
    }

    /// [`LeafCost::of`](crate::plane::LeafCost::of).
    #[inline(always)]
    fn leaf(&self, count: u32) -> f32 {
        let blocks = ((count + self.lanes - 1) * self.reciprocal) >> 16;
        self.cost.leaf.block * blocks.cast_signed() as f32
    }

    /// The cost of a plane, as of [`BestPlane::offer_side`]; infinite if the plane does not divide the cell.
    #[inline(always)]
    fn plane(&self, position: f32, lower: u32, upper: u32) -> f32 {
        let along = &self.along;
        let fraction = along.fraction(position);
        let cost = self.cost.leaf.traverse
            + (along.face + along.slope * fraction) * self.leaf(lower)
            + (along.face + along.slope * (1.0 - fraction)) * self.leaf(upper);
        let bonus = if (lower == 0) | (upper == 0) {
            self.cost.leaf.empty_bonus
        } else {
            1.0
        };
        if (along.min < position) & (position < along.max) {
            cost * bonus
        } else {
            f32::INFINITY
        }
    }

    #[inline(always)]
    fn offer_all<const PLANAR: bool, S: Simd>(
        &self,
        simd: S,
        starts: &[f32],
        ends: &[f32],
        best: &mut BestPlane<'_>,
    ) {
        // Only planes inside the cell divide it, and clipped primitives often start or end at its faces. Each position
        // is written, and kept by going on to the next place.
        let mut positions = [0.0; 2 * SMALL + LANES];
        let mut number = 0;
        for &position in starts.iter().chain(ends) {
            positions[number] = position;
            number += usize::from(self.along.is_inside(position));
        }
        // Padding lies on a face.
        positions[number..number + LANES].fill(self.along.min);
        let mut lower_side = Least::NOTHING;
        let mut upper_side = Least::NOTHING;
        let (candidates, _) = positions.as_chunks::<LANES>();
        for candidates in &candidates[..number.div_ceil(LANES)] {
            let (below, above) = simd.run(BelowAndAbove {
                candidates,
                starts,
                ends,
            });
            let planar = if PLANAR {
                planar(candidates, starts, ends)
            } else {
                [0; LANES]
            };
            let costs = std::array::from_fn(|lane| {
                self.plane(candidates[lane], below[lane] + planar[lane], above[lane])
            });
            lower_side.add(candidates, &costs);
            if PLANAR {
                let costs = std::array::from_fn(|lane| {
                    let cost =
                        self.plane(candidates[lane], below[lane], planar[lane] + above[lane]);
                    if planar[lane] > 0 {
                        cost
                    } else {
                        f32::INFINITY
                    }
                });
                upper_side.add(candidates, &costs);
            }
        }
        self.take(&lower_side, Side::Lower, best);
        if PLANAR {
            self.take(&upper_side, Side::Upper, best);
        }
    }

    #[inline(always)]
    fn take(&self, least: &Least, planar_side: Side, best: &mut BestPlane<'_>) {
        for (&cost, &position) in least.cost.iter().zip(&least.position) {
            if cost <= best.least_cost() {
                best.take(Plane {
                    axis: self.axis,
                    position,
                    planar_side,
                    cost,
                });
            }
        }
    }
}

/// The number of primitives in each candidate plane.
#[inline(always)]
fn planar(candidates: &Lanes<f32>, starts: &[f32], ends: &[f32]) -> Lanes<u32> {
    let mut planar = [0; LANES];
    for (&start, &end) in starts.iter().zip(ends) {
        for (lane, &candidate) in candidates.iter().enumerate() {
            planar[lane] += u32::from((start == candidate) & (end == candidate));
        }
    }
    planar
}

/// The least cost in each lane, and its position; the lowest position among equals.
struct Least {
    cost: Lanes<f32>,
    position: Lanes<f32>,
}

impl Least {
    const NOTHING: Self = Self {
        cost: [f32::INFINITY; LANES],
        position: [f32::INFINITY; LANES],
    };

    #[inline(always)]
    fn add(&mut self, positions: &Lanes<f32>, costs: &Lanes<f32>) {
        for lane in 0..LANES {
            let (cost, position) = (costs[lane], positions[lane]);
            let (least, at) = (self.cost[lane], self.position[lane]);
            let is_better = (cost < least) | ((cost == least) & (position < at));
            self.cost[lane] = if is_better { cost } else { least };
            self.position[lane] = if is_better { position } else { at };
        }
    }
}

#[cfg(test)]
mod tests {
    use kd_core::CostModel;
    use proptest::prelude::*;

    use super::*;
    use crate::cell::{Cell, Place};
    use crate::choose::{Memoryless as _, Naive};
    use crate::plane::LeafCost;
    use crate::prim::samples::boxes;

    proptest! {
        /// The detected level equals the portable one, and both equal the judge without lanes.
        #[test]
        fn all_levels_give_the_same_plane(
            boxes_at in prop::collection::vec(([-4_i8..5, -4_i8..5, -4_i8..5], [0_i8..3, 0_i8..3, 0_i8..3]), 1..SMALL),
            lanes in 1_u32..80,
        ) {
            let (prims, cell) = boxes(&boxes_at);
            let model = CostModel { lanes, ..CostModel::CLASSIC };
            let cost = CellCost::new(LeafCost::new(&model), &cell);
            let portable = Level::portable().run(FindBestPlane { prims: &prims, cost: &cost });
            prop_assert_eq!(best_plane(&prims, &cost), portable);
            let place = Place { bounds: cell, tight: cell, depth: 0 };
            let cell = Cell { place: &place, prims: &prims };
            let naive = Naive.plane(cell, &cost, false);
            prop_assert_eq!(naive, portable);
        }
    }
}
