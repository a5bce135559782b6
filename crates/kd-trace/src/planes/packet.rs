//! Rays that go the same way on every axis, asked about a box together.
//!
//! Interval arithmetic over the rays of a packet (S. Boulos, I. Wald, P. Shirley, *Geometric and Arithmetic Culling Methods
//! for Entire Ray Packets*, 2006): the crossing of a plane is a product of two factors, each of which lies in an interval, so
//! that it lies between products of their ends. Rounding is monotone, so the bounds hold for what [`RayPlanes`] computes, to
//! the bit, and need no bound of their own.

use kd_core::Aabb;

use super::{RayPlanes, Span};
use crate::float::{max, min};

/// Several rays, ready to be asked whether all of them miss a box. They go the same way on every axis.
#[derive(Clone, Copy, Debug)]
pub struct PacketPlanes {
    axes: [PacketAxis; 3],
}

/// The rays and the planes across one axis. Of pairs, the lowest comes first.
#[derive(Clone, Copy, Debug)]
struct PacketAxis {
    origin: [f32; 2],
    /// All of one sign.
    inverse: [f32; 2],
    /// The largest.
    pad: f32,
    is_downwards: bool,
}

impl PacketPlanes {
    /// Of some rays; `None` if there are none, or if two of them differ in whether they go [downwards] on an axis.
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
                all.pad = max(one.pad, all.pad);
            }
        }
        Some(packet)
    }

    fn of_one(ray: &RayPlanes) -> Self {
        let [x, y, z, _] = ray.axes;
        let axes = [x, y, z].map(|planes| PacketAxis {
            origin: [planes.origin; 2],
            inverse: [planes.inverse; 2],
            pad: planes.pad,
            is_downwards: planes.near != 0,
        });
        Self { axes }
    }

    /// Whether [`RayPlanes::clip_span`] gives `None` for each of the rays and any part of the span. If not, all of them may
    /// miss the box still.
    #[inline]
    pub fn all_miss(&self, mut span: Span, bounds: &Aabb) -> bool {
        for (index, axis) in self.axes.iter().enumerate() {
            // From the ray that is furthest behind to the one furthest ahead.
            let distances = |face: f32| {
                let [lowest, highest] = axis.origin;
                [face - highest, face - lowest]
            };
            let [lower, upper] = [bounds.min[index], bounds.max[index]].map(distances);
            let (near, far) = if axis.is_downwards {
                (upper[1], lower[0])
            } else {
                (lower[0], upper[1])
            };
            let [near, far] = [near, far].map(|distance| axis.inverse.map(|i| distance * i));
            span.enter = max(min(near[0], near[1]) - axis.pad, span.enter);
            span.exit = min(max(far[0], far[1]) + axis.pad, span.exit);
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
        #![proptest_config(ProptestConfig::with_cases(4000))]

        /// What the packet calls a miss is one for each of its rays, to the last bit.
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
            } else if let [(ray, planes)] = planes[..] {
                prop_assert!(planes.clip_span(span, &part).is_some(), "alone: {ray:?} {part:?}");
            }
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
