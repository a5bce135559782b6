//! Whether a point is inside a closed surface: the parity of crossings of a ray.

use glam::Vec3;
use kd_core::Aabb;
use kd_simd::{LANES, Mask as _, Number as _, Simd};
use kd_wide::Block;

use crate::closest::closest_point;
use crate::exact::{Crossing, crossing};
use crate::gather::{Gather, Region, in_order, pad, rounded_down, rounded_up};
use crate::nearest::Nearest;
use crate::tree::PointTree;

/// A ray along the x axis.
struct Column<'a> {
    point: Vec3,
    /// The point less and plus the pad of a tree, in each coordinate.
    lower: Vec3,
    upper: Vec3,
    /// Slots of triangles that the ray crosses.
    crossed: &'a mut Vec<u32>,
    is_on_surface: bool,
}

impl<S: Simd> Region<S> for Column<'_> {
    #[inline(always)]
    fn boxes(&self, simd: S, [x, y, z]: &[[[f32; LANES]; 2]; 3]) -> u32 {
        let mut met = simd.splat(self.lower.x).le(simd.load(&x[1]));
        for (axis, [starts, ends]) in [(1, y), (2, z)] {
            met = met & simd.load(starts).le(simd.splat(self.upper[axis]));
            met = met & simd.splat(self.lower[axis]).le(simd.load(ends));
        }
        met.bits()
    }

    #[inline(always)]
    fn cell(&self, cell: &Aabb) -> bool {
        self.lower.cmple(cell.max).all() && cell.min.y <= self.upper.y && cell.min.z <= self.upper.z
    }

    #[inline(always)]
    fn take(&mut self, simd: S, block: &Block) {
        let [a, b, c] = &block.corners;
        let row = |rows: &[[f32; LANES]; 3], axis: usize| simd.load(&rows[axis]);
        let highest = row(a, 0).max(row(b, 0)).max(row(c, 0));
        // Lanes without a triangle have NaN, which compares false.
        let mut left = simd.splat(self.point.x).le(highest);
        for axis in [1, 2] {
            let (a, b, c) = (row(a, axis), row(b, axis), row(c, axis));
            let at = simd.splat(self.point[axis]);
            left = left & a.min(b).min(c).le(at) & at.le(a.max(b).max(c));
        }
        let mut left = left.bits();
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            match crossing(self.point, block.corners_of(lane)) {
                Crossing::None => {}
                Crossing::Beyond => self.crossed.push(block.triangles[lane]),
                Crossing::At => self.is_on_surface = true,
            }
        }
    }
}

/// Whether a point is inside of the surface of all trees together, or on it.
///
/// The surface should be closed ([`Mesh::is_closed`](kd_core::Mesh::is_closed)). Then the answer is exact, for every point: the parity of
/// the triangles that a ray along the x axis crosses, each decided exactly, and with a consistent choice where the ray meets edges and
/// corners. A point on a triangle counts as inside. So does a point inside an odd number of nested or overlapping surfaces. The winding of
/// triangles does not matter, and neither do triangles of zero area.
///
/// On an open mesh the answer is that of the same ray, in the direction of positive x: right where the ray does not pass through the hole.
/// [`WindingNumbers`](crate::WindingNumbers) suits such meshes better.
///
/// False if the point is not finite, and without triangles. Expected time is that of a ray that counts all hits.
pub fn contains(trees: &[PointTree<'_>], point: impl Into<Vec3>) -> bool {
    contains_with(trees, point.into(), &mut Vec::new())
}

/// [`contains`] with memory for the triangles that a ray crosses.
pub(crate) fn contains_with(trees: &[PointTree<'_>], point: Vec3, crossed: &mut Vec<u32>) -> bool {
    if !point.is_finite() {
        return false;
    }
    let mut count = 0;
    for &tree in trees {
        let bounds = tree.bounds();
        if bounds.is_empty() {
            continue;
        }
        let pad = pad(&bounds);
        let from = point.as_dvec3();
        crossed.clear();
        let region = &mut Column {
            point,
            lower: Vec3::from_array((from - pad).to_array().map(rounded_down)),
            upper: Vec3::from_array((from + pad).to_array().map(rounded_up)),
            crossed,
            is_on_surface: false,
        };
        tree.level().run(Gather { tree, region });
        if region.is_on_surface {
            return true;
        }
        // A triangle may be in several leaves of a tree. No triangle is in two trees.
        in_order(crossed);
        count += crossed.len();
    }
    count % 2 == 1
}

/// The distance of a point from the surface of all trees together, negative inside.
///
/// The sign is that of most signed distance fields, and of Open3D: negative where [`contains`] is true, and 0 on the surface. (trimesh has
/// it the other way round: positive inside.) The distance is that of [`closest_point`](crate::closest_point).
///
/// `None` if the point is not finite, and without triangles that have an area.
pub fn signed_distance(trees: &[PointTree<'_>], point: impl Into<Vec3>) -> Option<f32> {
    let point = point.into();
    let nearest = closest_point(trees, point, f32::INFINITY)?;
    Some(signed(trees, point, &nearest, &mut Vec::new()))
}

/// The distance of the nearest point, negative inside; with memory for the triangles that a ray crosses.
pub(crate) fn signed(
    trees: &[PointTree<'_>],
    point: Vec3,
    nearest: &Nearest,
    crossed: &mut Vec<u32>,
) -> f32 {
    let distance = nearest.distance;
    if distance > 0.0 && contains_with(trees, point, crossed) {
        -distance
    } else {
        distance
    }
}
