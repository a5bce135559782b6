//! Triangles that meet a sphere or a box.

use glam::Vec3;
use kd_core::Aabb;
use kd_simd::{LANES, Mask as _, Number as _, Simd};
use kd_wide::Block;

use crate::decision::Foot;
use crate::exact;
use crate::gather::{Gather, Region, in_order, pad, rounded_down, rounded_up};
use crate::reach::Reach;
use crate::tree::PointTree;
use crate::triangles::Estimates;

/// A closed ball.
struct Ball<'a> {
    center: Vec3,
    squared_radius: f64,
    reach: Reach,
    /// As [`Reach::limit`] and [`Reach::limit_unscaled`].
    limit: f32,
    limit_unscaled: f64,
    slots: &'a mut Vec<u32>,
}

impl<S: Simd> Region<S> for Ball<'_> {
    #[inline(always)]
    fn boxes(&self, simd: S, faces: &[[[f32; LANES]; 2]; 3]) -> u32 {
        let squares = self.reach.lanes(simd).squared_distances(simd, faces);
        squares.le(simd.splat(self.limit)).bits()
    }

    #[inline(always)]
    fn cell(&self, cell: &Aabb) -> bool {
        let center = self.center.as_dvec3();
        let nearest = center.clamp(cell.min.as_dvec3(), cell.max.as_dvec3());
        nearest.distance_squared(center) <= self.limit_unscaled
    }

    #[inline(always)]
    fn take(&mut self, simd: S, block: &Block) {
        let estimates = Estimates::new(simd, &self.reach.lanes(simd), block);
        let mut left = estimates.within(simd, self.limit);
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            if Foot::new(self.center, block.corners_of(lane)).squared <= self.squared_radius {
                self.slots.push(block.triangles[lane]);
            }
        }
    }
}

/// The triangles with a point at most `radius` from `center`, in ascending order, each once. Clears `out` first.
///
/// Decided as by [`closest_point`](crate::closest_point): a squared distance in f64 is compared with the squared radius. None if the center
/// is not finite, or the radius negative or NaN. Time is proportional to the triangles found, and logarithmic in all triangles.
pub fn triangles_in_sphere(
    trees: &[PointTree<'_>],
    center: impl Into<Vec3>,
    radius: f32,
    out: &mut Vec<u32>,
) {
    out.clear();
    let center = center.into();
    let radius = f64::from(radius);
    if !center.is_finite() || radius.is_nan() || radius < 0.0 {
        return;
    }
    for &tree in trees {
        let bounds = tree.bounds();
        if bounds.is_empty() {
            continue;
        }
        let reach = Reach::new(center, &bounds);
        let squared_radius = radius * radius;
        let region = &mut Ball {
            center,
            squared_radius,
            reach,
            limit: reach.limit(squared_radius),
            limit_unscaled: reach.limit_unscaled(squared_radius),
            slots: out,
        };
        tree.level().run(Gather { tree, region });
    }
    in_order(out);
}

/// A closed box.
struct InBox<'a> {
    bounds: Aabb,
    /// The box, larger by the pad of a tree.
    padded: Aabb,
    slots: &'a mut Vec<u32>,
}

impl<S: Simd> Region<S> for InBox<'_> {
    #[inline(always)]
    fn boxes(&self, simd: S, faces: &[[[f32; LANES]; 2]; 3]) -> u32 {
        let mut met = u32::MAX;
        for (axis, [starts, ends]) in faces.iter().enumerate() {
            let starts_before = simd.load(starts).le(simd.splat(self.padded.max[axis]));
            let ends_behind = simd.splat(self.padded.min[axis]).le(simd.load(ends));
            met &= (starts_before & ends_behind).bits();
        }
        met
    }

    #[inline(always)]
    fn cell(&self, cell: &Aabb) -> bool {
        cell.min.cmple(self.padded.max).all() && self.padded.min.cmple(cell.max).all()
    }

    #[inline(always)]
    fn take(&mut self, simd: S, block: &Block) {
        let [a, b, c] = &block.corners;
        let mut left = u32::MAX;
        for axis in 0..3 {
            let a = simd.load(&a[axis]);
            let b = simd.load(&b[axis]);
            let c = simd.load(&c[axis]);
            let starts_before = a.min(b).min(c).le(simd.splat(self.bounds.max[axis]));
            let ends_behind = simd.splat(self.bounds.min[axis]).le(a.max(b).max(c));
            left &= (starts_before & ends_behind).bits();
        }
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            if exact::meets_box(block.corners_of(lane), &self.bounds) {
                self.slots.push(block.triangles[lane]);
            }
        }
    }
}

/// The triangles that have a point in a closed box, in ascending order, each once. Clears `out` first.
///
/// Exact: a triangle that only touches the box counts, and one that is beside it by any amount does not. None for an empty box and for one
/// with NaN; faces may be infinite. Time is proportional to the triangles found, and logarithmic in all triangles.
pub fn triangles_in_box(trees: &[PointTree<'_>], bounds: &Aabb, out: &mut Vec<u32>) {
    out.clear();
    if !is_box(bounds) {
        return;
    }
    for &tree in trees {
        let around = tree.bounds();
        if around.is_empty() {
            continue;
        }
        let pad = pad(&around);
        let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
        let region = &mut InBox {
            bounds: *bounds,
            padded: Aabb {
                min: Vec3::from_array((min - pad).to_array().map(rounded_down)),
                max: Vec3::from_array((max + pad).to_array().map(rounded_up)),
            },
            slots: out,
        };
        tree.level().run(Gather { tree, region });
    }
    in_order(out);
}

/// Whether a box has points. False for NaN.
pub(crate) fn is_box(bounds: &Aabb) -> bool {
    bounds.min.cmple(bounds.max).all()
}
