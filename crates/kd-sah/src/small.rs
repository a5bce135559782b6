//! The plane of least SAH cost for a cell of few primitives: every candidate counted against every primitive, eight
//! candidates at a time.
//!
//! This is the naive method, and for few primitives the fastest: no sorting, no branches that depend on the data. The
//! same body is compiled twice, for whatever the target has and for AVX2, and the processor decides at run time which
//! one runs. Only comparisons, integers and single operations on f32 are in it, nothing that a wider instruction would
//! round differently, so both give the same plane.

use kd_core::Axis;

use crate::plane::{BestPlane, CellCost, Plane, Side};
use crate::prim::Prim;

/// A cell with more primitives is none of ours.
pub(crate) const SMALL: usize = 64;

/// Candidates looked at together.
const LANES: usize = 8;

/// Two for each primitive.
const CANDIDATES: usize = 2 * SMALL;

/// The best plane at any start or end of a primitive; `None` if nothing divides the cell.
///
/// # Panics
///
/// If there are more than [`SMALL`] primitives.
pub(crate) fn best_plane(prims: &[Prim], cost: &CellCost) -> Option<Plane> {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        return avx2::best_plane(prims, cost);
    }
    portable(prims, cost)
}

#[cfg(target_arch = "x86_64")]
#[allow(
    unsafe_code,
    reason = "code for a processor's extension may only be called where it is there"
)]
mod avx2 {
    use super::{CellCost, Plane, Prim, portable};

    pub(super) fn best_plane(prims: &[Prim], cost: &CellCost) -> Option<Plane> {
        #[target_feature(enable = "avx2")]
        fn with_avx2(prims: &[Prim], cost: &CellCost) -> Option<Plane> {
            portable(prims, cost)
        }
        assert!(is_x86_feature_detected!("avx2"), "asked before");
        // SAFETY: the processor has AVX2, as the line above makes sure.
        unsafe { with_avx2(prims, cost) }
    }
}

#[inline(always)]
fn portable(prims: &[Prim], cost: &CellCost) -> Option<Plane> {
    let count = prims.len();
    assert!(count <= SMALL, "{count} are too many");
    let mut best = BestPlane::new(cost);
    let judge = Judge::new(cost);
    for axis in Axis::ALL {
        let mut starts = [0.0; SMALL];
        let mut ends = [0.0; SMALL];
        let mut has_planar = false;
        for (i, prim) in prims.iter().enumerate() {
            // -0.0 and 0.0 are one plane, named 0.0.
            starts[i] = prim.start(axis) + 0.0;
            ends[i] = prim.end(axis) + 0.0;
            has_planar |= starts[i] == ends[i];
        }
        let (starts, ends) = (&starts[..count], &ends[..count]);
        if has_planar {
            judge.offer_all::<true>(axis, starts, ends, &mut best);
        } else {
            judge.offer_all::<false>(axis, starts, ends, &mut best);
        }
    }
    best.found()
}

/// [`CellCost`] for eight planes at once.
struct Judge<'a> {
    cost: &'a CellCost,
    /// Lanes of the model, or as many as make no difference.
    lanes: u32,
    /// 2¹⁶ over `lanes`, rounded up: multiplying by it and shifting divides such small counts exactly.
    reciprocal: u32,
}

impl<'a> Judge<'a> {
    #[allow(clippy::cast_possible_truncation, reason = "a constant of two digits")]
    fn new(cost: &'a CellCost) -> Self {
        let lanes = cost.leaf.lanes.min(SMALL as u32);
        Self {
            cost,
            lanes,
            reciprocal: (1_u32 << 16).div_ceil(lanes),
        }
    }

    /// [`LeafCost::of`](crate::plane::LeafCost::of).
    #[inline(always)]
    fn leaf(&self, count: u32) -> f32 {
        let blocks = (count + self.lanes - 1) * self.reciprocal >> 16;
        self.cost.leaf.block * blocks.cast_signed() as f32
    }

    /// [`CellCost::of_parts`].
    #[inline(always)]
    fn of_parts(&self, axis: Axis, fraction: f32, (lower, upper): (u32, u32)) -> f32 {
        let along = &self.cost.axes[axis.index()];
        let cost = self.cost.leaf.traverse
            + (along.face + along.slope * fraction) * self.leaf(lower)
            + (along.face + along.slope * (1.0 - fraction)) * self.leaf(upper);
        if (lower == 0) | (upper == 0) {
            cost * self.cost.leaf.empty_bonus
        } else {
            cost
        }
    }

    #[inline(always)]
    fn offer_all<const PLANAR: bool>(
        &self,
        axis: Axis,
        starts: &[f32],
        ends: &[f32],
        best: &mut BestPlane<'_>,
    ) {
        let along = &self.cost.axes[axis.index()];
        let count = 2 * starts.len();
        // Padding lies on a face, where no plane divides the cell.
        let mut position = [along.min; CANDIDATES];
        position[..starts.len()].copy_from_slice(starts);
        position[starts.len()..count].copy_from_slice(ends);
        let mut costs = [[f32::INFINITY; CANDIDATES]; 2];
        let mut least = [f32::INFINITY; LANES];
        for block in 0..count.div_ceil(LANES) {
            let at = block * LANES;
            let here: [f32; LANES] = position[at..at + LANES].try_into().expect("eight of them");
            let mut lower = [0_u32; LANES];
            let mut upper = [0_u32; LANES];
            let mut planar = [0_u32; LANES];
            for (&start, &end) in starts.iter().zip(ends) {
                for lane in 0..LANES {
                    lower[lane] += u32::from(start < here[lane]);
                    upper[lane] += u32::from(end > here[lane]);
                    if PLANAR {
                        planar[lane] += u32::from((start == here[lane]) & (end == here[lane]));
                    }
                }
            }
            for lane in 0..LANES {
                let (l, p, u) = (lower[lane], planar[lane], upper[lane]);
                let fraction = along.fraction(here[lane]);
                let is_inside = (along.min < here[lane]) & (here[lane] < along.max);
                let cost = self.of_parts(axis, fraction, (l + p, u));
                let cost = if is_inside & (cost < f32::INFINITY) {
                    cost
                } else {
                    f32::INFINITY
                };
                costs[0][at + lane] = cost;
                least[lane] = if cost < least[lane] {
                    cost
                } else {
                    least[lane]
                };
                if PLANAR {
                    let cost = self.of_parts(axis, fraction, (l, p + u));
                    let cost = if is_inside & (cost < f32::INFINITY) & (p > 0) {
                        cost
                    } else {
                        f32::INFINITY
                    };
                    costs[1][at + lane] = cost;
                    least[lane] = if cost < least[lane] {
                        cost
                    } else {
                        least[lane]
                    };
                }
            }
        }
        let least = least.into_iter().fold(f32::INFINITY, f32::min);
        if !(least <= best.least_cost() && least < f32::INFINITY) {
            return;
        }
        for (planar_side, costs) in [Side::Lower, Side::Upper].into_iter().zip(&costs) {
            for (cost, position) in costs[..count].iter().zip(position) {
                if *cost == least {
                    best.take(Plane {
                        axis,
                        position,
                        planar_side,
                        cost: *cost,
                    });
                }
            }
        }
    }
}
