//! SAH by adaptive sampling (Hunt, Mark, Stoll 2006, *Fast kd-tree construction with an adaptive error-bounded
//! heuristic*; Eleftheriades 2010 §2.4.2.2).
//!
//! On each axis the primitives below and above are counted at eight equidistant planes, then at eight more planes where the
//! counts change fastest. Both counts are assumed to be linear between neighboring planes. The probabilities of entering
//! either child are linear too, so that the cost is a quadratic function on each interval. The plane is at the least
//! minimum of these functions.

use kd_core::Axis;

use super::Memoryless;
use crate::CHUNK;
use crate::cell::Cell;
use crate::plane::{BestPlane, CellCost, Plane, Side, offer_empty_cuts};
use crate::prim::Prim;
use crate::small::{self, SMALL};

/// The number of planes counted in one pass.
const PLANES: usize = 8;

/// Chooses by sampling in cells of more than [`SMALL`] primitives, and exactly in others.
#[derive(Debug)]
pub(crate) struct Sampled {
    /// Whether all axes are sampled, instead of only the longest axis of the cell.
    pub(crate) all_axes: bool,
}

impl Memoryless for Sampled {
    fn plane(&self, cell: Cell<'_>, cost: &CellCost, parallel: bool) -> Option<Plane> {
        if cell.prims.len() <= SMALL {
            return small::best_plane(cell.prims, cost);
        }
        let mut best = BestPlane::new(cost);
        let one_axis = cost.with_longest_axis(&cell.place.bounds);
        let axes = if self.all_axes { cost } else { &one_axis }.considered;
        for &axis in axes {
            sample(cell, axis, parallel).offer_minima(axis, cell.prims.len(), cost, &mut best);
        }
        offer_empty_cuts(&mut best, &cell.place.tight, cell.prims.len());
        best.found()
    }
}

/// A plane and the numbers of primitives that reach below and above it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    position: f32,
    lower: f32,
    upper: f32,
}

/// Planes in order of position, including both faces of the box around the primitives.
struct Samples(Vec<Sample>);

/// Counts primitives at equidistant planes, then at planes where the counts change fastest.
fn sample(cell: Cell<'_>, axis: Axis, parallel: bool) -> Samples {
    let (min, max) = (
        cell.place.tight.min[axis.index()],
        cell.place.tight.max[axis.index()],
    );
    let all = cell.prims.len() as f32;
    let face = |position, lower, upper| Sample {
        position,
        lower,
        upper,
    };
    let ends = [face(min, 0.0, all), face(max, all, 0.0)];
    let step = |number: usize| number as f32 / (PLANES + 1) as f32;
    let evenly = std::array::from_fn(|i| min + (max - min) * step(i + 1));
    let mut samples = Samples(ends.to_vec());
    samples.add(count(cell, axis, evenly, parallel));
    // lower - upper increases monotonically from -all to all: place planes at equal steps of it.
    let adaptive =
        std::array::from_fn(|i| samples.where_difference_is(all * (2.0 * step(i + 1) - 1.0)));
    samples.add(count(cell, axis, adaptive, parallel));
    samples
}

impl Samples {
    fn add(&mut self, counted: [Sample; PLANES]) {
        self.0.extend(counted);
        self.0.sort_by(|a, b| a.position.total_cmp(&b.position));
    }

    /// The position where lower - upper reaches a value, interpolated linearly between samples.
    fn where_difference_is(&self, value: f32) -> f32 {
        let difference = |at: &Sample| at.lower - at.upper;
        let last = self.0.partition_point(|at| difference(at) < value);
        let (last, first) = (
            self.0[last.min(self.0.len() - 1)],
            self.0[last.saturating_sub(1)],
        );
        let rise = difference(&last) - difference(&first);
        let fraction = if rise > 0.0 {
            (value - difference(&first)) / rise
        } else {
            0.0
        };
        between(first.position, last.position, fraction)
    }

    /// Offers the cheapest plane of each interval; `all` is the number of primitives.
    fn offer_minima(&self, axis: Axis, all: usize, cost: &CellCost, best: &mut BestPlane<'_>) {
        for pair in self.0.windows(2) {
            let interval = Interval {
                first: pair[0],
                last: pair[1],
            };
            let (position, lower, upper) = interval.minimum(axis, cost);
            // A plane that all primitives straddle would be chosen again in both children.
            if lower == all && upper == all {
                continue;
            }
            best.offer_side(axis, position, (lower, upper), Side::Lower);
        }
    }
}

/// The interval between two neighboring samples.
struct Interval {
    first: Sample,
    last: Sample,
}

impl Interval {
    /// The position of least cost and the counts there, for a leaf cost linear in the number of primitives.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "counts of primitives, not negative"
    )]
    fn minimum(&self, axis: Axis, cost: &CellCost) -> (f32, usize, usize) {
        let along = &cost.axes[axis.index()];
        let (first, last) = (&self.first, &self.last);
        // With s from 0 to 1 on the interval: probability (p + q s) times count (l + m s), and the same above the plane.
        let (start, end) = (
            along.fraction(first.position),
            along.fraction(last.position),
        );
        let q = along.slope * (end - start);
        let (p_lower, p_upper) = (
            along.face + along.slope * start,
            along.face + along.slope * (1.0 - start),
        );
        let (m_lower, m_upper) = (last.lower - first.lower, last.upper - first.upper);
        let square = q * m_lower - q * m_upper;
        let linear = p_lower * m_lower + q * first.lower + p_upper * m_upper - q * first.upper;
        let at = |s: f32| square * s * s + linear * s;
        let bottom = if square > 0.0 {
            (-0.5 * linear / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let s = [bottom, 0.0, 1.0]
            .into_iter()
            .reduce(|best, s| if at(s) < at(best) { s } else { best })
            .unwrap_or(0.0);
        let lower = between(first.lower, last.lower, s).ceil() as usize;
        let upper = between(first.upper, last.upper, s).ceil() as usize;
        (between(first.position, last.position, s), lower, upper)
    }
}

fn between(a: f32, b: f32, fraction: f32) -> f32 {
    a + (b - a) * fraction
}

/// Counts the primitives that reach below and above each of eight planes.
fn count(cell: Cell<'_>, axis: Axis, planes: [f32; PLANES], parallel: bool) -> [Sample; PLANES] {
    let chunks = kd_tasks::map(
        cell.prims.chunks(CHUNK).collect(),
        parallel,
        |chunk: &[Prim]| {
            let (mut lower, mut upper) = ([0_u32; PLANES], [0_u32; PLANES]);
            for prim in chunk {
                let (start, end) = (prim.start(axis), prim.end(axis));
                for i in 0..PLANES {
                    lower[i] += u32::from(start < planes[i]);
                    upper[i] += u32::from(end > planes[i]);
                }
            }
            (lower, upper)
        },
    );
    std::array::from_fn(|i| Sample {
        position: planes[i],
        lower: chunks.iter().map(|chunk| chunk.0[i]).sum::<u32>() as f32,
        upper: chunks.iter().map(|chunk| chunk.1[i]).sum::<u32>() as f32,
    })
}
