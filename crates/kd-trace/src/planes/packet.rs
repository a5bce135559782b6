//! Coherent rays, with the same sign of direction on every axis, tested against a box together.
//!
//! Interval arithmetic over the rays of a packet (S. Boulos, I. Wald, P. Shirley, *Geometric and Arithmetic Culling Methods
//! for Entire Ray Packets*, 2006): the crossing of a plane is a product of two factors, each of which lies in an interval, so
//! that it lies between products of their ends.
//!
//! Measured along an axis, the error bound of a ray is equally wide on both sides of every plane perpendicular to that axis, and
//! similar for all rays, so faces are moved by the largest bound. It is at least `2⁻²⁰ Q`, Q being the largest distance to a
//! face of the whole box. Half as much again covers rounding here and in [`RayPlanes`], which is below `2⁻²¹ Q`: six operations
//! with a relative error of 2⁻²⁴ each.

use kd_core::Aabb;
use kd_simd::{each, max, min};

use super::{RayPlanes, Span};

/// Several rays with the same signs of direction, prepared for the question whether all of them miss a box.
#[derive(Clone, Copy, Debug)]
pub struct PacketPlanes {
    axes: [PacketAxis; 3],
}

/// The rays and the planes perpendicular to one axis. Of pairs, the lowest comes first.
#[derive(Clone, Copy, Debug)]
struct PacketAxis {
    origin: [f32; 2],
    /// All of one sign.
    inverse: [f32; 2],
    /// The distance by which faces are moved outwards.
    margin: f32,
    is_downwards: bool,
}

impl PacketPlanes {
    /// Prepares rays; `None` without rays, or if two rays differ in whether they go [downwards] on an axis.
    ///
    /// [downwards]: RayPlanes::is_downwards
    pub fn new<'a>(rays: impl IntoIterator<Item = &'a RayPlanes>) -> Option<Self> {
        let mut rays = rays.into_iter();
        let mut packet = Self::of_one(rays.next()?);
        for ray in rays {
            for (all, one) in packet.axes.iter_mut().zip(Self::of_one(ray).axes) {
                if all.is_downwards != one.is_downwards {
                    return None;
                }
                all.origin = around(all.origin, one.origin);
                all.inverse = around(all.inverse, one.inverse);
                all.margin = max(one.margin, all.margin);
            }
        }
        Some(packet)
    }

    fn of_one(ray: &RayPlanes) -> Self {
        let [x, y, z, _] = ray.axes;
        let axes = [x, y, z].map(|planes| PacketAxis {
            origin: [planes.origin; 2],
            inverse: [planes.inverse; 2],
            margin: 1.5 * planes.pad / planes.inverse.abs(),
            is_downwards: planes.near != 0,
        });
        Self { axes }
    }

    /// Whether [`RayPlanes::clip_span`] surely returns `None` for each ray and any part of the span. If false, all rays may still
    /// miss the box. The box is one that `clip_span` accepts.
    #[inline]
    pub fn all_miss(&self, mut span: Span, bounds: &Aabb) -> bool {
        for (index, axis) in self.axes.iter().enumerate() {
            // The lower face from the highest origin, and the upper one from the lowest.
            let lower = bounds.min[index] - axis.origin[1] - axis.margin;
            let upper = bounds.max[index] - axis.origin[0] + axis.margin;
            let (near, far) = if axis.is_downwards {
                (upper, lower)
            } else {
                (lower, upper)
            };
            let [near, far] = each([near, far], |distance| each(axis.inverse, |i| distance * i));
            span.enter = max(min(near[0], near[1]), span.enter);
            span.exit = min(max(far[0], far[1]), span.exit);
        }
        span.enter > span.exit
    }
}

fn around(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [min(a[0], b[0]), max(a[1], b[1])]
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use kd_core::Ray;
    use kd_oracle::effort;
    use proptest::prelude::*;

    use super::super::Frame;
    use super::*;

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            4 => -3.0_f32..3.0,
            2 => (-2_i8..=2).prop_map(f32::from),
            1 => Just(-0.0),
            1 => (-3.0_f32..3.0).prop_map(|x| x * 1e30),
            1 => (-3.0_f32..3.0).prop_map(|x| x * 1e-30),
        ]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        [number(), number(), number()].prop_map(Vec3::from_array)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(effort::cases(1_000, 4_000)))]

        /// A miss of the packet is a miss of each of its rays.
        #[test]
        fn a_packet_misses_only_what_its_rays_miss(
            corners in [point(), point(), point()],
            part in [point(), point()],
            rays in prop::collection::vec((point(), point()), 1..12),
            spread in prop_oneof![Just(0.0_f32), Just(1e-6), Just(1e-2), Just(1.0)],
        ) {
            let whole = Aabb::around(corners.into_iter().chain(part));
            let part = Aabb::around(part);
            let (origin, direction) = rays[0];
            let frame = Frame::new(&whole);
            let planes: Vec<(Ray, RayPlanes)> = rays
                .iter()
                .map(|(o, d)| Ray::new(origin + spread * *o, direction + spread * *d))
                .filter(Ray::can_hit)
                .map(|ray| (ray, RayPlanes::new(&ray, &frame)))
                .collect();
            let Some(packet) = PacketPlanes::new(planes.iter().map(|(_, planes)| planes)) else {
                return Ok(());
            };
            let span = Span { enter: 0.0, exit: f32::INFINITY };
            if packet.all_miss(span, &part) {
                for (ray, planes) in &planes {
                    prop_assert!(planes.clip_span(span, &part).is_none(), "{ray:?} {part:?}");
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(effort::cases(5_000, 20_000)))]

        /// Boxes at about the distance from a ray up to which it meets them.
        #[test]
        fn margins_are_wide_enough(
            [ox, oy, oz] in [0.0_f32..1.0, 0.0_f32..1.0, 0.0_f32..1.0],
            [dx, dy, dz] in [-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0],
            t in 0.0_f32..1.0,
            aside in [-3.0_f32..3.0, -3.0_f32..3.0, -3.0_f32..3.0],
            spread in prop_oneof![Just(0.0_f32), Just(1e-7), Just(1e-4)],
        ) {
            let ray = Ray::new([ox, oy, oz], [dx, dy, dz]);
            prop_assume!(ray.can_hit());
            let point = ray.at(t) + Vec3::from_array(aside) / (1 << 20) as f32;
            let part = Aabb::around([point.clamp(Vec3::ZERO, Vec3::ONE)]);
            let frame = Frame::new(&Aabb::around([Vec3::ZERO, Vec3::ONE]));
            let other = Ray::new(ray.origin, ray.direction * (1.0 - spread));
            let rays = [ray, other].map(|ray| RayPlanes::new(&ray, &frame));
            let packet = PacketPlanes::new(&rays).expect("coherent");
            let span = Span { enter: f32::NEG_INFINITY, exit: f32::INFINITY };
            if packet.all_miss(span, &part) {
                for planes in &rays {
                    prop_assert!(planes.clip_span(span, &part).is_none(), "{ray:?} {part:?}");
                }
            }
        }
    }

    /// Rays that spread a little, one of them along an axis, and boxes that they meet or barely miss.
    #[test]
    fn a_packet_that_is_beside_a_box_misses_it() {
        let frame = Frame::new(&Aabb::around([Vec3::ZERO, Vec3::splat(100.0)]));
        let directions = (0..9).map(|i| Vec3::new(0.01 * i as f32, 1.0, 0.02 * i as f32));
        let rays: Vec<RayPlanes> = directions
            .map(|d| RayPlanes::new(&Ray::new([1.0; 3], d), &frame))
            .collect();
        let packet = PacketPlanes::new(&rays).expect("all go upwards");
        let cube = |center: Vec3| Aabb::around([center - 0.5, center + 0.5]);
        let span = |enter, exit| Span { enter, exit };
        let ahead = cube(Vec3::new(1.2, 11.0, 2.0));
        for (bounds, span, misses) in [
            (ahead, span(0.0, f32::INFINITY), false),
            (ahead, span(0.0, 9.0), true),
            (ahead, span(11.0, f32::INFINITY), true),
            (
                cube(Vec3::new(3.0, 11.0, 2.0)),
                span(0.0, f32::INFINITY),
                true,
            ),
            (
                cube(Vec3::new(1.2, 11.0, 0.3)),
                span(0.0, f32::INFINITY),
                true,
            ),
            (
                cube(Vec3::new(1.2, 0.3, 1.2)),
                span(0.0, f32::INFINITY),
                true,
            ),
        ] {
            assert_eq!(
                packet.all_miss(span, &bounds),
                misses,
                "{bounds:?} {span:?}"
            );
        }
    }

    #[test]
    fn rays_of_different_octants_are_no_packet() {
        let frame = Frame::new(&Aabb::around([Vec3::ZERO, Vec3::ONE]));
        let towards = |d: [f32; 3]| RayPlanes::new(&Ray::new([0.5; 3], d), &frame);
        let up = [towards([1.0, 1.0, 1.0]), towards([1.0, 2.0, 0.0])];
        assert!(PacketPlanes::new(&up).is_some(), "upwards on all axes");
        let mixed = [towards([1.0, 1.0, 1.0]), towards([1.0, -1.0, 1.0])];
        assert!(PacketPlanes::new(&mixed).is_none(), "one goes down");
        assert!(PacketPlanes::new([]).is_none(), "none");
    }
}
