//! The part of a triangle inside a box: what makes a split *perfect*.

use glam::{BVec3, DVec3, Vec3};

use crate::{Aabb, Axis};

/// The box around the part of a triangle that lies in `cell`, or `None` if it does not reach into the cell.
///
/// The original triangle is clipped, in f64 (Wald and Havran 2006 §4.1.1, Havran and Bittner 2002), and the result
/// rounded outwards and cut to the cell, so it never loses more than the rounding of f64. A triangle that only
/// touches the cell counts as inside. Constant time.
pub fn clipped_bounds(corners: [Vec3; 3], cell: &Aabb) -> Option<Aabb> {
    let mut around = Around::NOTHING;
    Clip::new(corners, cell).with(|points| {
        for point in points {
            around.add(*point);
        }
    });
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
    let (mut lower, mut upper) = (Around::NOTHING, Around::NOTHING);
    let (along, plane) = (axis.index(), f64::from(position));
    Clip::new(corners, cell).with(|points| {
        for (from, to) in edges(points) {
            let (before, after) = (from[along], to[along]);
            if after <= plane {
                lower.add(to);
            }
            if after >= plane {
                upper.add(to);
            }
            if (before < plane && plane < after) || (after < plane && plane < before) {
                let point = crossing(from, to, along, plane);
                lower.add(point);
                upper.add(point);
            }
        }
    });
    let (lower_cell, upper_cell) = cell.split(axis, position);
    [
        lower.rounded_outwards(&lower_cell),
        upper.rounded_outwards(&upper_cell),
    ]
}

/// A triangle on its way to its part in a cell.
struct Clip<'a> {
    triangle: [DVec3; 3],
    cell: &'a Aabb,
    /// The sides that it reaches across.
    below: BVec3,
    above: BVec3,
}

impl<'a> Clip<'a> {
    #[inline]
    fn new([a, b, c]: [Vec3; 3], cell: &'a Aabb) -> Self {
        Self {
            triangle: [a, b, c].map(|corner| corner.as_dvec3()),
            cell,
            below: a.min(b).min(c).cmplt(cell.min),
            above: a.max(b).max(c).cmpgt(cell.max),
        }
    }

    /// Hands on the corners of the part, in order. Most triangles that a plane cuts are whole until then.
    #[inline]
    fn with(&self, use_points: impl FnOnce(&[DVec3])) {
        if self.below.any() || self.above.any() {
            use_points(self.clipped().points());
        } else {
            use_points(&self.triangle);
        }
    }

    /// Sutherland and Hodgman's clipping, against the sides that are crossed.
    fn clipped(&self) -> Polygon {
        let mut polygon = Polygon::NOTHING;
        for corner in self.triangle {
            polygon.push(corner);
        }
        for axis in 0..3 {
            if self.below.test(axis) {
                polygon = polygon.inside(axis, f64::from(self.cell.min[axis]), 1.0);
            }
            if self.above.test(axis) {
                polygon = polygon.inside(axis, f64::from(self.cell.max[axis]), -1.0);
            }
        }
        polygon
    }
}

/// A triangle cut by six planes has at most nine corners.
const MOST_CORNERS: usize = 9;

/// A convex polygon, corners in order.
struct Polygon {
    corners: [DVec3; MOST_CORNERS],
    count: usize,
}

impl Polygon {
    const NOTHING: Self = Self {
        corners: [DVec3::ZERO; MOST_CORNERS],
        count: 0,
    };

    fn points(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// What lies on the side of the plane that `sign` points to, the plane included.
    fn inside(&self, axis: usize, plane: f64, sign: f64) -> Self {
        let is_outside = |p: DVec3| (p[axis] - plane) * sign < 0.0;
        let mut kept = Self::NOTHING;
        for (from, to) in edges(self.points()) {
            if is_outside(from) != is_outside(to) {
                kept.push(crossing(from, to, axis, plane));
            }
            if !is_outside(to) {
                kept.push(to);
            }
        }
        kept
    }

    /// Rounding can make a polygon cross a plane more than twice, if only within an ulp; then it may have a corner too
    /// many, which is as good as the last one.
    #[inline]
    fn push(&mut self, point: DVec3) {
        self.count = (self.count + 1).min(MOST_CORNERS);
        self.corners[self.count - 1] = point;
    }
}

/// Each corner, with the one before it first.
#[inline]
fn edges(points: &[DVec3]) -> impl Iterator<Item = (DVec3, DVec3)> {
    let last = points.last().copied().unwrap_or(DVec3::ZERO);
    points.iter().scan(last, |before, &point| {
        Some((std::mem::replace(before, point), point))
    })
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
///
/// Whether rounding went up is as good as random, so there is no branch on it: one step towards negative infinity, or
/// none, taken in the bits. Rounding keeps the sign, so that a zero that is above `x` is -0.0, and one step from it
/// leads to the next negative number.
#[inline]
#[allow(
    clippy::cast_possible_truncation,
    reason = "rounding is the point, and the step mends its direction"
)]
fn round_down(x: f64) -> f32 {
    let nearest = x as f32;
    let steps = i32::from(f64::from(nearest) > x);
    let bits = nearest.to_bits().cast_signed();
    let downwards = (bits >> 31) | 1;
    f32::from_bits((bits - steps * downwards).cast_unsigned())
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
    fn rounding_goes_one_way_only() {
        let tiny = f64::from(f32::from_bits(1));
        for x in [
            0.0,
            -0.0,
            1.0,
            0.1,
            -0.1,
            1e-60,
            -1e-60,
            0.6 * tiny,
            -0.6 * tiny,
            1e39,
            -1e39,
            f64::from(f32::MAX) * 1.000_000_01,
        ] {
            let (down, up) = (round_down(x), round_up(x));
            assert!(
                f64::from(down) <= x && x <= f64::from(up),
                "{x}: {down} {up}"
            );
            let is_tight = down == up || down.next_up() == up;
            assert!(is_tight, "{x}: {down} {up}");
        }
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
