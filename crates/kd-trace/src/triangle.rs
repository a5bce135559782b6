//! Whether a ray meets a triangle: f32 rejects, f64 decides.
//!
//! After Woop, Benthin and Wald, *Watertight Ray/Triangle Intersection*, JCGT 2(1), 2013: corners are moved to the
//! ray's origin and sheared so that the ray runs along an axis; it then meets the triangle if the origin of the plane
//! across lies on the same side of all three edges. Where we differ:
//!
//! - Sheared corners are computed in f64 and rounded to 26 bits. A corner gets one value per ray, whichever triangle
//!   asks, and the products in an edge function of such values are exact in f64 (26 + 26 ≤ 53), so their difference
//!   has the right sign, and `edge(a, b) == -edge(b, a)`. So two triangles never disagree about the edge they share,
//!   and zero needs no second look in higher precision.
//! - Both windings count, so the shear need not keep the winding either.
//! - Most triangles are rejected before, by the same computation in f32 and a bound of its error.
//!
//! Deciding in f32 as well was tried (2026-11-25, fourteen meshes): camera rays were 1.15 times as fast, random rays 1.1
//! times. But hits are then off by some units in the last place of the *distance to the far end of the box*, boxes must be
//! widened by as much, and rays that leave a surface enter its box again: shadow rays were 0.7 times as fast, 0.25 times over
//! large ground planes.
//!
//! Nothing here may be contracted to a fused multiply-add: it would break the antisymmetry of edge functions. (Rust
//! never does so by itself.)

use std::ops::ControlFlow;

use glam::Vec3;
use kd_core::{Axis, Hit, Mesh, Ray};
use kd_simd::{LANES, max, min};
use kd_wide::LaneCorners;

use crate::collect::Collect;

/// Half a unit in the last place of 1, the relative error of rounding to f32.
const U: f32 = f32::EPSILON / 2.0;

/// 80 u and 8 u: see [`TriangleTest::certainly_misses`].
pub(crate) const SLOPE: f32 = 80.0 * U;
pub(crate) const BLUR: f32 = 8.0 * U;
/// Sheared coordinates are below 2.01 R, so up to here no product in f32 overflows.
pub(crate) const MOST_REACH: f32 = (1_u64 << 62) as f32;
/// See [`finer_weights`].
pub(crate) const LEAST_SHARE: f64 = 1.0 / (1 << 24) as f64;

/// A ray, ready to be asked about triangles: the one function that decides what is a hit.
///
/// Whatever asks it about the same triangles gets the same hits, to the bit. The crate's page tells what they are.
#[derive(Clone, Copy, Debug)]
pub struct TriangleTest {
    origin: [f32; 3],
    /// The axis along which the ray moves most.
    along: Axis,
    /// The others.
    across_x: Axis,
    across_y: Axis,
    /// Steps across per step along, and `t` per step along.
    shear_x: f64,
    shear_y: f64,
    scale: f64,
    t_min: f32,
    t_max: f32,
    filter: Filter,
}

/// What the f32 rejection needs. See [`TriangleTest::certainly_misses`].
#[derive(Clone, Copy, Debug)]
struct Filter {
    shear_x: f32,
    shear_y: f32,
    /// 80 u R, infinite where f32 could overflow.
    slope: f32,
    /// 8 u R.
    blur: f32,
}

/// Some of the lanes of a block, in order. A byte for each lane, 0 or 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes(u64);

impl Lanes {
    /// Those among the first `count` lanes, which is at least 1 and may be more than there are.
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

/// The axis along which a direction goes most; the first among equals.
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

/// A corner as the ray sees it: across, and along in units of `t`.
#[derive(Clone, Copy, Debug)]
struct Sheared {
    x: f64,
    y: f64,
    t: f64,
}

impl Sheared {
    /// The same with the coordinates across rounded to 26 bits.
    #[inline(always)]
    fn rounded(self) -> Self {
        Self {
            x: to_26_bits(self.x),
            y: to_26_bits(self.y),
            ..self
        }
    }
}

impl TriangleTest {
    /// `reach` is at least the largest component of `corner - origin` over all corners that
    /// [`certainly_misses`](Self::certainly_misses) will be asked about, up to a few roundings; with an infinite one nothing
    /// certainly misses. The ray must be one that [can hit](Ray::can_hit).
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
            shear_x,
            shear_y,
            scale,
            t_min: ray.t_min,
            t_max: ray.t_max,
            filter: Filter {
                shear_x: shear_x as f32,
                shear_y: shear_y as f32,
                slope: SLOPE * reach,
                blur: BLUR * reach,
            },
        }
    }

    /// Whether [`decide`](Self::decide) would surely find no hit, from a cheaper look.
    ///
    /// Why it is sure. Let u = 2⁻²⁴, R the reach, M the largest sheared coordinate as computed here. Moving a corner
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
        self.filter.rejects(corners.map(|corner| {
            let corner = corner.to_array();
            axes.map(|axis| corner[axis.index()] - self.origin[axis.index()])
        }))
    }

    /// The lanes of a block that hold a triangle, of which there are `triangles` or more than a block holds, and that
    /// [`certainly_misses`](Self::certainly_misses) would not reject.
    ///
    /// Eight equal computations side by side, which the compiler turns into vector instructions.
    #[inline(always)]
    pub(crate) fn may_hit(&self, corners: &LaneCorners, triangles: usize) -> Lanes {
        let axes = self.axes();
        let rows = corners
            .each_ref()
            .map(|c| axes.map(|axis| &c[axis.index()]));
        let origin = axes.map(|axis| self.origin[axis.index()]);
        let mut is_left = [0_u8; LANES];
        for (lane, is_left) in is_left.iter_mut().enumerate() {
            let corners = rows.map(|[x, y, z]| {
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

    /// The hit, if there is one within the ray's range. A pure function of the ray and the corners; `triangle` is what the hit
    /// will be called.
    #[inline(always)]
    pub fn decide(&self, corners: [Vec3; 3], triangle: u32) -> Option<Hit> {
        let exact = corners.map(|corner| self.shear(corner));
        let rounded = exact.map(Sheared::rounded);
        let weights = Weights::of(rounded);
        if !weights.are_inside() {
            return None;
        }
        let weights = finer_weights(exact).unwrap_or(weights);
        let [a, b, c] = exact;
        let t = (weights.a * a.t + weights.b * b.t + weights.c * c.t) / weights.sum();
        // Adding zero turns -0.0 into 0.0.
        #[allow(clippy::cast_possible_truncation, reason = "a hit has f32 values")]
        let hit = Hit {
            t: t as f32 + 0.0,
            u: (weights.b / weights.sum()) as f32 + 0.0,
            v: (weights.c / weights.sum()) as f32 + 0.0,
            triangle,
        };
        (hit.t.is_finite() && self.t_min <= hit.t && hit.t <= self.t_max).then_some(hit)
    }

    /// Gives the collector the hit of a triangle of a mesh, if there is one; breaks if it does.
    ///
    /// # Panics
    ///
    /// If the mesh has no such triangle.
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
        self.decide(corners, triangle)
            .map_or(ControlFlow::Continue(()), |hit| collector.take(hit))
    }

    #[inline(always)]
    fn shear(&self, corner: Vec3) -> Sheared {
        let corner = corner.to_array();
        let from_origin =
            |axis: Axis| f64::from(corner[axis.index()]) - f64::from(self.origin[axis.index()]);
        let z = from_origin(self.along);
        Sheared {
            x: from_origin(self.across_x) - self.shear_x * z,
            y: from_origin(self.across_y) - self.shear_y * z,
            t: self.scale * z,
        }
    }
}

impl Filter {
    /// Whether a triangle is surely missed; its corners are given from the ray's origin, across, across and along.
    ///
    /// Without branches, so that lanes can run side by side.
    #[inline(always)]
    fn rejects(&self, corners: [[f32; 3]; 3]) -> bool {
        let [a, b, c] = corners.map(|[x, y, z]| [x - self.shear_x * z, y - self.shear_y * z]);
        let edge = |p: [f32; 2], q: [f32; 2]| p[0] * q[1] - p[1] * q[0];
        let (u, v, w) = (edge(c, b), edge(a, c), edge(b, a));
        let size = |p: [f32; 2]| max(p[0].abs(), p[1].abs());
        let largest = max(max(size(a), size(b)), size(c));
        let bound = self.slope * (largest + self.blur) + f32::MIN_POSITIVE;
        (min(min(u, v), w) < -bound) & (max(max(u, v), w) > bound)
    }
}

/// How the bits of a number are rounded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounding {
    /// What is added to them.
    pub(crate) half: u64,
    /// Those that are kept.
    pub(crate) kept: u64,
}

/// To 26 significant bits.
pub(crate) const TO_26_BITS: Rounding = {
    const DROPPED: u32 = f64::MANTISSA_DIGITS - 26;
    Rounding {
        half: 1 << (DROPPED - 1),
        kept: u64::MAX << DROPPED,
    }
};

/// The nearest number with 26 significant bits, halves away from zero: an error of at most 2⁻²⁶.
#[inline(always)]
fn to_26_bits(x: f64) -> f64 {
    // A carry out of the mantissa goes to the exponent, where it belongs.
    f64::from_bits((x.to_bits() + TO_26_BITS.half) & TO_26_BITS.kept)
}

/// How much each corner counts at the point where the ray passes, up to a common factor of either sign: twice the
/// areas of the triangles that the point makes with the opposite edges.
#[derive(Clone, Copy, Debug)]
struct Weights {
    a: f64,
    b: f64,
    c: f64,
}

impl Weights {
    #[inline(always)]
    fn of([a, b, c]: [Sheared; 3]) -> Self {
        let edge = |p: Sheared, q: Sheared| p.x * q.y - p.y * q.x;
        Self {
            a: edge(c, b),
            b: edge(a, c),
            c: edge(b, a),
        }
    }

    fn sum(&self) -> f64 {
        self.a + self.b + self.c
    }

    /// Inside or on an edge, for either winding. All zero is a triangle seen edge-on, or of no area.
    fn are_inside(&self) -> bool {
        let Self { a, b, c } = *self;
        ((a >= 0.0 && b >= 0.0 && c >= 0.0) || (a <= 0.0 && b <= 0.0 && c <= 0.0))
            && self.sum() != 0.0
    }
}

/// Weights from coordinates that were not rounded, which do not move the hit by 2⁻²⁶ of the triangle's size: on a
/// floor a million times larger than what stands on it that is visible. `None` where they cannot be used.
///
/// The rounded coordinates decide what is a hit, so the finer ones may call it outside. Rounding makes each of these
/// weights err by up to 2⁻⁵² M², M being the largest coordinate; where they do not add up to far more than that, the
/// point they stand for could lie anywhere in the triangle, while exact weights of rounded coordinates keep it within
/// 2⁻²⁶ M of the ray. With the limit below it is within 3 · 2⁻⁵² M² / (2⁻²⁴ M²) · M < 2⁻²⁶ M.
#[inline(always)]
fn finer_weights(exact: [Sheared; 3]) -> Option<Weights> {
    let largest = exact
        .iter()
        .fold(0.0, |m: f64, p| m.max(p.x.abs()).max(p.y.abs()));
    let weights = Weights::of(exact);
    let is_sound = weights.sum().abs() >= LEAST_SHARE * largest * largest;
    (weights.are_inside() && is_sound).then_some(weights)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rounding_keeps_26_bits() {
        let ulp = 2.0_f64.powi(-25);
        for (x, rounded) in [
            (0.0, 0.0),
            (-0.0, 0.0),
            (1.0, 1.0),
            (1.0 + ulp, 1.0 + ulp),
            (1.0 + 0.49 * ulp, 1.0),
            (-1.0 - 0.5 * ulp, -1.0 - ulp),
            (2.0 - 0.1 * ulp, 2.0),
            (f64::INFINITY, f64::INFINITY),
        ] {
            assert_eq!(to_26_bits(x), rounded, "{x:e}");
        }
    }

    proptest! {
        #[test]
        fn products_of_rounded_numbers_are_exact(x in -1e9_f64..1e9, y in -1e-9_f64..1e-9) {
            let (a, b) = (to_26_bits(x), to_26_bits(y));
            prop_assert!((a - x).abs() <= x.abs() * 2.0_f64.powi(-26));
            // The remainder of the product, exactly.
            prop_assert_eq!(a.mul_add(b, -(a * b)), 0.0);
        }
    }

    #[test]
    fn weights_that_are_mostly_rounding_are_not_used() {
        let at = |x, y| Sheared { x, y, t: 1.0 };
        let wide = [at(-1.0, -1.0), at(1.0, -1.0), at(0.0, 1.0)];
        assert!(finer_weights(wide).is_some(), "as wide as long");
        for height in [1e-9, 1e-15, 1e-17, 0.0] {
            let sliver = [at(-1.0, -1.0 - height), at(1.0, 1.0), at(0.0, height)];
            assert!(
                Weights::of(sliver).sum() <= 0.0,
                "{height:e}: the ray passes inside or on it"
            );
            assert!(finer_weights(sliver).is_none(), "{height:e}: too thin");
        }
    }

    /// A point in [-1, 1]³, on a lattice or not.
    fn point() -> impl Strategy<Value = Vec3> {
        let one =
            || prop_oneof![3 => -1.0_f32..1.0, 1 => (-2_i8..=2).prop_map(|x| 0.5 * f32::from(x))];
        [one(), one(), one()].prop_map(Vec3::from_array)
    }

    /// A triangle with a point on it, or very near: of any size and shape, thin ones included.
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
        #![proptest_config(ProptestConfig::with_cases(40_000))]

        /// The filter never rejects what is a hit, whatever the scale. The reach is the least there can be.
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

        /// Eight lanes say what one says, wherever a triangle lies among others and among padding.
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

        /// A corner has one value and an edge one sign, so winding and order cannot matter.
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
