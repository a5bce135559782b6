//! Exact predicates of points, triangles and boxes.
//!
//! Orientations are signs of determinants, computed adaptively (J. Shewchuk, *Adaptive Precision Floating-Point Arithmetic and Fast
//! Robust Geometric Predicates*, 1997; crate `robust`). Coordinates are f32, so that no product in f64 overflows or underflows.

use glam::Vec3;
use kd_core::Aabb;
use robust::{Coord, Coord3D, orient2d, orient3d};

/// Positive, negative or zero as d is below, above or in the plane of a, b and c, which appear counter-clockwise from above.
fn side_of_plane([a, b, c]: [Vec3; 3], d: Vec3) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(|p| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    });
    orient3d(a, b, c, d)
}

/// A point seen along an axis: its coordinates on the two axes that follow.
fn seen_along(axis: usize, point: Vec3) -> [f32; 2] {
    [point[(axis + 1) % 3], point[(axis + 2) % 3]]
}

/// Positive where a, b and c are in counter-clockwise order, zero on a line.
fn turn(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> f64 {
    let [a, b, c] = [a, b, c].map(|[x, y]| Coord { x, y });
    orient2d(a, b, c)
}

fn box_of([a, b, c]: [Vec3; 3]) -> Aabb {
    Aabb {
        min: a.min(b).min(c),
        max: a.max(b).max(c),
    }
}

/// Whether a point is on a closed triangle. Never on one of zero area.
pub(crate) fn is_on(point: Vec3, corners: [Vec3; 3]) -> bool {
    let Aabb { min, max } = box_of(corners);
    let is_in_box = point.cmpge(min).all() && point.cmple(max).all();
    if !is_in_box || side_of_plane(corners, point) != 0.0 {
        return false;
    }
    // In the plane: seen along an axis where the triangle has an area, it is inside exactly if it is inside.
    for axis in 0..3 {
        let [a, b, c] = corners.map(|corner| seen_along(axis, corner));
        let area = turn(a, b, c);
        if area != 0.0 {
            let p = seen_along(axis, point);
            let turns = [turn(a, b, p), turn(b, c, p), turn(c, a, p)];
            return turns.into_iter().all(|turn| turn * area.signum() >= 0.0);
        }
    }
    false
}

/// Where a triangle is on the line through a point along the x axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Crossing {
    /// The ray from the point towards positive x does not cross it.
    None,
    /// The ray crosses it.
    Beyond,
    /// The point is on it.
    At,
}

/// Whether the ray from a point along the x axis crosses a triangle.
///
/// Projected along x, coordinates stay as they are. Where the ray meets an edge or a corner, the answer is that for a ray moved by ε along
/// y and ε² along z, for any small enough ε > 0 (symbolic perturbation, H. Edelsbrunner and E. Mücke, *Simulation of Simplicity*,
/// 1990). No triangle has an edge on such a ray. Of the triangles around an edge, those on one side are crossed, so that the parity of
/// crossings of a closed mesh is right, whichever edges and corners the ray meets.
pub(crate) fn crossing(point: Vec3, corners: [Vec3; 3]) -> Crossing {
    if is_on(point, corners) {
        return Crossing::At;
    }
    let [a, b, c] = corners.map(|corner| seen_along(0, corner));
    let p = seen_along(0, point);
    let first = moved_turn(a, b, p);
    let is_crossed = first != 0.0
        && first.is_sign_positive() == moved_turn(b, c, p).is_sign_positive()
        && first.is_sign_positive() == moved_turn(c, a, p).is_sign_positive();
    if !is_crossed {
        return Crossing::None;
    }
    // With normal n, the line meets the plane at a distance of n · (a − p) / n.x. Both signs are known: `side_of_plane` is the first
    // product, and all turns have the sign of n.x. The first is not zero, or the point would be on the triangle.
    if (side_of_plane(corners, point) > 0.0) == (first > 0.0) {
        Crossing::Beyond
    } else {
        Crossing::None
    }
}

/// The sign of [`turn`] for p moved by (ε, ε²); zero only if a and b are equal.
fn moved_turn(a: [f32; 2], b: [f32; 2], p: [f32; 2]) -> f64 {
    let exact = turn(a, b, p);
    if exact != 0.0 {
        return exact;
    }
    // The turn changes by (a.y − b.y) ε + (b.x − a.x) ε².
    let along_first = f64::from(a[1]) - f64::from(b[1]);
    if along_first != 0.0 {
        along_first
    } else {
        f64::from(b[0]) - f64::from(a[0])
    }
}

/// Whether a triangle and a box have a common point. Both are closed. An empty box has none; a box may be infinite.
///
/// Two convex bodies are apart exactly if they are apart along an axis of the box, along the normal of the triangle, or along a product of
/// an axis and an edge (T. Akenine-Möller, *Fast 3D Triangle-Box Overlap Testing*, 2001). Here each of the thirteen conditions is
/// decided exactly.
pub(crate) fn meets_box(corners: [Vec3; 3], bounds: &Aabb) -> bool {
    let around = box_of(corners);
    // What matters of the box is its part in the box of the triangle, which is finite.
    let part = around.intersection(bounds);
    if part.is_empty() {
        return false;
    }
    part == around || !(is_beside_plane(corners, &part) || is_beside_an_edge(corners, &part))
}

/// Whether a box is on one side of the plane of a triangle.
fn is_beside_plane(corners: [Vec3; 3], bounds: &Aabb) -> bool {
    let ends = [bounds.min, bounds.max];
    let corner = |i: usize| Vec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z);
    are_on_one_side((0..8).map(|i| side_of_plane(corners, corner(i))))
}

/// Whether a box, seen along an axis, is beyond an edge of a triangle.
fn is_beside_an_edge(corners: [Vec3; 3], bounds: &Aabb) -> bool {
    (0..3).any(|axis| {
        let corners = corners.map(|corner| seen_along(axis, corner));
        let [min, max] = [bounds.min, bounds.max].map(|corner| seen_along(axis, corner));
        let rectangle = [min, [max[0], min[1]], max, [min[0], max[1]]];
        let [a, b, c] = corners;
        let area = turn(a, b, c);
        [[a, b], [b, c], [c, a]].into_iter().any(|[from, to]| {
            let turns = rectangle.map(|corner| turn(from, to, corner));
            // Outside: where the third corner is not. A triangle seen edge-on has nothing on either side.
            are_on_one_side(turns) && (area == 0.0 || turns[0] * area.signum() < 0.0)
        })
    })
}

/// Whether numbers are all positive or all negative.
fn are_on_one_side(numbers: impl IntoIterator<Item = f64>) -> bool {
    let mut numbers = numbers.into_iter();
    let Some(first) = numbers.next() else {
        return false;
    };
    first != 0.0 && numbers.all(|number| number * first.signum() > 0.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A fan of triangles around an edge that the ray meets: the ray crosses as many as lie on one side.
    #[test]
    fn rays_through_edges_and_corners_cross_one_side() {
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let [a, b, c, d] = [
            at(1.0, -1.0, -1.0),
            at(1.0, 1.0, 1.0),
            at(1.0, -1.0, 1.0),
            at(1.0, 1.0, -1.0),
        ];
        let count = |point: Vec3| {
            let triangles = [[a, b, c], [b, a, d]];
            let crossed = triangles.map(|corners| crossing(point, corners) == Crossing::Beyond);
            crossed.into_iter().filter(|is_crossed| *is_crossed).count()
        };
        assert_eq!(count(at(0.0, 0.0, 0.0)), 1, "through the diagonal");
        assert_eq!(count(at(0.0, 0.5, 0.5)), 1, "through the diagonal");
        assert_eq!(count(at(0.0, 2.0, 0.0)), 0, "beside");
        assert_eq!(count(at(2.0, 0.0, 0.0)), 0, "behind");
        let corners = [a, b, c, d].map(|corner| count(at(0.0, corner.y, corner.z)));
        assert_eq!(corners.iter().sum::<usize>(), 1, "one of four corners");
        assert_eq!(
            crossing(at(1.0, 0.0, 0.0), [a, b, c]),
            Crossing::At,
            "on it"
        );
    }

    #[test]
    fn boxes_touch_triangles() {
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let corners = [at(0.0, 0.0, 0.0), at(4.0, 0.0, 0.0), at(0.0, 4.0, 4.0)];
        let meets = |min: Vec3, max: Vec3| meets_box(corners, &Aabb { min, max });
        assert!(
            meets(at(2.0, 2.0, 2.0), at(3.0, 3.0, 3.0)),
            "touches the long edge"
        );
        let above = 2.0_f32.next_up();
        assert!(
            !meets(at(above, 2.0, 2.0), at(3.0, 3.0, 3.0)),
            "one step off it"
        );
        assert!(
            meets(at(0.0, 1.0, 1.0), at(1.0, 1.0, 1.0)),
            "a segment in it"
        );
        assert!(!meets(at(0.5, 1.0, 1.5), at(1.0, 1.25, 2.0)), "above it");
        assert!(meets(Vec3::NEG_INFINITY, Vec3::INFINITY), "everything");
        assert!(!meets(Vec3::ONE, Vec3::ZERO), "an empty box");
    }

    proptest! {
        /// On a lattice, against clipping in integers that are exact in f64.
        #[test]
        fn overlaps_equal_clipping(
            corners in prop::array::uniform3(prop::array::uniform3(-4_i8..=4)),
            low in prop::array::uniform3(-4_i8..=4),
            size in prop::array::uniform3(0_i8..=3),
        ) {
            let corners = corners.map(|corner| Vec3::from_array(corner.map(f32::from)));
            prop_assume!(!kd_core::is_zero_area(corners));
            let min = Vec3::from_array(low.map(f32::from));
            let bounds = Aabb { min, max: min + Vec3::from_array(size.map(f32::from)) };
            // Clipping rounds; boxes a little larger and a little smaller bracket the truth.
            let clipped = |pad: f32| {
                let bounds = Aabb { min: bounds.min - pad, max: bounds.max + pad };
                kd_core::clipped_bounds(corners, &bounds).is_some()
            };
            let found = meets_box(corners, &bounds);
            prop_assert!(clipped(1e-4) || !found, "too much: {corners:?} {bounds:?}");
            prop_assert!(found || !clipped(-1e-4), "too little: {corners:?} {bounds:?}");
            // A lattice has no gaps as small as a thousandth.
            prop_assert_eq!(found, clipped(1e-4), "{:?} {:?}", corners, bounds);
        }
    }
}
