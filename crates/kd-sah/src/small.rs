//! The plane of least SAH cost for a cell of few primitives: every candidate counted against every primitive, many
//! candidates at a time.
//!
//! This is the naive method, and the fastest for few primitives: no sorting, no branches that depend on the data. It is
//! compiled for each [`Level`]. Comparisons, integers and single operations on f32 round alike at all levels, so all give
//! the same plane.

use kd_core::Axis;
use kd_simd::{F32x8, Level, Number, Simd, Task, U32x8};

use crate::plane::{AxisCost, BestPlane, CellCost, Plane, Side};
use crate::prim::Prim;

/// The largest number of primitives of a small cell.
pub(crate) const SMALL: usize = 64;

/// Candidates that are judged together: two vectors.
const LANES: usize = 16;

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

/// Vectors of candidates.
const HALVES: usize = 2;

/// Numbers of primitives at each candidate.
struct Counts<S: Simd> {
    /// Those that start below it.
    below: [S::U32; HALVES],
    /// Those that end above it.
    above: [S::U32; HALVES],
    /// Those in it, if they are counted.
    planar: [S::U32; HALVES],
}

impl<S: Simd> Counts<S> {
    #[inline(always)]
    fn of<const PLANAR: bool>(
        simd: S,
        candidates: &[S::F32; HALVES],
        starts: &[f32],
        ends: &[f32],
    ) -> Self {
        let none = [simd.splat_u32(0); HALVES];
        let (mut below, mut above, mut planar) = (none, none, none);
        for (&start, &end) in starts.iter().zip(ends) {
            let (start, end) = (simd.splat(start), simd.splat(end));
            for half in 0..HALVES {
                let candidate = candidates[half];
                below[half] = below[half].count(start.lt(candidate));
                above[half] = above[half].count(candidate.lt(end));
                if PLANAR {
                    let is_planar = start.eq(candidate) & end.eq(candidate);
                    planar[half] = planar[half].count(is_planar);
                }
            }
        }
        Self {
            below,
            above,
            planar,
        }
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
    fn leaf<S: Simd>(&self, simd: S, count: S::U32) -> S::F32 {
        let blocks = count
            .plus(self.lanes - 1)
            .times(self.reciprocal)
            .high_halves();
        simd.splat(self.cost.leaf.block) * simd.to_f32(blocks)
    }

    /// The cost of planes, as of [`BestPlane::offer_side`]; infinite if a plane does not divide the cell.
    #[inline(always)]
    fn plane<S: Simd>(&self, simd: S, position: S::F32, lower: S::U32, upper: S::U32) -> S::F32 {
        let along = &self.along;
        let (face, slope) = (simd.splat(along.face), simd.splat(along.slope));
        let (min, max) = (simd.splat(along.min), simd.splat(along.max));
        let fraction = (position - min) * simd.splat(along.scale);
        let one = simd.splat(1.0);
        let cost = simd.splat(self.cost.leaf.traverse)
            + (face + slope * fraction) * self.leaf(simd, lower)
            + (face + slope * (one - fraction)) * self.leaf(simd, upper);
        let cuts_off = lower.is_zero() | upper.is_zero();
        let bonus = simd.splat(self.cost.leaf.empty_bonus).or(cuts_off, one);
        let is_inside = min.lt(position) & position.lt(max);
        (cost * bonus).or(is_inside, simd.splat(f32::INFINITY))
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
        let mut lower_side = Least::new(simd);
        let mut upper_side = Least::new(simd);
        let (candidates, _) = positions.as_chunks::<LANES>();
        for candidates in &candidates[..number.div_ceil(LANES)] {
            let [first, second] = bytemuck::must_cast_ref::<_, [[f32; 8]; HALVES]>(candidates);
            let candidates = [simd.load(first), simd.load(second)];
            let Counts {
                below,
                above,
                planar,
            } = Counts::<S>::of::<PLANAR>(simd, &candidates, starts, ends);
            for half in 0..HALVES {
                let (position, planar) = (candidates[half], planar[half]);
                let (lower, upper) = (below[half].add(planar), above[half]);
                let cost = self.plane(simd, position, lower, upper);
                lower_side.add(half, position, cost);
                if PLANAR {
                    let (lower, upper) = (below[half], planar.add(above[half]));
                    let cost = self.plane(simd, position, lower, upper);
                    let cost = simd.splat(f32::INFINITY).or(planar.is_zero(), cost);
                    upper_side.add(half, position, cost);
                }
            }
        }
        self.take(&lower_side, Side::Lower, best);
        if PLANAR {
            self.take(&upper_side, Side::Upper, best);
        }
    }

    #[inline(always)]
    fn take<F: F32x8>(&self, least: &Least<F>, planar_side: Side, best: &mut BestPlane<'_>) {
        let (mut costs, mut positions) = ([[0.0; 8]; HALVES], [[0.0; 8]; HALVES]);
        for half in 0..HALVES {
            least.cost[half].store(&mut costs[half]);
            least.position[half].store(&mut positions[half]);
        }
        let (costs, positions) = (costs.as_flattened(), positions.as_flattened());
        for (&cost, &position) in costs.iter().zip(positions) {
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

/// The least cost in each lane, and its position; the lowest position among equals.
struct Least<F> {
    cost: [F; HALVES],
    position: [F; HALVES],
}

impl<F: F32x8> Least<F> {
    #[inline(always)]
    fn new<S: Simd<F32 = F>>(simd: S) -> Self {
        let nothing = [simd.splat(f32::INFINITY); HALVES];
        Self {
            cost: nothing,
            position: nothing,
        }
    }

    #[inline(always)]
    fn add(&mut self, half: usize, position: F, cost: F) {
        let (least, at) = (self.cost[half], self.position[half]);
        let is_better = cost.lt(least) | (cost.eq(least) & position.lt(at));
        self.cost[half] = cost.or(is_better, least);
        self.position[half] = position.or(is_better, at);
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
