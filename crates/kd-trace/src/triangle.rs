//! The triangle test: f32 rejects, f64 decides ([`decision`](crate::decision)).
//!
//! After Woop, Benthin and Wald, *Watertight Ray/Triangle Intersection*, JCGT 2(1), 2013: corners are moved to the
//! ray's origin and sheared so that the ray runs along an axis; it then meets the triangle if the origin of the plane
//! across is on the same side of all three edges. Differences:
//!
//! - Sheared corners are computed in f64 and rounded to 26 bits. A corner has one value per ray, for all triangles around it,
//!   and the products in an edge function of such values are exact in f64 (26 + 26 ≤ 53). So their difference
//!   has the right sign, and `edge(a, b) == -edge(b, a)`: two triangles always agree about the edge that they share,
//!   and a zero needs no second computation in higher precision.
//! - Both windings count, so the shear need not keep the winding.
//! - Most triangles are rejected before, by the same computation in f32 and a bound of its error.
//!
//! Deciding in f32 as well was tried (2026-11-25, fourteen meshes): camera rays were 1.15 times as fast, random rays 1.1
//! times. But hits then err by some units in the last place of the *distance to the far end of the box*, boxes must be
//! widened by as much, and rays that leave a surface enter its box again: shadow rays were 0.7 times as fast, 0.25 times over
//! large ground planes.

use std::ops::ControlFlow;

use glam::Vec3;
use kd_core::{Axis, Culling, Hit, Mesh, Ray, is_zero_area};
use kd_simd::{LANES, Three, Triple as _, each, max, min};
use kd_wide::{Block, LaneCorners};

use crate::collect::Collect;
use crate::decision::View;
use crate::probe::Probe;

/// Half a unit in the last place of 1, the relative error of rounding to f32.
const U: f32 = f32::EPSILON / 2.0;

/// 80 u and 8 u: see [`TriangleTest::certainly_misses`].
pub(crate) const SLOPE: f32 = 80.0 * U;
pub(crate) const BLUR: f32 = 8.0 * U;
/// Sheared coordinates are below 2.01 R, so up to here no product in f32 overflows.
const MOST_REACH: f32 = (1_u64 << 62) as f32;

/// A ray, prepared for triangles: the early rejection, and the one function that decides what is a hit.
///
/// All structures that use it get the same hits, to the bit. The page of the crate defines them.
#[derive(Clone, Copy, Debug)]
pub struct TriangleTest {
    origin: [f32; 3],
    /// The axis along which the ray moves most.
    along: Axis,
    /// The other axes.
    across_x: Axis,
    across_y: Axis,
    view: View<f64>,
    t_min: f32,
    t_max: f32,
    culling: Culling,
    filter: Filter,
}

/// The f32 rejection. See [`TriangleTest::certainly_misses`].
#[derive(Clone, Copy, Debug)]
struct Filter {
    shear_x: f32,
    shear_y: f32,
    /// 80 u R; infinite where f32 could overflow.
    slope: f32,
    /// 8 u R.
    blur: f32,
}

/// A set of lanes of a block, iterated in order. A byte for each lane, 0 or 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes(u64);

impl Lanes {
    /// The lanes of the set among the first `count`, which is at least 1 and may exceed 8.
    #[inline(always)]
    fn first(self, count: usize) -> Self {
        let absent = LANES - count.min(LANES);
        Self(self.0 & (u64::MAX >> (8 * absent)))
    }
}

impl Iterator for Lanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize / 8;
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

/// The axis of the largest component of a direction; the first among equals.
#[inline(always)]
pub(crate) fn steepest_axis(direction: Vec3) -> Axis {
    let size = direction.abs();
    if size.x >= size.y && size.x >= size.z {
        Axis::X
    } else if size.y >= size.z {
        Axis::Y
    } else {
        Axis::Z
    }
}

impl TriangleTest {
    /// `reach` is at least the largest component of `corner - origin` over all corners that are passed to
    /// [`certainly_misses`](Self::certainly_misses), up to a few roundings. With an infinite one nothing certainly misses. The ray
    /// must be one that [can hit](Ray::can_hit).
    #[allow(
        clippy::cast_possible_truncation,
        reason = "the filter allows for the rounding of its shear"
    )]
    #[inline(always)]
    pub fn new(ray: &Ray, reach: f32) -> Self {
        let along = steepest_axis(ray.direction);
        let (across_x, across_y) = (along.next(), along.next().next());
        let component = |axis: Axis| f64::from(ray.direction[axis.index()]);
        let numerators = [component(across_x), component(across_y), 1.0, 1.0];
        let mut quotients = [0.0; 4];
        for (quotient, numerator) in quotients.iter_mut().zip(numerators) {
            *quotient = numerator / component(along);
        }
        let [shear_x, shear_y, scale, _] = quotients;
        let reach = if reach <= MOST_REACH {
            reach
        } else {
            f32::INFINITY
        };
        Self {
            origin: ray.origin.to_array(),
            along,
            across_x,
            across_y,
            view: View {
                shear: [shear_x, shear_y],
                scale,
            },
            t_min: ray.t_min,
            t_max: ray.t_max,
            culling: ray.culling,
            filter: Filter {
                shear_x: shear_x as f32,
                shear_y: shear_y as f32,
                slope: SLOPE * reach,
                blur: BLUR * reach,
            },
        }
    }

    /// Whether [`decide`](Self::decide) surely finds no hit, by a cheaper computation.
    ///
    /// Proof. Let u = 2⁻²⁴, R the reach, M the largest sheared coordinate as computed here. Moving a corner
    /// to the origin errs by uR; the shear (at most 1) by u, its product with a coordinate by uR (the coordinate's
    /// error) + uR (the shear's) + uR (rounding); the final difference is at most 2R and errs by 2uR: 6uR in all. The
    /// coordinates that `decide` uses are rounded too, by less than 2uR. So the two differ by at most e = 8uR and a
    /// little, and M ≤ 2R and a little.
    ///
    /// An edge function is the difference of two products. Rounding them and their difference costs 4uM²; moving
    /// each factor by e costs 4eM + 2e². Together
    /// 4uM² + 4eM + 2e² ≤ 8uRM + 32uRM + 128u²R², while we allow 80uR (M + 8uR), twice that and more, for all
    /// terms of higher order and for rounding the bound itself. Underflow adds less than the smallest normal number;
    /// where anything could overflow, the bound is infinite. So where an edge function here is beyond the bound, its
    /// counterpart in `decide` has the same sign and is not zero; with one on each side, it is a miss.
    #[inline]
    pub fn certainly_misses(&self, corners: [Vec3; 3]) -> bool {
        let axes = self.axes();
        self.filter.rejects(each(corners, |corner| {
            let corner = corner.to_array();
            each(axes, |axis| {
                corner[axis.index()] - self.origin[axis.index()]
            })
        }))
    }

    /// The lanes of a block that [`certainly_misses`](Self::certainly_misses) does not reject, among the first `triangles`, which may
    /// exceed 8.
    ///
    /// Eight equal computations, which the compiler turns into vector instructions.
    #[inline(always)]
    pub(crate) fn may_hit(&self, corners: &LaneCorners, triangles: usize) -> Lanes {
        let axes = self.axes();
        let [a, b, c] = corners;
        let rows = each([a, b, c], |rows| each(axes, |axis| &rows[axis.index()]));
        let origin = each(axes, |axis| self.origin[axis.index()]);
        let mut is_left = [0_u8; LANES];
        for (lane, is_left) in is_left.iter_mut().enumerate() {
            let corners = each(rows, |[x, y, z]| {
                [
                    x[lane] - origin[0],
                    y[lane] - origin[1],
                    z[lane] - origin[2],
                ]
            });
            *is_left = u8::from(!self.filter.rejects(corners));
        }
        Lanes(u64::from_le_bytes(is_left)).first(triangles)
    }

    /// Across, across, along.
    #[inline(always)]
    fn axes(&self) -> [Axis; 3] {
        [self.across_x, self.across_y, self.along]
    }

    /// The hit within the ray's range, on a side that the ray sees, or `None`. A pure function of the ray and the corners; `triangle` is the slot that is
    /// reported.
    #[inline(always)]
    pub fn decide(&self, corners: [Vec3; 3], triangle: u32) -> Option<Hit> {
        let from_origin = self.corners_from_origin(corners);
        let range = [self.t_min, self.t_max];
        self.view.hit(from_origin, range, self.culling, triangle)
    }

    /// Where the ray sees the corners of a triangle, across, by the numbers that [`decide`](Self::decide): the ray is at zero, and a corner
    /// is at the same place for all triangles around it. The ray passes an edge exactly where the cross product of its ends is zero; the
    /// products in it are exact.
    #[inline]
    pub fn places(&self, corners: [Vec3; 3]) -> [[f64; 2]; 3] {
        let sight = self.view.sight(self.corners_from_origin(corners));
        let [Three(x), Three(y)] = sight.deciding_places();
        [0, 1, 2].map(|corner| [x[corner], y[corner]])
    }

    /// Corners from the origin of the ray: across, across and along.
    #[inline(always)]
    fn corners_from_origin(&self, corners: [Vec3; 3]) -> [Three<f64>; 3] {
        let [a, b, c] = each(corners, |corner| corner.to_array());
        each(self.axes(), |axis| {
            let axis = axis.index();
            let corners = Three([a[axis].into(), b[axis].into(), c[axis].into()]);
            corners.minus(f64::from(self.origin[axis]))
        })
    }

    /// [`decide`](Self::decide) for any triangle. Rounding may call a triangle of zero area hit, which never is.
    #[inline]
    pub(crate) fn hit(&self, corners: [Vec3; 3], triangle: u32) -> Option<Hit> {
        let hit = self.decide(corners, triangle);
        hit.filter(|_| !is_zero_area(corners))
    }

    /// Tests a triangle of a mesh, and passes a hit to the collector. Breaks if the collector does.
    ///
    /// # Panics
    ///
    /// If the mesh lacks the triangle.
    #[inline]
    pub fn ask<C: Collect>(
        &self,
        mesh: &Mesh,
        triangle: u32,
        collector: &mut C,
    ) -> ControlFlow<()> {
        let corners = mesh.corners(triangle);
        if self.certainly_misses(corners) {
            return ControlFlow::Continue(());
        }
        self.hit(corners, triangle)
            .map_or(ControlFlow::Continue(()), |hit| collector.take(hit))
    }

    /// Tests blocks of triangles, and passes every hit to the collector. Breaks if the collector does.
    #[inline(always)]
    pub(crate) fn visit<C: Collect, P: Probe>(
        &self,
        blocks: &[Block],
        collector: &mut C,
        probe: &mut P,
    ) -> ControlFlow<()> {
        for block in blocks {
            probe.block();
            for lane in self.may_hit(&block.corners, block.count() as usize) {
                probe.decision();
                let hit = self.decide(block.corners_of(lane), block.triangles[lane]);
                if let Some(hit) = hit {
                    collector.take(hit)?;
                }
            }
        }
        ControlFlow::Continue(())
    }
}

impl Filter {
    /// Whether the ray surely misses a triangle, given by its corners from the ray's origin: across, across and along.
    ///
    /// Without branches, so that the compiler can vectorise it.
    #[inline(always)]
    fn rejects(&self, corners: [[f32; 3]; 3]) -> bool {
        let [a, b, c] = each(corners, |[x, y, z]| {
            [x - self.shear_x * z, y - self.shear_y * z]
        });
        let edge = |p: [f32; 2], q: [f32; 2]| p[0] * q[1] - p[1] * q[0];
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        let size = |p: [f32; 2]| max(p[0].abs(), p[1].abs());
        let largest = max(max(size(a), size(b)), size(c));
        let bound = self.slope * (largest + self.blur) + f32::MIN_POSITIVE;
        (min(min(u, v), w) < -bound) & (max(max(u, v), w) > bound)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_oracle::effort;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn places_tell_which_edges_a_ray_passes() {
        let corners = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 4.0, 3.0]].map(Vec3::from_array);
        let places = |origin: [f32; 3], direction: [f32; 3]| {
            let ray = Ray::new(origin, direction);
            TriangleTest::new(&ray, f32::INFINITY).places(corners)
        };
        let passes = |origin| {
            let [a, b, c] = places(origin, [0.5, 0.25, 1.0]);
            [(b, c), (c, a), (a, b)].map(|(p, q)| p[0] * q[1] - p[1] * q[0] == 0.0)
        };
        assert_eq!(passes([-0.25, 0.25, -1.0]), [false; 3], "inside");
        assert_eq!(
            passes([1.0, -0.25, 0.0]),
            [false, false, true],
            "on an edge"
        );
        assert_eq!(
            passes([-0.5, -0.25, 0.0]),
            [false, true, true],
            "through a corner"
        );
        let beside = places([-0.5, -0.25, 0.0], [0.5, 0.25, 1.0]);
        assert_eq!(beside[0], [0.0, 0.0], "the corner is where the ray is");
    }

    /// A point in [-1, 1]³, on a lattice or not.
    fn point() -> impl Strategy<Value = Vec3> {
        let one =
            || prop_oneof![3 => -1.0_f32..1.0, 1 => (-2_i8..=2).prop_map(|x| 0.5 * f32::from(x))];
        [one(), one(), one()].prop_map(Vec3::from_array)
    }

    /// A triangle of any size and shape, thin ones included, with a point on it or very near.
    fn triangle_and_target() -> impl Strategy<Value = ([Vec3; 3], Vec3)> {
        let size = prop_oneof![Just(1.0_f32), Just(1e-2), Just(1e-4), Just(1e-6)];
        let weight = || prop_oneof![2 => 0.0_f32..1.0, 1 => Just(0.0), 1 => -1e-6_f32..1e-6];
        (
            [point(), point(), point(), point()],
            size,
            0_u8..4,
            weight(),
            weight(),
        )
            .prop_map(|([center, a, b, c], size, shape, u, v)| {
                let c = match shape {
                    0 => a.lerp(b, c.x),
                    1 => a.lerp(b, c.x) + 1e-6 * c,
                    _ => c,
                };
                let [a, b, c] = [a, b, c].map(|p| center + size * p);
                ([a, b, c], a + (b - a) * u + (c - a) * v)
            })
    }

    fn scale() -> impl Strategy<Value = f32> {
        prop::sample::select(vec![
            1.0_f32, 1.0, 1.0, 1e3, 1e-3, 1e9, 1e15, 3e18, 6e18, 1e20, 1e30, 1e37, 1e-12, 1e-18,
            1e-20, 1e-30, 1e-38,
        ])
    }

    fn reach(ray: &Ray, corners: [Vec3; 3]) -> f32 {
        corners
            .iter()
            .map(|&p| (p - ray.origin).abs().max_element())
            .fold(0.0, f32::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(effort::cases(6_000, 40_000)))]

        /// The filter rejects no hit, at any scale. The reach is the least possible one.
        #[test]
        fn the_filter_is_conservative(
            (corners, target) in triangle_and_target(),
            origin in point(),
            along in prop_oneof![Just(1.0_f32), Just(1e-3), Just(1e4), Just(-1e-30)],
            distance in prop_oneof![Just(1.0_f32), Just(1e2), Just(1e5)],
            scale in scale(),
        ) {
            let direction = (target - distance * origin) * along;
            let ray = Ray::new(distance * origin * scale, direction).with_range(f32::NEG_INFINITY, f32::INFINITY);
            let corners = corners.map(|p| p * scale);
            if !(ray.can_hit() && corners.iter().all(|p| p.is_finite())) {
                return Ok(());
            }
            let test = TriangleTest::new(&ray, reach(&ray, corners));
            if test.decide(corners, 0).is_some() {
                prop_assert!(!test.certainly_misses(corners), "{ray:?} {corners:?}");
            }
        }

        /// Eight lanes reject the same triangles as one, among other triangles and padding.
        #[test]
        fn lanes_reject_what_one_rejects(
            triangles in prop::collection::vec(triangle_and_target(), 1..=LANES),
            aim in 0_usize..LANES,
            origin in point(),
            scale in scale(),
        ) {
            let target = triangles[aim % triangles.len()].1;
            let ray = Ray::new(origin * scale, target - origin);
            let triangles: Vec<[Vec3; 3]> = triangles.iter().map(|(c, _)| c.map(|p| p * scale)).collect();
            if !(ray.can_hit() && triangles.iter().flatten().all(|p| p.is_finite())) {
                return Ok(());
            }
            let mut lanes = [[[f32::NAN; LANES]; 3]; 3];
            for (lane, corners) in triangles.iter().enumerate() {
                for (rows, corner) in lanes.iter_mut().zip(corners) {
                    for (axis, row) in rows.iter_mut().enumerate() {
                        row[lane] = corner[axis];
                    }
                }
            }
            let reach = triangles.iter().map(|corners| reach(&ray, *corners)).fold(0.0, f32::max);
            let test = TriangleTest::new(&ray, reach);
            let left: Vec<usize> = test.may_hit(&lanes, triangles.len()).collect();
            let one_by_one = (0..triangles.len()).filter(|i| !test.certainly_misses(triangles[*i]));
            prop_assert_eq!(&left, &one_by_one.collect::<Vec<_>>());
            for (lane, corners) in triangles.iter().enumerate() {
                prop_assert!(left.contains(&lane) || test.decide(*corners, 0).is_none(), "{ray:?} {corners:?}");
            }
            prop_assert!(test.decide([Vec3::NAN; 3], 0).is_none(), "padding");
        }

        /// A corner has one value and an edge one sign, so winding and order do not matter.
        #[test]
        fn the_order_of_corners_does_not_decide(
            ([a, b, c], target) in triangle_and_target(),
            origin in point(),
        ) {
            let ray = Ray::new(origin, target - origin).with_range(f32::NEG_INFINITY, f32::INFINITY);
            prop_assume!(ray.can_hit());
            let test = TriangleTest::new(&ray, f32::INFINITY);
            let is_hit = test.decide([a, b, c], 0).is_some();
            for other in [[b, c, a], [c, a, b], [a, c, b], [c, b, a], [b, a, c]] {
                prop_assert_eq!(test.decide(other, 0).is_some(), is_hit);
            }
        }
    }
}
