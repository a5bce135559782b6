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
    for &point in clipped(corners, cell).points() {
        around.add(point);
    }
    around.rounded_outwards(cell)
}

/// [`clipped_bounds`] for both parts of a cell that is cut at `position` along `axis`. It clips to the cell once: the lower
/// part's box comes first, then the upper part's.
#[inline]
pub fn clipped_halves(
    corners: [Vec3; 3],
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Option<Aabb>; 2] {
    let along = axis.index();
    let [a, b, c] = corners;
    let (min, max) = (a.min(b).min(c), a.max(b).max(c));
    let is_whole = min.cmpge(cell.min).all() & max.cmple(cell.max).all();
    if is_whole & (min[along] < position) & (position < max[along]) {
        halves_of_whole(corners, cell, along, position).map(Some)
    } else {
        halves_of_part(corners, cell, axis, position)
    }
}

/// Both parts of a triangle inside the cell that the plane cuts: one corner is alone on its side, and two edges cross
/// the plane. Most triangles that builders cut are of this kind, so it is done without a branch, and all but the two
/// crossings in f32, where nothing is rounded.
#[inline]
fn halves_of_whole(corners: [Vec3; 3], cell: &Aabb, along: usize, position: f32) -> [Aabb; 2] {
    /// The corner that is alone, by which corners lie below.
    const ALONE: [usize; 8] = [0, 0, 1, 2, 2, 1, 0, 0];
    let below = corners.map(|corner| corner[along] < position);
    let which = usize::from(below[0]) | usize::from(below[1]) << 1 | usize::from(below[2]) << 2;
    let alone = ALONE[which];
    let [apex, first, second] = [0, 1, 2].map(|at| corners[(alone + at) % 3]);
    let is_apex_below = apex[along] < position;

    let plane = f64::from(position);
    let crossing = |other: Vec3| {
        let [from, to] = [apex, other].map(|end| end.as_dvec3());
        crossing(from, to, along, plane)
    };
    let (p, q) = (crossing(first), crossing(second));
    let cut = Aabb {
        min: Vec3::from_array(p.min(q).to_array().map(round_down)).max(cell.min),
        max: Vec3::from_array(p.max(q).to_array().map(round_up)).min(cell.max),
    };
    let tip = cut.union(&Aabb {
        min: apex,
        max: apex,
    });
    let rest = cut.union(&Aabb {
        min: first.min(second),
        max: first.max(second),
    });
    if is_apex_below {
        [tip, rest]
    } else {
        [rest, tip]
    }
}

/// Both parts of any triangle.
fn halves_of_part(corners: [Vec3; 3], cell: &Aabb, axis: Axis, position: f32) -> [Option<Aabb>; 2] {
    let (mut lower, mut upper) = (Around::NOTHING, Around::NOTHING);
    let (along, plane) = (axis.index(), f64::from(position));
    clipped(corners, cell).for_each_edge(|from, to| {
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
    });
    let (lower_cell, upper_cell) = cell.split(axis, position);
    [
        lower.rounded_outwards(&lower_cell),
        upper.rounded_outwards(&upper_cell),
    ]
}

/// The part of a triangle in a cell: Sutherland and Hodgman's clipping, against the sides that it reaches across.
#[inline]
fn clipped([a, b, c]: [Vec3; 3], cell: &Aabb) -> Polygon {
    let below = a.min(b).min(c).cmplt(cell.min);
    let above = a.max(b).max(c).cmpgt(cell.max);
    let mut polygons = [Polygon::NOTHING; 2];
    let [mut polygon, mut spare] = polygons.each_mut();
    for corner in [a, b, c] {
        polygon.push(corner.as_dvec3());
    }
    for axis in 0..3 {
        if below.test(axis) {
            let plane = f64::from(cell.min[axis]);
            polygon.clip(axis, plane, |x| x < plane, spare);
            std::mem::swap(&mut polygon, &mut spare);
        }
        if above.test(axis) {
            let plane = f64::from(cell.max[axis]);
            polygon.clip(axis, plane, |x| x > plane, spare);
            std::mem::swap(&mut polygon, &mut spare);
        }
    }
    *polygon
}

/// A triangle cut by six planes has at most nine corners.
const MOST_CORNERS: usize = 9;

/// A convex polygon, corners in order.
#[derive(Clone, Copy)]
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

    /// Hands on both ends of each edge.
    #[inline]
    fn for_each_edge(&self, mut use_edge: impl FnMut(DVec3, DVec3)) {
        let mut from = self.points().last().copied().unwrap_or(DVec3::ZERO);
        for &to in self.points() {
            use_edge(from, to);
            from = to;
        }
    }

    /// Keeps what is not outside.
    #[inline]
    fn clip(&self, axis: usize, plane: f64, is_outside: impl Fn(f64) -> bool, kept: &mut Self) {
        kept.count = 0;
        self.for_each_edge(|from, to| {
            let (is_from_outside, is_to_outside) = (is_outside(from[axis]), is_outside(to[axis]));
            if is_from_outside != is_to_outside {
                kept.push(crossing(from, to, axis, plane));
            }
            if !is_to_outside {
                kept.push(to);
            }
        });
    }

    /// Rounding can make a polygon cross a plane more than twice, if only within an ulp; then it may have a corner too
    /// many, which is as good as the last one.
    #[inline]
    fn push(&mut self, point: DVec3) {
        let last = self.count.min(MOST_CORNERS - 1);
        self.corners[last] = point;
        self.count = last + 1;
    }
}

/// Where an edge crosses a plane. The same edge seen from its two ends gives the same point: it starts at the lower
/// end always.
#[inline]
fn crossing(from: DVec3, to: DVec3, axis: usize, plane: f64) -> DVec3 {
    let is_upwards = from[axis] < to[axis];
    let (a, b) = if is_upwards { (from, to) } else { (to, from) };
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

        /// The short way for triangles that nothing else cuts gives what the long way does; corners in the plane included.
        #[test]
        fn whole_triangles_are_cut_alike(corners: [[i8; 3]; 3], axis in 0_usize..3, at: i8, scale in 1e-3_f32..1e3) {
            let corners = corners.map(|corner| scale * Vec3::from_array(corner.map(f32::from)));
            let (axis, position) = (Axis::ALL[axis], scale * f32::from(at));
            let along = corners.map(|corner| corner[axis.index()]);
            prop_assume!(along.iter().any(|&x| x < position) && along.iter().any(|&x| x > position));
            let cell = Aabb::around(corners);
            let short = halves_of_whole(corners, &cell, axis.index(), position);
            prop_assert_eq!(short.map(Some), halves_of_part(corners, &cell, axis, position));
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
