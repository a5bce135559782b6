//! Which cells a triangle meets.
//!
//! After M. Schwarz and H.-P. Seidel, *Fast Parallel Surface and Solid Voxelization on GPUs*, 2010: a box meets a triangle if
//! it meets its plane and, seen along each axis, is on the inner side of each edge. Each of these is a half-space for the
//! lowest corner of the box, so that a row of cells is asked at once: each half-space cuts off one end of it.

use glam::{DVec3, Vec3};

use crate::lattice::{CellRange, Lattice};

/// Two sides of the plane, three edges seen along each of three axes.
const HALF_SPACES: usize = 11;

/// Normals below this fraction of the squared length of edges are not used: with f64 they may point anywhere.
///
/// Coordinates err by 2⁻⁵² of the number of cells r along the longest axis, so with edges of length L (in cells) a half-space
/// of a normal n is off by some 2⁻⁵² r L² at a point of the triangle; cells are enlarged by [`PAD`](crate::lattice::PAD) r,
/// which moves it by |n| 2⁻²⁰ r. With |n| ≥ 2⁻²⁸ L² that is sixteen times as much.
const LEAST_NORMAL: f64 = 1.0 / (1 << 28) as f64;

/// A triangle in cells, ready to be asked which of them it meets.
#[derive(Clone, Debug)]
pub(crate) struct CellTest {
    /// Half-spaces `a · cell + c >= 0`, `cell` being whole numbers.
    half_spaces: [HalfSpace; HALF_SPACES],
}

#[derive(Clone, Copy, Debug, Default)]
struct HalfSpace {
    a: [f64; 3],
    c: f64,
}

impl CellTest {
    pub(crate) fn new(lattice: &Lattice, corners: [Vec3; 3]) -> Self {
        let corners = corners.map(|corner| DVec3::from_array(lattice.coordinates(corner)));
        let edges = [0, 1, 2].map(|i| corners[(i + 1) % 3] - corners[i]);
        let normal = edges[0].cross(edges[1]);
        let least: f64 = LEAST_NORMAL * edges.iter().map(|edge| edge.length_squared()).sum::<f64>();
        let pad = DVec3::from_array(lattice.pad());
        let mut half_spaces = [HalfSpace::default(); HALF_SPACES];
        let (planes, sides) = half_spaces.split_at_mut(2);
        if normal.abs().max_element() > least {
            planes[0] = HalfSpace::reaching(normal, corners[0], pad);
            planes[1] = HalfSpace::reaching(-normal, corners[0], pad);
        }
        for (axis, sides) in sides.chunks_mut(3).enumerate() {
            // Seen along an axis, a triangle may be no more than a line: then its plane is seen edge-on, and told above.
            if normal[axis].abs() <= least {
                continue;
            }
            let along = DVec3::AXES[axis] * normal[axis].signum();
            for ((side, edge), corner) in sides.iter_mut().zip(edges).zip(corners) {
                *side = HalfSpace::reaching(along.cross(edge), corner, pad);
            }
        }
        Self { half_spaces }
    }

    /// The first and the last cell that is met in a row along `axis` within `range`; `place` tells the row.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within a range of cells, or no cell at all"
    )]
    fn row(&self, place: [u32; 3], axis: usize, range: &CellRange) -> Option<[u32; 2]> {
        let mut at = place.map(f64::from);
        at[axis] = 0.0;
        let (mut first, mut last) = (f64::from(range.first[axis]), f64::from(range.last[axis]));
        for HalfSpace { a, c } in &self.half_spaces {
            let value = a[0] * at[0] + a[1] * at[1] + a[2] * at[2] + c;
            let end = -value / a[axis];
            if a[axis] > 0.0 {
                first = first.max(end.ceil());
            } else if a[axis] < 0.0 {
                last = last.min(end.floor());
            } else if value < 0.0 {
                return None;
            }
        }
        (first <= last).then_some([first as u32, last as u32])
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
pub(crate) fn for_each_cell(lattice: &Lattice, range: &CellRange, enter: impl FnMut(usize)) {
    let counts = [0, 1, 2].map(|axis| (range.last[axis] - range.first[axis]) as usize + 1);
    let strides = lattice.strides.map(|stride| stride as usize);
    each_of_box(lattice.number(range.first), counts, strides, enter);
}

/// Calls `enter` with the number of each cell of a box, of which there are so many along each axis.
#[inline(always)]
pub(crate) fn each_of_box(
    first: usize,
    counts: [usize; 3],
    strides: [usize; 3],
    mut enter: impl FnMut(usize),
) {
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                enter(first + i * strides[0] + j * strides[1] + k * strides[2]);
            }
        }
    }
}

/// Whether there is something to be left out: several cells in two directions, and enough of them that the test takes less
/// than what it saves.
#[inline]
pub(crate) fn is_worth_a_test(range: &CellRange) -> bool {
    const MANY: u64 = 16;
    let directions = (0..3).filter(|&axis| range.first[axis] < range.last[axis]);
    range.count() >= MANY && directions.count() >= 2
}

/// Calls `enter` with the number of each cell of a range that the triangle meets: row by row, along the axis of the longest
/// rows.
pub(crate) fn for_each_cell_met(
    lattice: &Lattice,
    range: &CellRange,
    corners: [Vec3; 3],
    mut enter: impl FnMut(usize),
) {
    let test = CellTest::new(lattice, corners);
    let length = |axis: usize| range.last[axis] - range.first[axis];
    let along = (0..3).max_by_key(|axis| length(*axis)).unwrap_or(0);
    let (u, w) = ((along + 1) % 3, (along + 2) % 3);
    let stride = lattice.strides[along] as usize;
    let mut place = range.first;
    for at_w in range.first[w]..=range.last[w] {
        place[w] = at_w;
        for at_u in range.first[u]..=range.last[u] {
            place[u] = at_u;
            if let Some([first, last]) = test.row(place, along, range) {
                place[along] = first;
                let number = lattice.number(place);
                for i in 0..=(last - first) as usize {
                    enter(number + i * stride);
                }
            }
        }
    }
}
