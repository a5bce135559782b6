//! Rays sorted by direction.
//!
//! A direction is a point on one of the six sides of a cube. A side is divided into cells along Morton's curve. Consecutive rays
//! on a side, in this order, have similar directions.

use kd_core::Ray;
use kd_simd::{LANES, each};

/// Cells along the edge of a side, as a power of two.
const BITS: u32 = 4;
const CELLS: usize = 1 << (2 * BITS);
const SIDES: usize = 6;

/// The cell of a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cell(u16);

impl Cell {
    /// Any cell for a ray without a direction.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "the last bits")]
    fn of(ray: &Ray) -> Self {
        let [x, y, z] = ray.direction.to_array();
        let size = ray.direction.abs();
        let is_x = size.x >= size.y && size.x >= size.z;
        let is_y = size.y >= size.z;
        // Without branches, which incoherent rays would make unpredictable.
        let along = usize::from(!is_x) + usize::from(!(is_x | is_y));
        let turned = [x, y, z, x, y];
        let side = 2 * along as u16 + u16::from(turned[along] < 0.0);
        let middle = 0.5 * ((1 << BITS) - 1) as f32;
        let scale = middle / turned[along].abs();
        // 2²³ plus a smaller number has that number, rounded, in its last bits.
        const LAST_BITS: f32 = 8_388_608.0;
        let place = |x: f32| (x * scale + middle + LAST_BITS).to_bits() as u16 % (1 << BITS);
        let [x, y] = each([turned[along + 1], turned[along + 2]], |x| spread(place(x)));
        Self((side << (2 * BITS)) | x | (y << 1))
    }

    /// The sixteenth of a side that contains the cell.
    #[inline(always)]
    fn block(self) -> u16 {
        self.0 >> (2 * BITS - 4)
    }
}

/// The lowest four bits, with a zero between each two.
#[inline(always)]
fn spread(bits: u16) -> u16 {
    let pairs = (bits | bits << 2) & 0x33;
    (pairs | pairs << 1) & 0x55
}

/// Whether two rays have similar directions.
#[inline(always)]
pub(super) fn are_alike(a: &Ray, b: &Ray) -> bool {
    Cell::of(a).block() == Cell::of(b).block()
}

/// Sorts rays, and keeps its memory for the next ones.
pub(super) struct Sorter {
    cells: Vec<Cell>,
    /// For each cell, the place of its next ray.
    next: [u32; SIDES * CELLS],
    sorted: Vec<u32>,
}

impl Default for Sorter {
    fn default() -> Self {
        Self {
            cells: Vec::new(),
            next: [0; SIDES * CELLS],
            sorted: Vec::new(),
        }
    }
}

impl Sorter {
    /// The numbers of rays in the order of their cells, stable within a cell: each side in runs of at most `most`, of about
    /// equal length.
    pub(super) fn runs(
        &mut self,
        rays: &[Ray],
        numbers: &[u32],
        most: usize,
    ) -> impl Iterator<Item = &[u32]> {
        self.next = [0; SIDES * CELLS];
        self.cells.clear();
        for number in numbers {
            let cell = Cell::of(&rays[*number as usize]);
            self.next[usize::from(cell.0)] += 1;
            self.cells.push(cell);
        }
        let mut start = 0;
        for next in &mut self.next {
            start += std::mem::replace(next, start);
        }
        let starts: [u32; SIDES] = std::array::from_fn(|side| self.next[side * CELLS]);
        self.sorted.resize(numbers.len(), 0);
        for (number, cell) in numbers.iter().zip(&self.cells) {
            let next = &mut self.next[usize::from(cell.0)];
            self.sorted[*next as usize] = *number;
            *next += 1;
        }
        let sorted = &self.sorted;
        (0..SIDES).flat_map(move |side| {
            let end = starts
                .get(side + 1)
                .map_or(sorted.len(), |end| *end as usize);
            let of_side = &sorted[starts[side] as usize..end];
            let runs = of_side.len().div_ceil(most).max(1);
            let length = of_side.len().div_ceil(runs).next_multiple_of(LANES);
            of_side.chunks(length.clamp(1, most))
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;
    use crate::triangle::steepest_axis;

    fn side(ray: &Ray) -> (usize, bool) {
        let axis = steepest_axis(ray.direction).index();
        (axis, ray.direction[axis] < 0.0)
    }

    #[test]
    fn directions_have_cells() {
        let cell = |x: f32, y: f32, z: f32| Cell::of(&Ray::new(Vec3::ZERO, Vec3::new(x, y, z))).0;
        assert_eq!(
            cell(2.0, -2.0, -2.0),
            0,
            "the first corner of the first side"
        );
        assert_eq!(
            cell(1.0, 1.0, 1.0),
            255,
            "its last one, a ray that goes to three sides"
        );
        assert_eq!(cell(-3.0, -3.0, -3.0), 256, "the second side");
        assert_eq!(cell(0.9, 1.0, 0.9) >> 8, 2, "mostly up");
        assert_eq!(cell(0.0, 0.0, -1e-30) >> 8, 5, "the last side");
        for odd in [0.0, f32::NAN, f32::INFINITY] {
            assert!(usize::from(cell(odd, odd, 1.0)) < SIDES * CELLS, "{odd}");
            assert!(usize::from(cell(odd, odd, odd)) < SIDES * CELLS, "{odd}");
        }
    }

    #[test]
    fn near_directions_are_alike() {
        let ray = |x: f32, y: f32| Ray::new(Vec3::ZERO, Vec3::new(x, y, 1.0));
        assert!(are_alike(&ray(0.1, 0.1), &ray(0.4, 0.3)));
        assert!(!are_alike(&ray(0.1, 0.1), &ray(0.9, 0.1)), "further");
        assert!(!are_alike(&ray(0.1, 0.1), &ray(1.1, 0.1)), "another side");
        assert!(
            !are_alike(&ray(0.1, 0.1), &Ray::new(Vec3::ZERO, Vec3::NEG_Z)),
            "back"
        );
    }

    proptest! {
        /// Every number comes once, in ordered runs of one side each.
        #[test]
        fn runs_hold_every_ray_once(
            directions in prop::collection::vec(prop::array::uniform3(-1.0_f32..1.0), 1..400),
            skip in 1_usize..3,
            most in 1_usize..9,
        ) {
            let most = 8 * most;
            let rays: Vec<Ray> =
                directions.iter().map(|d| Ray::new(Vec3::ZERO, Vec3::from_array(*d))).collect();
            let numbers: Vec<u32> = (0..).take(rays.len()).step_by(skip).collect();
            let mut sorter = Sorter::default();
            for _ in 0..2 {
                let mut seen = Vec::new();
                for run in sorter.runs(&rays, &numbers, most) {
                    prop_assert!(!run.is_empty() && run.len() <= most);
                    let of = |number: &u32| &rays[*number as usize];
                    prop_assert!(run.iter().all(|number| side(of(number)) == side(of(&run[0]))));
                    prop_assert!(run.is_sorted_by_key(|number| (Cell::of(of(number)).0, *number)));
                    seen.extend_from_slice(run);
                }
                seen.sort_unstable();
                prop_assert_eq!(&seen, &numbers);
            }
        }
    }
}
