//! The cheapest of the divisions between equal parts of an axis.

use glam::Vec3A;
use kd_core::CostModel;

use super::{Divide, Division, cost_as_leaf};
use crate::item::{Around, Bounds, Item, partition};

/// Puts items into bins by their centres, on all axes at once, and sweeps over the bins in place of the items.
pub(crate) struct Binned {
    pub(crate) model: CostModel,
    /// Bins along each axis, at least 2.
    pub(crate) bins: usize,
}

/// The items of one bin.
#[derive(Clone, Copy, Debug)]
struct Bin {
    bounds: Bounds,
    count: usize,
}

/// Memory that is kept.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    /// Those of one axis after those of another.
    bins: Vec<Bin>,
    /// What the bins from each one on cost as a leaf.
    upper_costs: Vec<f64>,
}

/// Which bin a centre is in.
#[derive(Clone, Copy, Debug)]
struct Grid {
    start: Vec3A,
    per_unit: Vec3A,
    last: u32,
}

impl Bin {
    const EMPTY: Self = Self {
        bounds: Bounds::NOTHING,
        count: 0,
    };

    fn add(&mut self, other: &Self) {
        self.bounds.grow(&other.bounds);
        self.count += other.count;
    }

    fn cost(&self, model: &CostModel) -> f64 {
        cost_as_leaf(&self.bounds, self.count, model)
    }
}

impl Grid {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "there are at most 256 bins"
    )]
    fn new(around: &Around, bins: usize) -> Self {
        let extent = around.centers.max - around.centers.min;
        Self {
            start: around.centers.min,
            per_unit: bins as f32 / extent,
            last: bins as u32 - 1,
        }
    }

    /// The bins of an item, one on each axis. Where an axis has no extent, or one that f32 does not hold, it is the first for
    /// all items, or whichever rounding gives.
    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places are not negative; what is too large becomes the last bin, and NaN the first"
    )]
    fn of(&self, item: &Item) -> [usize; 3] {
        let place = (item.bounds.center() - self.start) * self.per_unit;
        place
            .to_array()
            .map(|place| (place as u32).min(self.last) as usize)
    }
}

impl Divide for Binned {
    type Scratch = Scratch;

    fn divide(
        &self,
        items: &mut [Item],
        around: &Around,
        scratch: &mut Scratch,
    ) -> Option<Division> {
        // More than that are empty for the most part, and clearing them takes longer than filling them.
        let bins = self.bins.min(2 * items.len());
        let grid = Grid::new(around, bins);
        scratch.bins.clear();
        scratch.bins.resize(3 * bins, Bin::EMPTY);
        for item in &*items {
            for (axis, bin) in grid.of(item).into_iter().enumerate() {
                scratch.bins[axis * bins + bin].add(&Bin {
                    bounds: item.bounds,
                    count: 1,
                });
            }
        }
        let mut best: Option<(Division, usize, usize)> = None;
        for (axis, bins) in scratch.bins.chunks(bins).enumerate() {
            let cheapest = self.cheapest(bins, &mut scratch.upper_costs);
            if let Some((division, bin)) = cheapest
                && best.is_none_or(|(best, ..)| division.cost < best.cost)
            {
                best = Some((division, axis, bin));
            }
        }
        let (division, axis, first_upper) = best?;
        let middle = partition(items, |item| grid.of(item)[axis] < first_upper);
        debug_assert_eq!(middle, division.middle, "items are in the same bins again");
        Some(division)
    }
}

impl Binned {
    /// The best division of bins, and the first bin of its upper part.
    fn cheapest(&self, bins: &[Bin], upper_costs: &mut Vec<f64>) -> Option<(Division, usize)> {
        upper_costs.clear();
        upper_costs.resize(bins.len(), 0.0);
        let mut upper = Bin::EMPTY;
        for (cost, bin) in upper_costs.iter_mut().zip(bins).skip(1).rev() {
            upper.add(bin);
            if upper.count > 0 {
                *cost = upper.cost(&self.model);
            }
        }
        let all = upper.count + bins[0].count;
        let mut best: Option<(Division, usize)> = None;
        let mut lower = Bin::EMPTY;
        for (first_upper, bin) in (1..bins.len()).zip(bins) {
            // After an empty bin the division is the one before it.
            if bin.count == 0 {
                continue;
            }
            lower.add(bin);
            if lower.count == all {
                break;
            }
            let cost = lower.cost(&self.model) + upper_costs[first_upper];
            if best.is_none_or(|(best, _)| cost < best.cost) {
                let middle = lower.count;
                best = Some((Division { middle, cost }, first_upper));
            }
        }
        best
    }
}
