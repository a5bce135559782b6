//! Boxes of few cells, the common case.

use crate::lattice::CellRange;

/// Largest number of cells of a small box along each axis.
const ALONG: u32 = 4;
/// A small box has fewer cells in total: an exact test would not pay
/// (see [`is_worth_a_test`](crate::overlap::is_worth_a_test)).
pub(crate) const CELLS: usize = 16;
const KINDS: usize = (ALONG * ALONG * ALONG) as usize;

/// The cells of every kind of small box: a table in place of loops with unpredictable ends.
pub(crate) struct SmallBoxes {
    /// Offset of each cell from the first one.
    cells: [[u32; CELLS]; KINDS],
    counts: [u8; KINDS],
}

impl SmallBoxes {
    /// For a lattice of these strides.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "at most 64 kinds, of at most 64 cells"
    )]
    pub(crate) fn new(strides: [u32; 3]) -> Self {
        let mut cells = [[0; CELLS]; KINDS];
        let mut counts = [0; KINDS];
        for (kind, (cells, count)) in (0..).zip(cells.iter_mut().zip(&mut counts)) {
            let more: [u32; 3] = [kind % ALONG, kind / ALONG % ALONG, kind / (ALONG * ALONG)];
            *count = more.map(|more| more + 1).iter().product::<u32>() as u8;
            let along = |axis: usize| (0..=more[axis]).map(move |at| at * strides[axis]);
            let all = along(2).flat_map(|z| along(1).map(move |y| y + z));
            let all = all.flat_map(|row| along(0).map(move |x| x + row));
            // Kinds of more cells are never used.
            for (cell, from_first) in cells.iter_mut().zip(all) {
                *cell = from_first;
            }
        }
        Self { cells, counts }
    }

    /// The kind of a range of cells, if it is a small box.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "at most 64 kinds")]
    pub(crate) fn kind(range: &CellRange) -> Option<u8> {
        let [x, y, z] = [0, 1, 2].map(|axis| range.last[axis] - range.first[axis]);
        let is_small = (x | y | z) < ALONG && range.count() < CELLS as u64;
        is_small.then_some((x + ALONG * (y + ALONG * z)) as u8)
    }

    /// Offsets of its cells from the first one, and their number. Entries behind them are unused.
    #[inline(always)]
    pub(crate) fn cells(&self, kind: u8) -> (&[u32; CELLS], usize) {
        let kind = usize::from(kind) % KINDS;
        (&self.cells[kind], usize::from(self.counts[kind]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::overlap::is_worth_a_test;

    #[test]
    fn every_small_box_has_its_cells() {
        let strides = [1, 10, 100];
        let boxes = SmallBoxes::new(strides);
        let mut kinds = 0;
        for last in (0..125).map(|i| [i % 5, i / 5 % 5, i / 25]) {
            let range = CellRange {
                first: [0; 3],
                last,
            };
            let Some(kind) = SmallBoxes::kind(&range) else {
                let is_large = last.contains(&4) || range.count() >= 16;
                assert!(is_large, "{last:?}");
                continue;
            };
            kinds += 1;
            assert!(!is_worth_a_test(&range), "no test is left out: {last:?}");
            let (cells, count) = boxes.cells(kind);
            // The digits of a number are the indices.
            let mut own: Vec<u32> = (0..=last[0] + 10 * last[1] + 100 * last[2]).collect();
            own.retain(|cell| {
                let place = [cell % 10, cell / 10 % 10, cell / 100];
                (0..3).all(|axis| place[axis] <= last[axis])
            });
            assert_eq!(&cells[..count], own, "{last:?}");
        }
        assert_eq!(kinds, 38, "of 64, the others have 16 cells or more");
    }
}
