//! The traversal of a ray through the cells of a grid.
//!
//! Each step crosses the nearest next border (A. Fujimoto, T. Tanaka and K. Iwata, *ARTS: Accelerated Ray-Tracing System*, 1986;
//! in the form of J. Amanatides and A. Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*, 1987).
//!
//! # No hit is lost
//!
//! Let W be the longest side of the grid, R the largest component of (a point of the grid − origin). A reported hit represents a
//! point P of its triangle within 2⁻²⁵ W + 2⁻⁴⁹ R of the ray, at a `t` that is rounded to f32 (see
//! [`RayPlanes`](kd_trace::kit::RayPlanes)). A walk begins at the point where the ray enters the grid, or at its `t_min`, computed
//! in f64 with an error of about 2⁻⁵² R, and measures distances from there. Along each axis it computes the distance of the next
//! border by adding the same step up to 2¹⁶ times, with a position error of up to 2⁻³⁵ W. The order of crossings of different axes
//! may be wrong by that error, but each axis alone is right: the ray is always within that distance of the cell of the walk.
//!
//! Triangles are entered in all cells within 2⁻²⁰ W of their boxes. With R ≤ 2²⁶ W all of the errors add up to less than 2⁻²² W.
//! From further away, every triangle is tested.
//!
//! At the faces of the grid, P may be inside where the ray is outside, so the walk follows the ray through the box enlarged by
//! 2⁻²⁰ W. Along a ray that is nearly in a face, a position error of 2⁻³⁵ W may be any distance in `t`: where the ray seems to
//! leave the grid, the walk stays in the last layer until the ray has left the enlarged box.

use std::ops::ControlFlow;

use kd_core::{Mesh, Ray};
use kd_trace::kit::{Collect, TriangleTest};

use crate::grid::UniformGrid;
use crate::lattice::PAD;
use crate::mailbox::Mailbox;

/// Rays from more than this number of longest sides away are tested against every triangle.
const MOST_SIDES: f64 = (1_u64 << 26) as f64;
/// Relative to `t`: more than the error of rounding to f32.
const ROUNDING: f64 = 1.0 / (1 << 22) as f64;

/// Passes every hit of the ray that the collector may want to it, cell by cell, some of them more than once.
pub(crate) fn walk<C: Collect>(
    grid: &UniformGrid,
    ray: &Ray,
    collector: &mut C,
) -> ControlFlow<()> {
    if grid.refs().is_empty() || !ray.can_hit() {
        return ControlFlow::Continue(());
    }
    let mesh: &Mesh = grid.mesh();
    let bounds = &grid.lattice().bounds;
    let far = (bounds.min - ray.origin)
        .abs()
        .max((bounds.max - ray.origin).abs());
    let reach = far.max_element();
    let test = TriangleTest::new(ray, reach);
    let side = (bounds.max.as_dvec3() - bounds.min.as_dvec3()).max_element();
    if f64::from(reach) > MOST_SIDES * side {
        let all = 0..grid.triangles();
        return all
            .into_iter()
            .try_for_each(|triangle| test.ask(mesh, triangle, collector));
    }
    let Some(mut way) = Way::new(grid, ray, PAD * side) else {
        return ControlFlow::Continue(());
    };
    let mut mailbox = Mailbox::new();
    loop {
        let refs = grid.cell(way.cell);
        if !refs.is_empty() {
            for &triangle in refs {
                if mailbox.is_new(triangle) {
                    test.ask(mesh, triangle, collector)?;
                }
            }
            way.end_at(collector.limit());
        }
        if !way.step() {
            return ControlFlow::Continue(());
        }
    }
}

/// A little after `t`: no number that rounds to `t` or less is later.
fn later(t: f32) -> f64 {
    let t = f64::from(t);
    t + t.abs() * ROUNDING + f64::from(f32::MIN_POSITIVE)
}

/// The state of a walk. Distances are differences of `t` from its begin.
struct Way {
    /// The `t` of the begin.
    begin: f64,
    cell: usize,
    /// Distance of the next border of each axis; infinite if there is none.
    next: [f64; 3],
    /// Distance from border to border.
    step: [f64; 3],
    /// Difference of cell numbers from a cell to the next; negative ones wrap around.
    stride: [usize; 3],
    /// Number of further cells along each axis.
    left: [u32; 3],
    /// Distance of the point where the ray leaves the grid or ends.
    end: f64,
}

impl Way {
    /// `None` if the ray passes the grid at more than `pad`.
    fn new(grid: &UniformGrid, ray: &Ray, pad: f64) -> Option<Self> {
        let lattice = grid.lattice();
        let (min, max) = (lattice.bounds.min.as_dvec3(), lattice.bounds.max.as_dvec3());
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let mut begin = -later(-ray.t_min);
        let mut end = later(ray.t_max);
        for axis in 0..3 {
            let (lowest, highest) = (min[axis] - pad, max[axis] + pad);
            if direction[axis] == 0.0 {
                if !(lowest..=highest).contains(&origin[axis]) {
                    return None;
                }
                continue;
            }
            let faces = [lowest, highest].map(|face| (face - origin[axis]) / direction[axis]);
            begin = begin.max(faces[0].min(faces[1]));
            end = end.min(faces[0].max(faces[1]));
        }
        if begin > end {
            return None;
        }
        let entry = origin + begin * direction;
        let mut way = Self {
            begin,
            cell: 0,
            next: [f64::INFINITY; 3],
            step: [0.0; 3],
            stride: [0; 3],
            left: [0; 3],
            end: end - begin,
        };
        for axis in 0..3 {
            let resolution = lattice.resolution[axis];
            if resolution == 1 {
                continue;
            }
            let per_unit = lattice.per_unit[axis];
            let coordinate = (entry[axis] - min[axis]) * per_unit;
            let place = lattice.place(axis, coordinate);
            let stride = lattice.strides[axis] as usize;
            way.cell += place as usize * stride;
            if direction[axis] == 0.0 {
                continue;
            }
            let is_upwards = direction[axis] > 0.0;
            let border = if is_upwards { place + 1 } else { place };
            let inverse = (direction[axis] * per_unit).recip();
            way.next[axis] = (f64::from(border) - coordinate) * inverse;
            way.step[axis] = inverse.abs();
            (way.left[axis], way.stride[axis]) = if is_upwards {
                (resolution - 1 - place, stride)
            } else {
                (place, stride.wrapping_neg())
            };
        }
        Some(way)
    }

    /// Hits beyond `t` are not wanted any more.
    #[inline(always)]
    fn end_at(&mut self, t: f32) {
        self.end = self.end.min(later(t) - self.begin);
    }

    /// Steps to the next cell; false if the walk ends before it.
    #[inline(always)]
    fn step(&mut self) -> bool {
        loop {
            let [x, y, z] = self.next;
            let axis = if x <= y && x <= z {
                0
            } else if y <= z {
                1
            } else {
                2
            };
            if self.next[axis] > self.end {
                return false;
            }
            if self.left[axis] > 0 {
                self.left[axis] -= 1;
                self.next[axis] += self.step[axis];
                self.cell = self.cell.wrapping_add(self.stride[axis]);
                return true;
            }
            // The ray leaves the grid up to rounding errors: the walk stays in the last layer.
            self.next[axis] = f64::INFINITY;
        }
    }
}
