//! Trying a grid, a few rays at a time.

/// Rays that are asked one after the other, and timed together.
pub const RUN: usize = 8;
/// So many runs are asked whatever they take, the first of which warms up: with fewer, most rays of a scene may be unlike those
/// that were asked.
pub const FEWEST_RUNS: usize = 5;
/// After these, a try ends when it has taken this part of what the grid took to build: it is to save time.
pub const MOST_OF_BUILD: f64 = 0.25;

/// The numbers below `count`, in an order in which the first ones, however many, are spread evenly over all (J. G. van der
/// Corput, *Verteilungsfunktionen*, 1935): for samples that may end before all is asked.
pub fn spread_evenly(count: usize) -> impl Iterator<Item = usize> {
    let places = count.next_power_of_two();
    let shift = usize::BITS - places.trailing_zeros();
    (0..places)
        .map(move |number| number.reverse_bits().checked_shr(shift).unwrap_or(0))
        .filter(move |place| *place < count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_ones_are_spread_over_all() {
        assert!(spread_evenly(8).eq([0, 4, 2, 6, 1, 5, 3, 7]));
        assert!(spread_evenly(5).eq([0, 4, 2, 1, 3]), "as far as there are");
        assert!(spread_evenly(1).eq([0]));
        assert_eq!(spread_evenly(0).count(), 0, "of nothing, nothing");
        let mut all: Vec<usize> = spread_evenly(1000).collect();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..1000), "each once");
    }
}
