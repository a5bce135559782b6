//! Which triangles have no area: the one rule of all structures.

use glam::{DVec3, Vec3};
use robust::{Coord, orient2d};

/// Whether the area of a triangle is exactly zero: its corners are on one line, or equal.
///
/// Exact for all finite corners: where rounding could decide, an adaptive predicate does (J. Shewchuk, *Adaptive Precision
/// Floating-Point Arithmetic and Fast Robust Geometric Predicates*, 1997). A triangle without area is never hit.
///
/// ```
/// use glam::Vec3;
/// use kd_core::is_zero_area;
///
/// let [a, b] = [Vec3::ZERO, Vec3::new(0.1, 0.2, 0.3)];
/// assert!(is_zero_area([a, b, 4.0 * b]), "on a line");
/// assert!(!is_zero_area([a, b, 3.0 * b]), "rounding moves the third corner off the line");
/// ```
#[inline]
pub fn is_zero_area(corners: [Vec3; 3]) -> bool {
    !surely_has_area(corners) && has_none_exactly(corners)
}

/// A cross product in f32 that differs from zero by more than its error.
#[inline]
fn surely_has_area(corners: [Vec3; 3]) -> bool {
    /// Far more than the rounding of differences, products and their difference: 4 · 2⁻²⁴.
    const ERROR: f32 = 1e-5;
    /// Far more than products lose where they underflow.
    const UNDERFLOW: f32 = 1e-30;
    // Number by number: an array of vectors would go through memory, in pieces that the processor waits for.
    let [a, b, c] = corners;
    let (e, f) = (b - a, c - a);
    let differ = |p: f32, q: f32| (p - q).abs() > (p.abs() + q.abs()) * ERROR + UNDERFLOW;
    // False for NaN, where products overflow.
    differ(e.y * f.z, e.z * f.y) | differ(e.z * f.x, e.x * f.z) | differ(e.x * f.y, e.y * f.x)
}

/// The corners are on a line if their projections along all three axes are.
#[cold]
fn has_none_exactly(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let is_line = |across: fn(DVec3) -> [f64; 2]| {
        let [a, b, c] = [a, b, c].map(|corner| {
            let [x, y] = across(corner);
            Coord { x, y }
        });
        orient2d(a, b, c) == 0.0
    };
    is_line(|p| [p.x, p.y]) && is_line(|p| [p.y, p.z]) && is_line(|p| [p.z, p.x])
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// In integers of 128 bits, for coordinates that are integers.
    fn by_integers(corners: [[i32; 3]; 3]) -> bool {
        let [a, b, c] = corners.map(|corner| corner.map(i128::from));
        let edge = |to: [i128; 3]| [0, 1, 2].map(|axis: usize| to[axis] - a[axis]);
        let (e, f) = (edge(b), edge(c));
        (0..3).all(|axis| {
            let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
            e[y] * f[z] == e[z] * f[y]
        })
    }

    #[allow(clippy::cast_precision_loss, reason = "of at most 24 bits")]
    fn floats(corners: [[i32; 3]; 3]) -> [Vec3; 3] {
        corners.map(|corner| Vec3::from_array(corner.map(|x| x as f32)))
    }

    const MOST: i32 = 1 << 24;

    proptest! {
        #[test]
        fn it_is_exact(
            a in prop::array::uniform3(-MOST..=MOST),
            step in prop::array::uniform3(-1000_i32..=1000),
            times in prop::array::uniform2(-4000_i32..=4000),
            shift in prop::array::uniform3(-1_i32..=1),
            scale in -60_i32..=60,
        ) {
            // Corners on a line, or up to one unit off it.
            let along = |times: i32, shift: [i32; 3]| {
                let place = |axis: usize| a[axis] / 2 + step[axis] * times + shift[axis];
                [0, 1, 2].map(|axis: usize| place(axis).clamp(-MOST, MOST))
            };
            let corners = [a.map(|x| x / 2), along(times[0], [0; 3]), along(times[1], shift)];
            let scale = 2.0_f32.powi(scale);
            let scaled = floats(corners).map(|corner| corner * scale);
            prop_assert_eq!(is_zero_area(scaled), by_integers(corners), "{:?}", corners);
        }
    }

    #[test]
    fn extremes_are_decided() {
        let at = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
        let rows = [
            ([at(0.0, 0.0, 0.0); 3], true, "a point"),
            (
                [
                    at(0.0, 0.0, 0.0),
                    at(f32::MAX, 0.0, 0.0),
                    at(0.0, f32::MAX, 0.0),
                ],
                false,
                "huge",
            ),
            (
                [
                    at(-f32::MAX, 0.0, 0.0),
                    at(f32::MAX, 0.0, 0.0),
                    at(0.0, 1e-45, 0.0),
                ],
                false,
                "a sliver",
            ),
            (
                [at(0.0, 0.0, 0.0), at(1e-45, 0.0, 0.0), at(0.0, 1e-45, 0.0)],
                false,
                "tiny",
            ),
            (
                [at(1e30, 1.0, 1.0), at(1.0, 1.0, 1.0), at(2.0, 1.0, 1.0)],
                true,
                "far apart on a line",
            ),
            (
                [
                    at(1e30, 1.0, 1.0),
                    at(1.0, 1.0, 1.0),
                    at(2.0, 1.0, 1.0 + f32::EPSILON),
                ],
                false,
                "off it",
            ),
        ];
        for (corners, expected, name) in rows {
            assert_eq!(is_zero_area(corners), expected, "{name}");
        }
    }
}
