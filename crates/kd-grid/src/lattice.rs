//! The geometry of the cells of a grid.

use glam::{Vec3, Vec3A};
use kd_core::Aabb;

/// Largest number of cells along an axis: an index takes 16 bits.
pub(crate) const MOST_ALONG: u32 = 1 << 16;

/// Enlargement of triangles on each side, over the longest side of the grid.
///
/// A reported hit represents a point of its triangle within 2⁻²⁵ of the longest side W of the ray (see
/// `kd_trace::kit::RayPlanes`), and a ray is in the cell of its walk up to 2⁻²⁵ W more (see [`walk`](crate::walk)). 2⁻²⁰ W covers
/// both, and the rounding errors of this module, many times over. With ten thousand cells along an axis it is a hundredth of a
/// cell.
pub(crate) const PAD: f64 = 1.0 / (1 << 20) as f64;

/// A box divided into equal cells.
///
/// Cells are numbered along the axis of the fewest cells first, so that consecutive numbers form thin layers across the axis of
/// the most cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lattice {
    pub(crate) bounds: Aabb,
    /// Number of cells along each axis.
    pub(crate) resolution: [u32; 3],
    /// Difference of the numbers of neighbors along each axis.
    pub(crate) strides: [u32; 3],
    /// Cells per scene unit; 0 along an axis that is not divided.
    pub(crate) per_unit: [f64; 3],
    /// [`PAD`] in cells.
    pad: [f64; 3],
    /// The same lattice for triangles.
    scaled: Scaled,
}

/// A lattice in f32, in units of a power of two near its longest side, so that nothing overflows or underflows.
///
/// Three roundings give a coordinate an error of less than 2⁻²² of the number of cells, a quarter of the pad.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scaled {
    /// The power of two.
    scale: Vec3A,
    /// The lowest corner.
    min: Vec3A,
    /// Cells per unit; 0 along an axis that is not divided.
    per_unit: Vec3A,
    pad: Vec3A,
    /// The last cell along each axis.
    last: Vec3A,
}

/// The cells that a triangle's box overlaps, from the first to the last inclusive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CellRange {
    pub(crate) first: [u32; 3],
    pub(crate) last: [u32; 3],
}

impl CellRange {
    /// Number of cells.
    #[inline]
    pub(crate) fn count(&self) -> u64 {
        (0..3)
            .map(|axis| u64::from(self.last[axis] - self.first[axis]) + 1)
            .product()
    }
}

impl Lattice {
    /// At most `cells` cells, close to that number and as close to cubes as possible.
    pub(crate) fn new(bounds: Aabb, cells: f64) -> Self {
        let extent = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).to_array();
        Self::with_resolution(bounds, resolution(extent, cells))
    }

    pub(crate) fn with_resolution(bounds: Aabb, resolution: [u32; 3]) -> Self {
        let extent = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).to_array();
        let longest = extent.into_iter().fold(0.0, f64::max);
        let mut axes = [0, 1, 2];
        axes.sort_by_key(|axis| resolution[*axis]);
        let mut strides = [0; 3];
        let mut stride = 1;
        for axis in axes {
            strides[axis] = stride;
            stride = u32::saturating_mul(stride, resolution[axis]);
        }
        let mut per_unit = [0.0; 3];
        let mut pad = [0.0; 3];
        for axis in 0..3 {
            if resolution[axis] > 1 {
                per_unit[axis] = f64::from(resolution[axis]) / extent[axis];
                pad[axis] = PAD * longest * per_unit[axis];
            }
        }
        Self {
            bounds,
            resolution,
            strides,
            per_unit,
            pad,
            scaled: Scaled::new(bounds, resolution, longest),
        }
    }

    /// Half as many cells along each axis.
    pub(crate) fn halved(&self) -> Self {
        Self::with_resolution(self.bounds, self.resolution.map(|along| (along / 2).max(1)))
    }

    pub(crate) fn cells(&self) -> usize {
        self.resolution
            .iter()
            .map(|along| *along as usize)
            .product()
    }

    /// The cells that a triangle's box, enlarged by the pad, overlaps. The triangle is within the bounds.
    #[inline(always)]
    pub(crate) fn range(&self, corners: [Vec3; 3]) -> CellRange {
        let [a, b, c] = corners.map(Vec3A::from);
        CellRange {
            first: self.scaled.places(a.min(b).min(c), -self.scaled.pad),
            last: self.scaled.places(a.max(b).max(c), self.scaled.pad),
        }
    }

    /// A point in cells from the lowest corner.
    #[inline]
    pub(crate) fn coordinates(&self, point: Vec3) -> [f64; 3] {
        let (point, min) = (point.to_array(), self.bounds.min.to_array());
        [0, 1, 2].map(|axis| (f64::from(point[axis]) - f64::from(min[axis])) * self.per_unit[axis])
    }

    /// Index of the cell of a coordinate along an axis, clamped to the first and the last cell.
    #[inline]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to at most 2^16 cells"
    )]
    pub(crate) fn place(&self, axis: usize, coordinate: f64) -> u32 {
        // Not `clamp`: this order of operands is one instruction each.
        let most = f64::from(self.resolution[axis] - 1);
        let above = if coordinate > 0.0 { coordinate } else { 0.0 };
        (if above < most { above } else { most }) as u32
    }

    /// [`PAD`] in cells.
    pub(crate) fn pad(&self) -> [f64; 3] {
        self.pad
    }

    /// The number of the cell with these indices.
    #[inline]
    pub(crate) fn number(&self, place: [u32; 3]) -> usize {
        (0..3)
            .map(|axis| place[axis] as usize * self.strides[axis] as usize)
            .sum()
    }
}

impl Scaled {
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a power of two that f32 has, and quotients that may round"
    )]
    fn new(bounds: Aabb, resolution: [u32; 3], longest: f64) -> Self {
        /// The largest power of two that leaves room for sums.
        const MOST: f64 = (1_u128 << 126) as f64;
        // A power of two by its exponent. (A longest side of 0 gives MOST.)
        let exponent = longest.max(1.0 / MOST).to_bits() & (0x7ff << 52);
        let scale = f64::from_bits((2046 << 52) - exponent).min(MOST);
        let side = |axis: usize| f64::from(bounds.max[axis]) - f64::from(bounds.min[axis]);
        let cells = |axis: usize, cells: f64| {
            let per_unit = f64::from(resolution[axis]) / (side(axis) * scale);
            if resolution[axis] > 1 {
                (cells * per_unit) as f32
            } else {
                0.0
            }
        };
        let last = resolution.map(|along| (along - 1) as f32);
        Self {
            scale: Vec3A::splat(scale as f32),
            min: Vec3A::from(bounds.min) * scale as f32,
            per_unit: Vec3A::from_array([0, 1, 2].map(|axis| cells(axis, 1.0))),
            pad: Vec3A::from_array([0, 1, 2].map(|axis| cells(axis, PAD * longest * scale))),
            last: Vec3A::from_array(last),
        }
    }

    /// Indices of the cell of a point moved by `moved_by` cells, clamped to the first and the last cell.
    #[inline(always)]
    fn places(&self, point: Vec3A, moved_by: Vec3A) -> [u32; 3] {
        // Adding 2²³ to a small number rounds it to a whole number in the lowest bits: a branch-free conversion of all lanes. A
        // point just at a border may round to either side, which the pad allows for.
        const WHOLE: f32 = (1 << 23) as f32;
        let coordinates = (point * self.scale - self.min) * self.per_unit + moved_by;
        let below = coordinates.max(Vec3A::ZERO).min(self.last + 0.5) - 0.5;
        (below.max(Vec3A::ZERO) + WHOLE)
            .to_array()
            .map(|x| x.to_bits() & 0xffff)
    }
}

/// Numbers of cells along sides of these lengths, with a product of at most `cells`.
///
/// Sides shorter than a cell are not divided, and the others get the cells: a flat scene has squares.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 1 and 2^16"
)]
fn resolution(extent: [f64; 3], cells: f64) -> [u32; 3] {
    let mut divided: Vec<usize> = (0..3).filter(|axis| extent[*axis] > 0.0).collect();
    // Short sides first: each is compared with the cells that the remaining sides would get.
    divided.sort_by(|a, b| extent[*a].total_cmp(&extent[*b]));
    let mut resolution = [1; 3];
    while !divided.is_empty() {
        let volume: f64 = divided.iter().map(|axis| extent[*axis]).product();
        let per_unit = (cells / volume).powf(1.0 / divided.len() as f64);
        if extent[divided[0]] * per_unit < 1.0 {
            divided.remove(0);
            continue;
        }
        for axis in divided {
            resolution[axis] = (extent[axis] * per_unit).clamp(1.0, f64::from(MOST_ALONG)) as u32;
        }
        break;
    }
    resolution
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(extent: [f32; 3]) -> Aabb {
        Aabb {
            min: Vec3::ZERO,
            max: Vec3::from(extent),
        }
    }

    #[test]
    fn cells_are_nearly_cubes_and_not_too_many() {
        let rows: [([f32; 3], f64, [u32; 3]); 9] = [
            ([1.0, 1.0, 1.0], 1000.0, [10, 10, 10]),
            ([2.0, 1.0, 1.0], 250.0, [10, 5, 5]),
            ([1.0, 1.0, 0.0], 100.0, [10, 10, 1]),
            ([0.0, 5.0, 0.0], 100.0, [1, 100, 1]),
            ([0.0, 0.0, 0.0], 100.0, [1, 1, 1]),
            ([1.0, 1.0, 1e-6], 100.0, [10, 10, 1]),
            ([1e30, 1e30, 1e30], 1000.0, [10, 10, 10]),
            ([1e-40, 1e-40, 1e-40], 1000.0, [10, 10, 10]),
            ([1.0, 1.0, 1.0], 0.5, [1, 1, 1]),
        ];
        for (extent, cells, expected) in rows {
            let lattice = Lattice::new(bounds(extent), cells * (1.0 + 1e-6));
            assert_eq!(lattice.resolution, expected, "{extent:?}");
        }
    }

    #[test]
    fn many_cells_along_a_line_are_capped() {
        let lattice = Lattice::new(bounds([1.0, 0.0, 0.0]), 1e9);
        assert_eq!(
            lattice.resolution,
            [MOST_ALONG, 1, 1],
            "the limit of 16 bits"
        );
        let last = lattice.range([Vec3::X; 3]);
        assert_eq!(last.last, [MOST_ALONG - 1, 0, 0], "the last cell");
    }

    #[test]
    fn every_cell_has_its_number() {
        let lattice = Lattice::with_resolution(bounds([1.0, 2.0, 3.0]), [2, 5, 3]);
        assert_eq!(lattice.strides, [1, 6, 2], "the most outside");
        let mut numbers: Vec<usize> = (0..30)
            .map(|i| lattice.number([i % 2, i / 2 % 5, i / 10]))
            .collect();
        numbers.sort_unstable();
        assert!(numbers.into_iter().eq(0..30), "each once");
    }

    #[test]
    fn triangles_on_a_border_are_on_both_sides() {
        let lattice = Lattice::with_resolution(bounds([8.0, 8.0, 8.0]), [8, 8, 8]);
        let point = |x: f32| lattice.range([Vec3::new(x, 2.5, 8.0); 3]);
        assert_eq!(
            (point(4.0).first[0], point(4.0).last[0]),
            (3, 4),
            "on the border"
        );
        assert_eq!(
            (point(4.1).first[0], point(4.1).last[0]),
            (4, 4),
            "beyond it"
        );
        assert_eq!(
            (point(0.0).first, point(0.0).last),
            ([0, 2, 7], [0, 2, 7]),
            "the bounds"
        );
        assert_eq!(point(4.0).count(), 2, "two cells");
    }

    #[test]
    fn halving_ends_at_one_cell() {
        let mut lattice = Lattice::with_resolution(bounds([1.0, 1.0, 1.0]), [7, 2, 1]);
        lattice = lattice.halved();
        assert_eq!(lattice.resolution, [3, 1, 1], "rounded down");
        lattice = lattice.halved().halved();
        assert_eq!(
            (lattice.resolution, lattice.cells()),
            ([1, 1, 1], 1),
            "one is left"
        );
    }
}
