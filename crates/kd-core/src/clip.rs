//! Clipping a triangle to a box: the basis of *perfect splits*.

use glam::{DVec3, Vec3};

use crate::{Aabb, Axis};

/// The box around the intersection of a triangle with `cell`, or `None` if they do not meet.
///
/// The original triangle is clipped in f64 (Wald and Havran 2006 §4.1.1, Havran and Bittner 2002). The result is rounded
/// outwards and intersected with the cell, so that the box is too small by at most the rounding of f64. A triangle that
/// only touches the cell counts as inside. Constant time.
pub fn clipped_bounds(corners: [Vec3; 3], cell: &Aabb) -> Option<Aabb> {
    let mut bounds = GrowingBox::EMPTY;
    for &point in clipped(corners, cell).points() {
        bounds.add(point);
    }
    bounds.rounded_outwards(cell)
}

/// [`clipped_bounds`] for both children of a cell that is split at `position` along `axis`: the lower child's box first,
/// then the upper child's. It clips to the cell only once. Constant time.
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
        halves_of_clipped(corners, cell, axis, position)
    }
}

/// Both halves of a triangle that is inside the cell and crosses the plane. One corner is alone on its side, and two edges
/// cross the plane.
///
/// Most triangles that builders cut are of this kind. The code therefore has no branch, and only the two crossings need
/// f64: minima and maxima of f32 are exact.
#[inline]
fn halves_of_whole(corners: [Vec3; 3], cell: &Aabb, along: usize, position: f32) -> [Aabb; 2] {
    /// The corner that is alone, indexed by a bit mask of the corners below the plane.
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

/// Both halves of any triangle, which is first clipped to the cell.
fn halves_of_clipped(
    corners: [Vec3; 3],
    cell: &Aabb,
    axis: Axis,
    position: f32,
) -> [Option<Aabb>; 2] {
    let (mut lower, mut upper) = (GrowingBox::EMPTY, GrowingBox::EMPTY);
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

/// The intersection of a triangle with a cell, by Sutherland and Hodgman's clipping. Only faces of the cell that the
/// triangle's box crosses are clipped against.
#[inline]
fn clipped([a, b, c]: [Vec3; 3], cell: &Aabb) -> Polygon {
    let below = a.min(b).min(c).cmplt(cell.min);
    let above = a.max(b).max(c).cmpgt(cell.max);
    let mut polygons = [Polygon::EMPTY; 2];
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

/// A triangle clipped by six planes has at most nine corners.
const MAX_CORNERS: usize = 9;

/// A convex polygon, corners in order.
#[derive(Clone, Copy)]
struct Polygon {
    corners: [DVec3; MAX_CORNERS],
    count: usize,
}

impl Polygon {
    const EMPTY: Self = Self {
        corners: [DVec3::ZERO; MAX_CORNERS],
        count: 0,
    };

    fn points(&self) -> &[DVec3] {
        &self.corners[..self.count]
    }

    /// Calls `use_edge` with both ends of each edge.
    #[inline]
    fn for_each_edge(&self, mut use_edge: impl FnMut(DVec3, DVec3)) {
        let mut from = self.points().last().copied().unwrap_or(DVec3::ZERO);
        for &to in self.points() {
            use_edge(from, to);
            from = to;
        }
    }

    /// Writes the part of the polygon that is not outside of one plane to `kept`.
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

    /// Adds a corner. Through rounding a polygon can cross a plane more than twice, within one ulp, and get more than
    /// [`MAX_CORNERS`] corners. The last corner is then replaced, since both are the same up to rounding.
    #[inline]
    fn push(&mut self, point: DVec3) {
        let last = self.count.min(MAX_CORNERS - 1);
        self.corners[last] = point;
        self.count = last + 1;
    }
}

/// The point where an edge crosses a plane. The computation always starts at the lower end, so that the two triangles of
/// a shared edge get the same point.
#[inline]
fn crossing(from: DVec3, to: DVec3, axis: usize, plane: f64) -> DVec3 {
    let is_upwards = from[axis] < to[axis];
    let (a, b) = if is_upwards { (from, to) } else { (to, from) };
    let mut point = a + (b - a) * ((plane - a[axis]) / (b[axis] - a[axis]));
    point[axis] = plane;
    point
}

/// A box in f64 that grows to contain points.
struct GrowingBox {
    min: DVec3,
    max: DVec3,
}

impl GrowingBox {
    const EMPTY: Self = Self {
        min: DVec3::INFINITY,
        max: DVec3::NEG_INFINITY,
    };

    #[inline]
    fn add(&mut self, point: DVec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// The box in f32, rounded outwards and moved into the cell; `None` without points.
    ///
    /// Points of a triangle that is 2⁵³ times as large as the cell may be outside by more than the cell's size, so both ends are moved.
    #[inline]
    fn rounded_outwards(&self, cell: &Aabb) -> Option<Aabb> {
        let inside = |corner: Vec3| corner.max(cell.min).min(cell.max);
        (self.min.x <= self.max.x).then(|| Aabb {
            min: inside(Vec3::from_array(self.min.to_array().map(round_down))),
            max: inside(Vec3::from_array(self.max.to_array().map(round_up))),
        })
    }
}

/// The largest f32 not above `x`.
///
/// The direction in which the conversion rounds is unpredictable, so the code avoids a branch: it takes zero or one step
/// towards negative infinity on the bits. Rounding keeps the sign, so that a zero above `x` is -0.0, and one step from it
/// gives the next negative number.
#[inline]
#[allow(
    clippy::cast_possible_truncation,
    reason = "the conversion rounds on purpose, and the step corrects its direction"
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
    fn rounding_is_directed_and_tight() {
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
    fn cutting_off_a_corner_shrinks_the_box() {
        let corners = [
            Vec3::ZERO,
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(0.0, 2.0, 0.0),
        ];
        let cell = Aabb::around([Vec3::new(1.0, 0.0, -1.0), Vec3::new(4.0, 4.0, 1.0)]);
        let clipped = clipped_bounds(corners, &cell).expect("the triangle reaches into the cell");
        assert_eq!(clipped.min, Vec3::new(1.0, 0.0, 0.0), "cut at x = 1");
        assert_eq!(
            clipped.max,
            Vec3::new(2.0, 1.0, 0.0),
            "y is at most 1 where x is at least 1"
        );
    }

    /// Where an edge has a length of 2⁵³ times a coordinate of its lower end, a point on it loses that coordinate.
    #[test]
    fn boxes_of_triangles_far_larger_than_the_cell_are_inside_of_it() {
        let cases = [
            (
                [
                    [-1.797_451_1e-13, 3.055_902_2e-9, 4.254_409_3e-16],
                    [1.784_551_4e17, -1.322_044_6e11, 672.0],
                    [-1.652_538_8e-5, 5.826_450_4e-11, -4.198_227_5e-9],
                ],
                [1.743_218_5e-24, -2.857_569_7e-25, -6.070_568_7e-25],
                [1.988_559e22, 7.500_363_3e-25, 0.0],
            ),
            (
                [
                    [-2.395_561e14, -5.836_665e20, -2.479_882_2e8],
                    [-1.328_714_9e-11, 2.872_369e-12, -3.532_127_4e-19],
                    [0.0, 0.0, -3.996_491_4e-5],
                ],
                [-2.980_993_8e22, -1.183_291_4e-27, -5.108_486_5e-24],
                [-1.115_798_95e-4, -2.688_043_5e-28, 1.866_444_9e-27],
            ),
        ];
        for (corners, min, max) in cases {
            let corners = corners.map(Vec3::from_array);
            let cell = Aabb {
                min: Vec3::from_array(min),
                max: Vec3::from_array(max),
            };
            let position = cell.center().y;
            let (lower, upper) = cell.split(Axis::Y, position);
            let whole = clipped_bounds(corners, &cell);
            let halves = clipped_halves(corners, &cell, Axis::Y, position);
            for (part, cell) in [(whole, cell), (halves[0], lower), (halves[1], upper)] {
                let part = part.expect("the triangle meets both halves");
                let is_inside = cell.min.cmple(part.min) & part.max.cmple(cell.max);
                let is_box = part.min.cmple(part.max);
                assert!((is_inside & is_box).all(), "{part:?} in {cell:?}");
            }
        }
    }

    #[test]
    fn touching_triangles_count_as_inside() {
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
        // A cell inside the triangle's box, but beyond its long edge.
        let corner = Aabb::around([Vec3::new(0.6, 0.6, -1.0), Vec3::new(1.0, 1.0, 1.0)]);
        assert_eq!(
            clipped_bounds(corners, &corner),
            None,
            "the box overlaps, the triangle does not"
        );
    }

    #[test]
    fn degenerate_triangles_are_clipped_too() {
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
        /// Clipping to the cell once and clipping to each child may differ only by rounding.
        #[test]
        fn halves_equal_clipping_to_each_child(a in point(4.0), b in point(4.0), c in point(4.0), axis in 0_usize..3, at in -0.9_f32..1.4) {
            let cell = Aabb::around([Vec3::splat(-1.0), Vec3::splat(1.5)]);
            let (lower, upper) = cell.split(Axis::ALL[axis], at);
            let halves = clipped_halves([a, b, c], &cell, Axis::ALL[axis], at);
            for (half, child) in halves.into_iter().zip([lower, upper]) {
                match (half, clipped_bounds([a, b, c], &child)) {
                    (Some(half), Some(alone)) => {
                        prop_assert!((half.min - alone.min).abs().max_element() < 1e-6, "{half:?} {alone:?}");
                        prop_assert!((half.max - alone.max).abs().max_element() < 1e-6, "{half:?} {alone:?}");
                        prop_assert!(half.intersection(&child) == half);
                    }
                    (half, alone) => prop_assert_eq!(half, alone),
                }
            }
        }

        /// The fast path for triangles inside the cell gives the same boxes as the general path, also with corners in the
        /// plane.
        #[test]
        fn both_paths_agree_on_triangles_inside_the_cell(corners: [[i8; 3]; 3], axis in 0_usize..3, at: i8, scale in 1e-3_f32..1e3) {
            let corners = corners.map(|corner| scale * Vec3::from_array(corner.map(f32::from)));
            let (axis, position) = (Axis::ALL[axis], scale * f32::from(at));
            let along = corners.map(|corner| corner[axis.index()]);
            prop_assume!(along.iter().any(|&x| x < position) && along.iter().any(|&x| x > position));
            let cell = Aabb::around(corners);
            let fast = halves_of_whole(corners, &cell, axis.index(), position);
            prop_assert_eq!(fast.map(Some), halves_of_clipped(corners, &cell, axis, position));
        }

        /// A point of the triangle inside the cell is inside the clipped box, up to the rounding of the point.
        #[test]
        fn the_clipped_box_contains_all_points_in_the_cell(a in point(4.0), b in point(4.0), c in point(4.0), u in 0.0_f64..1.0, v in 0.0_f64..1.0) {
            let cell = Aabb::around([Vec3::splat(-1.0), Vec3::splat(1.5)]);
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            let p = a.as_dvec3() * (1.0 - u - v) + b.as_dvec3() * u + c.as_dvec3() * v;
            let inside = |b: &Aabb, slack: f64| {
                (p + slack).cmpge(b.min.as_dvec3()).all() && (p - slack).cmple(b.max.as_dvec3()).all()
            };
            if inside(&cell, -1e-9) {
                let clipped = clipped_bounds([a, b, c], &cell);
                prop_assert!(clipped.is_some_and(|clipped| inside(&clipped, 1e-9)), "{p} in {clipped:?}");
            }
        }

        #[test]
        fn the_clipped_box_is_inside_both_boxes(a in point(4.0), b in point(4.0), c in point(4.0)) {
            let cell = Aabb::around([Vec3::splat(-1.0), Vec3::splat(1.5)]);
            if let Some(clipped) = clipped_bounds([a, b, c], &cell) {
                let whole = Aabb::around([a, b, c]);
                prop_assert_eq!(clipped.intersection(&cell).intersection(&whole), clipped);
                prop_assert!(!clipped.is_empty());
            }
        }
    }
}
