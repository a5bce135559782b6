//! The part of a triangle inside a box: what makes a split *perfect*.

use glam::{DVec3, Vec3};
use smallvec::SmallVec;

use crate::{Aabb, Axis};

/// A triangle cut by six planes has at most nine corners.
type Polygon = SmallVec<[DVec3; 9]>;

/// The box around the part of a triangle that lies in `cell`, or `None` if it does not reach into the cell.
///
/// The original triangle is clipped, in f64 (Wald and Havran 2006 §4.1.1, Havran and Bittner 2002), and the result
/// rounded outwards and cut to the cell, so it never loses more than the rounding of f64. A triangle that only
/// touches the cell counts as inside. Constant time.
pub fn clipped_bounds(corners: [Vec3; 3], cell: &Aabb) -> Option<Aabb> {
    let polygon = clip(corners.map(|p| p.as_dvec3()).into_iter().collect(), cell)?;
    let mut min = polygon[0];
    let mut max = polygon[0];
    for p in &polygon[1..] {
        min = min.min(*p);
        max = max.max(*p);
    }
    let outwards = Aabb {
        min: Vec3::from_array(min.to_array().map(round_down)),
        max: Vec3::from_array(max.to_array().map(round_up)),
    };
    Some(outwards.intersection(cell))
}

/// Sutherland and Hodgman's clipping against the six sides; sides that nothing crosses cost three comparisons.
fn clip(mut polygon: Polygon, cell: &Aabb) -> Option<Polygon> {
    for axis in Axis::ALL.map(Axis::index) {
        keep_inside(&mut polygon, axis, f64::from(cell.min[axis]), 1.0);
        keep_inside(&mut polygon, axis, f64::from(cell.max[axis]), -1.0);
        if polygon.is_empty() {
            return None;
        }
    }
    Some(polygon)
}

/// Keeps what lies on the side of the plane that `sign` points to, the plane included.
fn keep_inside(polygon: &mut Polygon, axis: usize, plane: f64, sign: f64) {
    let outside = |p: &DVec3| (p[axis] - plane) * sign < 0.0;
    if !polygon.iter().any(outside) {
        return;
    }
    let mut kept = Polygon::new();
    let mut from = *polygon.last().expect("a point is outside, so there is one");
    for &to in polygon.iter() {
        if outside(&from) != outside(&to) {
            // The same edge seen from its two ends must give the same point: start at the lower end always.
            let (a, b) = if from[axis] < to[axis] {
                (from, to)
            } else {
                (to, from)
            };
            let mut crossing = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]));
            crossing[axis] = plane;
            kept.push(crossing);
        }
        if !outside(&to) {
            kept.push(to);
        }
        from = to;
    }
    *polygon = kept;
}

/// The largest f32 not above `x`.
#[allow(
    clippy::cast_possible_truncation,
    reason = "rounding is the point, and the next line mends its direction"
)]
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x {
        nearest.next_down()
    } else {
        nearest
    }
}

/// The smallest f32 not below `x`.
fn round_up(x: f64) -> f32 {
    -round_down(-x)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn point(range: f32) -> impl Strategy<Value = Vec3> {
        [-range..range, -range..range, -range..range].prop_map(Vec3::from_array)
    }

    #[test]
    fn a_corner_cut_off_shrinks_the_box() {
        let corners = [
            Vec3::ZERO,
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(0.0, 2.0, 0.0),
        ];
        let cell = Aabb::around([Vec3::new(1.0, 0.0, -1.0), Vec3::new(4.0, 4.0, 1.0)]);
        let part = clipped_bounds(corners, &cell).expect("it reaches in");
        assert_eq!(part.min, Vec3::new(1.0, 0.0, 0.0), "cut at x = 1");
        assert_eq!(part.max, Vec3::new(2.0, 1.0, 0.0), "where y is at most 1");
    }

    #[test]
    fn touching_counts_and_missing_does_not() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let beside = Aabb::around([Vec3::X, Vec3::new(2.0, 1.0, 1.0)]);
        assert_eq!(
            clipped_bounds(corners, &beside),
            Some(Aabb {
                min: Vec3::X,
                max: Vec3::X
            }),
            "one shared point"
        );
        // Inside the triangle's box, but beyond its long edge.
        let corner = Aabb::around([Vec3::new(0.6, 0.6, -1.0), Vec3::new(1.0, 1.0, 1.0)]);
        assert_eq!(
            clipped_bounds(corners, &corner),
            None,
            "the box overlaps, the triangle does not"
        );
    }

    #[test]
    fn flat_and_point_triangles_keep_their_place() {
        let cell = Aabb::around([Vec3::ZERO, Vec3::ONE]);
        let point = Vec3::splat(0.5);
        assert_eq!(
            clipped_bounds([point; 3], &cell),
            Some(Aabb {
                min: point,
                max: point
            }),
            "a point"
        );
        let line = [Vec3::splat(-1.0), Vec3::splat(2.0), Vec3::splat(2.0)];
        assert_eq!(clipped_bounds(line, &cell), Some(cell), "the diagonal");
    }

    proptest! {
        /// Points of the triangle inside the cell are inside the clipped box, up to the rounding of the point itself.
        #[test]
        fn nothing_inside_is_lost(a in point(4.0), b in point(4.0), c in point(4.0), u in 0.0_f64..1.0, v in 0.0_f64..1.0) {
            let cell = Aabb::around([Vec3::splat(-1.0), Vec3::splat(1.5)]);
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let p = a.as_dvec3() * (1.0 - u - v) + b.as_dvec3() * u + c.as_dvec3() * v;
            let inside = |b: &Aabb, slack: f64| {
                (p + slack).cmpge(b.min.as_dvec3()).all() && (p - slack).cmple(b.max.as_dvec3()).all()
            };
            if inside(&cell, -1e-9) {
                let part = clipped_bounds([a, b, c], &cell);
                prop_assert!(part.is_some_and(|part| inside(&part, 1e-9)), "{p} in {part:?}");
            }
        }

        #[test]
        fn the_result_lies_in_both_boxes(a in point(4.0), b in point(4.0), c in point(4.0)) {
            let cell = Aabb::around([Vec3::splat(-1.0), Vec3::splat(1.5)]);
            if let Some(part) = clipped_bounds([a, b, c], &cell) {
                let whole = Aabb::around([a, b, c]);
                prop_assert_eq!(part.intersection(&cell).intersection(&whole), part);
                prop_assert!(!part.is_empty());
            }
        }
    }
}
