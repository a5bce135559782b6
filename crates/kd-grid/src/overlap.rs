//! Which cells a triangle meets.
//!
//! After M. Schwarz and H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010: a box meets a triangle if
//! it meets its plane and, seen along each axis, is on the inner side of each edge. Each of these is a half-space for the
//! lowest corner of the box, so that a row of cells is asked at once: each half-space cuts off one end of it.

use glam::{DVec3, Vec3};
use smallvec::SmallVec;

use crate::lattice::{CellRange, Lattice};
use crate::small_boxes::CELLS as SMALL_BOX;

/// Two sides of the plane, three edges seen along each of three axes.
const HALF_SPACES: usize = 11;

/// Normals below this fraction of the squared length of edges are not used: with f64 they may point anywhere.
///
/// Coordinates err by 2⁻⁵² of the number of cells r along the longest axis, so with edges of length L (in cells) a half-space
/// of a normal n is off by some 2⁻⁵² r L² at a point of the triangle; cells are enlarged by [`PAD`](crate::lattice::PAD) r,
/// which moves it by |n| 2⁻²⁰ r. With |n| ≥ 2⁻²⁸ L² that is sixteen times as much.
const LEAST_NORMAL: f64 = 1.0 / (1 << 28) as f64;

/// Rows along which a half-space changes by less than this fraction of its largest slope are taken to be parallel to it: over
/// 2¹⁶ cells that moves it by no more than a sixteenth of the pad.
const PARALLEL: f64 = 1.0 / (1_u64 << 40) as f64;

/// Rows of cells, of each of which a triangle meets one stretch, or nothing.
#[derive(Debug, Default)]
struct Rows {
    /// A stretch begins at or after each of these,
    begins: SmallVec<[Linear; HALF_SPACES]>,
    /// and ends at or before each of these.
    ends: SmallVec<[Linear; HALF_SPACES]>,
    /// Where one of these is negative, there is none.
    parallel: SmallVec<[Linear; HALF_SPACES]>,
}

/// A number for each row, by its place across the two other axes.
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
    /// Those of a triangle along an axis.
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
            // Seen along an axis, a triangle may be no more than a line: then its plane is seen edge-on, and told above.
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

    /// Leaves what is in the half-space.
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

    /// The first and the last cell of a row that are met, of those from `first` to `last`.
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
        // Not `max` and `min`, which look for NaN: these are one instruction each.
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
    /// That of all cells that have a point, or have one within `pad`, on the side of `point` to which `normal` points.
    fn reaching(normal: DVec3, point: DVec3, pad: DVec3) -> Self {
        // The corner of a cell that lies furthest along the normal, from its lowest one.
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

/// Whether there is something to be left out: several cells in two directions, and enough of them that the test takes less
/// than what it saves.
#[inline]
pub(crate) fn is_worth_a_test(range: &CellRange) -> bool {
    let directions = (0..3).filter(|&axis| range.first[axis] < range.last[axis]);
    range.count() >= SMALL_BOX as u64 && directions.count() >= 2
}

/// Calls `enter` with the number of each cell of a range that the triangle meets: row by row, along the axis of the longest
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
