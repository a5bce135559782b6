//! The exact overlap of triangles and cells.
//!
//! After M. Schwarz and H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010: a box overlaps a triangle if
//! it overlaps its plane and, projected along each axis, is on the inner side of each edge. Each condition is a half-space for
//! the lowest corner of the box, so that a row of cells is tested at once: each half-space cuts off one end of the row.

use glam::{DVec3, Vec3};
use smallvec::SmallVec;

use crate::lattice::{CellRange, Lattice};
use crate::small_boxes::CELLS as SMALL_BOX;

/// Two sides of the plane, and three edges projected along each of three axes.
const HALF_SPACES: usize = 11;

/// Normals below this fraction of the squared length of edges are not used: in f64 their direction is rounding error.
///
/// Coordinates have an error of 2⁻⁵² of the number of cells r along the longest axis, so that with edges of length L (in cells) a
/// half-space of a normal n is off by about 2⁻⁵² r L² at a point of the triangle. Cells are enlarged by
/// [`PAD`](crate::lattice::PAD) r, which moves the half-space by |n| 2⁻²⁰ r. With |n| ≥ 2⁻²⁸ L² that is sixteen times as much.
const LEAST_NORMAL: f64 = 1.0 / (1 << 28) as f64;

/// A half-space with a slope along the row below this fraction of its largest slope counts as parallel to the row: over 2¹⁶ cells
/// that moves it by at most a sixteenth of the pad.
const PARALLEL: f64 = 1.0 / (1_u64 << 40) as f64;

/// Rows of cells. A triangle overlaps one stretch of each row, or none of it.
#[derive(Debug, Default)]
struct Rows {
    /// A stretch begins at or after each of these.
    begins: SmallVec<[Linear; HALF_SPACES]>,
    /// A stretch ends at or before each of these.
    ends: SmallVec<[Linear; HALF_SPACES]>,
    /// A row where one of these is negative has no stretch.
    parallel: SmallVec<[Linear; HALF_SPACES]>,
}

/// A linear function of a row's indices on the two other axes.
#[derive(Clone, Copy, Debug)]
struct Linear {
    at_zero: f64,
    slopes: [f64; 2],
}

/// `a · cell + c >= 0`, for whole numbers `cell`.
struct HalfSpace {
    a: [f64; 3],
    c: f64,
}

impl Rows {
    /// The rows along an axis, for a triangle.
    fn new(lattice: &Lattice, corners: [Vec3; 3], along: usize) -> Self {
        let corners = corners.map(|corner| DVec3::from_array(lattice.coordinates(corner)));
        let edges = [0, 1, 2].map(|i| corners[(i + 1) % 3] - corners[i]);
        let normal = edges[0].cross(edges[1]);
        let least: f64 = LEAST_NORMAL * edges.iter().map(|edge| edge.length_squared()).sum::<f64>();
        let pad = DVec3::from_array(lattice.pad());
        let mut rows = Self::default();
        if normal.abs().max_element() > least {
            rows.cut(&HalfSpace::reaching(normal, corners[0], pad), along);
            rows.cut(&HalfSpace::reaching(-normal, corners[0], pad), along);
        }
        for axis in 0..3 {
            // A triangle may project to a line along an axis: then the plane, tested above, is edge-on.
            if normal[axis].abs() <= least {
                continue;
            }
            let towards = DVec3::AXES[axis] * normal[axis].signum();
            for (edge, corner) in edges.into_iter().zip(corners) {
                let inner = HalfSpace::reaching(towards.cross(edge), corner, pad);
                rows.cut(&inner, along);
            }
        }
        rows
    }

    /// Intersects stretches with a half-space.
    fn cut(&mut self, HalfSpace { a, c }: &HalfSpace, along: usize) {
        let slope = a[along];
        let across = [a[(along + 1) % 3], a[(along + 2) % 3]];
        let largest = across[0].abs().max(across[1].abs());
        if slope.abs() <= PARALLEL * largest {
            self.parallel.push(Linear {
                at_zero: *c,
                slopes: across,
            });
            return;
        }
        let inverse = -slope.recip();
        let end = Linear {
            at_zero: c * inverse,
            slopes: across.map(|a| a * inverse),
        };
        if slope > 0.0 {
            self.begins.push(end);
        } else {
            self.ends.push(end);
        }
    }

    /// The first and the last overlapped cell of a row, from `first` to `last`.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from the first to the last"
    )]
    fn stretch(&self, place: [u32; 2], first: u32, last: u32) -> Option<[u32; 2]> {
        let place = place.map(f64::from);
        if self.parallel.iter().any(|side| side.at(place) < 0.0) {
            return None;
        }
        // Not `max` and `min`, which handle NaN: these are one instruction each.
        let larger = |a: f64, b: f64| if a > b { a } else { b };
        let smaller = |a: f64, b: f64| if a < b { a } else { b };
        let begins = self.begins.iter().map(|begin| begin.at(place));
        let begin = begins.fold(f64::from(first), larger);
        let ends = self.ends.iter().map(|end| end.at(place));
        let end = ends.fold(f64::from(last), smaller);
        if begin > end {
            return None;
        }
        let below = begin as u32;
        let first = below + u32::from(f64::from(below) < begin);
        let last = end as u32;
        (first <= last).then_some([first, last])
    }
}

impl Linear {
    #[inline(always)]
    fn at(&self, [u, w]: [f64; 2]) -> f64 {
        self.at_zero + self.slopes[0] * u + self.slopes[1] * w
    }
}

impl HalfSpace {
    /// The half-space of all cells that have a point within `pad` of the side of `point` to which `normal` points.
    fn reaching(normal: DVec3, point: DVec3, pad: DVec3) -> Self {
        // The corner of a cell furthest along the normal, relative to its lowest corner.
        let furthest = DVec3::select(normal.cmpgt(DVec3::ZERO), DVec3::ONE + pad, -pad);
        Self {
            a: normal.to_array(),
            c: normal.dot(furthest - point),
        }
    }
}

/// Calls `enter` with the number of each cell of a range.
pub(crate) fn for_each_cell(lattice: &Lattice, range: &CellRange, mut enter: impl FnMut(usize)) {
    let first = lattice.number(range.first);
    let counts = [0, 1, 2].map(|axis| (range.last[axis] - range.first[axis]) as usize + 1);
    let [x, y, z] = lattice.strides.map(|stride| stride as usize);
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                enter(first + i * x + j * y + k * z);
            }
        }
    }
}

/// Whether the exact test can exclude cells (several in two directions) and saves more time than it takes.
#[inline]
pub(crate) fn is_worth_a_test(range: &CellRange) -> bool {
    let directions = (0..3).filter(|&axis| range.first[axis] < range.last[axis]);
    range.count() >= SMALL_BOX as u64 && directions.count() >= 2
}

/// Calls `enter` with the number of each cell of a range that the triangle overlaps, row by row along the axis of the longest
/// rows.
pub(crate) fn for_each_cell_met(
    lattice: &Lattice,
    range: &CellRange,
    corners: [Vec3; 3],
    mut enter: impl FnMut(usize),
) {
    let length = |axis: usize| range.last[axis] - range.first[axis];
    let along = (0..3).max_by_key(|axis| length(*axis)).unwrap_or(0);
    let (u, w) = ((along + 1) % 3, (along + 2) % 3);
    let rows = Rows::new(lattice, corners, along);
    let stride = lattice.strides[along] as usize;
    let mut place = range.first;
    for at_w in range.first[w]..=range.last[w] {
        place[w] = at_w;
        for at_u in range.first[u]..=range.last[u] {
            place[u] = at_u;
            let stretch = rows.stretch([at_u, at_w], range.first[along], range.last[along]);
            if let Some([first, last]) = stretch {
                place[along] = first;
                let number = lattice.number(place);
                for i in 0..=(last - first) as usize {
                    enter(number + i * stride);
                }
            }
        }
    }
}
