//! The part of a triangle inside a box: what makes a split *perfect*.

use glam::{DVec3, Vec3};

use crate::{Aabb, Axis};

/// The box around the part of a triangle that lies in `cell`, or `None` if it does not reach into the cell.
///
/// The original triangle is clipped, in f64 (Wald and Havran 2006 §4.1.1, Havran and Bittner 2002), and the result
/// rounded outwards and cut to the cell, so it never loses more than the rounding of f64. A triangle that only
/// touches the cell counts as inside. Constant time.
pub fn clipped_bounds(corners: [Vec3; 3], cell: &Aabb) -> Option<Aabb> {
    let mut around = Around::NOTHING;
    for point in Polygon::clipped(corners, cell).points() {
        around.add(*point);
    }
    around.rounded_outwards(cell)
}

/// [`clipped_bounds`] for both parts of a cell that is cut at `position` along `axis`: the lower part's, then the upper
/// part's. It clips to the cell once.
pub fn clipped_halves(
    corners: [Vec3; 3],
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Option<Aabb>; 2] {
    let polygon = Polygon::clipped(corners, cell);
    let (along, plane) = (axis.index(), f64::from(position));
    let (mut lower, mut upper) = (Around::NOTHING, Around::NOTHING);
    for (from, to) in polygon.edges() {
        if to[along] <= plane {
            lower.add(to);
        }
        if to[along] >= plane {
            upper.add(to);
        }
        if (from[along] < plane && plane < to[along]) || (to[along] < plane && plane < from[along])
        {
            let point = crossing(from, to, along, plane);
            lower.add(point);
            upper.add(point);
        }
    }
    let (lower_cell, upper_cell) = cell.split(axis, position);
    [
        lower.rounded_outwards(&lower_cell),
        upper.rounded_outwards(&upper_cell),
    ]
}

/// A triangle cut by six planes has at most nine corners.
const MOST_CORNERS: usize = 9;

/// A convex polygon, corners in order. Empty is nothing.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec3; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    /// The part of a triangle in a cell, by Sutherland and Hodgman's clipping against the sides that it crosses.
    #[inline]
    fn clipped(corners: [Vec3; 3], cell: &Aabb) -> Self {
        let mut polygon = Self {
            corners: [DVec3::ZERO; MOST_CORNERS],
            count: 3,
        };
        for (to, from) in polygon.corners.iter_mut().zip(corners) {
            *to = from.as_dvec3();
        }
        let [a, b, c] = corners;
        let (below, above) = (
            a.min(b).min(c).cmplt(cell.min),
            a.max(b).max(c).cmpgt(cell.max),
        );
        for axis in 0..3 {
            if below.test(axis) {
                polygon.keep_inside(axis, f64::from(cell.min[axis]), 1.0);
            }
            if above.test(axis) {
                polygon.keep_inside(axis, f64::from(cell.max[axis]), -1.0);
            }
        }
        polygon
    }

    fn points(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// Each corner with the one before it.
    fn edges(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        let points = self.points();
        let before = points.iter().cycle().skip(self.count.saturating_sub(1));
        before.copied().zip(points.iter().copied())
    }

    /// Keeps what lies on the side of the plane that `sign` points to, the plane included.
    fn keep_inside(&mut self, axis: usize, plane: f64, sign: f64) {
        let is_outside = |p: DVec3| (p[axis] - plane) * sign < 0.0;
        let whole = *self;
        self.count = 0;
        for (from, to) in whole.edges() {
            if is_outside(from) != is_outside(to) {
                self.push(crossing(from, to, axis, plane));
            }
            if !is_outside(to) {
                self.push(to);
            }
        }
    }

    /// Rounding can make a polygon cross a plane more than twice, if only within an ulp; then it may have a corner too
    /// many, which is as good as the last one.
    fn push(&mut self, point: DVec3) {
        self.count = (self.count + 1).min(MOST_CORNERS);
        self.corners[self.count - 1] = point;
    }
}

/// Where an edge crosses a plane. The same edge seen from its two ends gives the same point: it starts at the lower
/// end always.
fn crossing(from: DVec3, to: DVec3, axis: usize, plane: f64) -> DVec3 {
    let (a, b) = if from[axis] < to[axis] {
        (from, to)
    } else {
        (to, from)
    };
    let mut point = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]));
    point[axis] = plane;
    point
}

/// The box around points, while it grows.
struct Around {
    min: DVec3,
    max: DVec3,
}

impl Around {
    const NOTHING: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    #[inline]
    fn add(&mut self, point: DVec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// The box in f32, rounded outwards and cut to the cell; `None` without points.
    #[inline]
    fn rounded_outwards(&self, cell: &Aabb) -> Option<Aabb> {
        let outwards = Aabb {
            min: Vec3::from_array(self.min.to_array().map(round_down)),
            max: Vec3::from_array(self.max.to_array().map(round_up)),
        };
        (self.min.x <= self.max.x).then(|| outwards.intersection(cell))
    }
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
        /// Clipping to the cell once, or to each half of it, may round differently, and not otherwise.
        #[test]
        fn halves_are_the_parts(a in point(4.0), b in point(4.0), c in point(4.0), axis in 0_usize..3, at in -0.9_f32..1.4) {
            let cell = Aabb::around([Vec3::splat(-1.0), Vec3::splat(1.5)]);
            let (lower, upper) = cell.split(Axis::ALL[axis], at);
            let halves = clipped_halves([a, b, c], &cell, Axis::ALL[axis], at);
            for (half, part) in halves.into_iter().zip([lower, upper]) {
                match (half, clipped_bounds([a, b, c], &part)) {
                    (Some(half), Some(alone)) => {
                        prop_assert!((half.min - alone.min).abs().max_element() < 1e-6, "{half:?} {alone:?}");
                        prop_assert!((half.max - alone.max).abs().max_element() < 1e-6, "{half:?} {alone:?}");
                        prop_assert!(half.intersection(&part) == half);
                    }
                    (half, alone) => prop_assert_eq!(half, alone),
                }
            }
        }

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
