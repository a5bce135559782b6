//! Triangulation of polygons, the same for all formats.

use earcut::Earcut;
use glam::{DVec2, DVec3};

use crate::report::{Place, Report, WarningCode};

/// The triangles of a polygon.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Triangulation {
    /// Indices of corners.
    pub(crate) triangles: Vec<[usize; 3]>,
    /// What is odd about the polygon, if anything is.
    pub(crate) warning: Option<&'static str>,
}

const NOT_SIMPLE: &str = "a polygon crosses itself or has no area; it becomes a fan of triangles";
const TOO_LONG: &str =
    "a concave polygon has more than 65536 corners; it becomes a fan of triangles";
/// Longer polygons are not clipped: the time of ear clipping grows up to quadratically.
const MOST_CORNERS: usize = 1 << 16;

/// Triangulates a polygon. Convex polygons become a fan from the first corner; concave polygons are triangulated by ear clipping.
/// Polygons that cross themselves, or have no area, become a fan too.
pub(crate) fn triangulate(corners: &[DVec3]) -> Triangulation {
    let count = corners.len();
    let fan = |warning| Triangulation {
        triangles: (2..count).map(|i| [0, i - 1, i]).collect(),
        warning,
    };
    if count <= 3 {
        return fan(None);
    }
    // Far from the origin, areas would cancel.
    let corners: Vec<DVec3> = corners.iter().map(|corner| *corner - corners[0]).collect();
    let normal = newell(&corners).normalize_or_zero();
    if normal == DVec3::ZERO {
        return fan(Some(NOT_SIMPLE));
    }
    if is_convex(&corners, normal) {
        return fan(None);
    }
    if count > MOST_CORNERS {
        return fan(Some(TOO_LONG));
    }
    let (x, y) = normal.any_orthonormal_pair();
    let flat: Vec<[f64; 2]> = corners
        .iter()
        .map(|corner| DVec2::new(corner.dot(x), corner.dot(y)).to_array())
        .collect();
    let mut found: Vec<usize> = Vec::new();
    Earcut::new().earcut(flat.iter().copied(), &[], &mut found);
    let mut triangles: Vec<[usize; 3]> = found.as_chunks::<3>().0.to_vec();
    // Ear clipping may drop corners that repeat, or that are on a straight line: each is the middle of a triangle without area.
    let mut is_used = vec![false; count];
    found.iter().for_each(|corner| is_used[*corner] = true);
    let dropped = (0..count).filter(|corner| !is_used[*corner]);
    triangles.extend(dropped.map(|i| [(i + count - 1) % count, i, (i + 1) % count]));
    if triangles.len() != count - 2 || !covers(&flat, &found) {
        return fan(Some(NOT_SIMPLE));
    }
    Triangulation {
        triangles,
        warning: None,
    }
}

/// The triangles of a face, as numbers of its corners; `corners` are indices of positions. Warns of a face that is not simple, at
/// `place` in `file`.
pub(crate) fn triangles_of_face(
    corners: &[u32],
    positions: &[[f32; 3]],
    file: &str,
    place: impl FnOnce() -> Option<Place>,
    report: &mut Report,
) -> Vec<[usize; 3]> {
    let at = |corner: &u32| DVec3::from(positions[*corner as usize].map(f64::from));
    let points: Vec<DVec3> = corners.iter().map(at).collect();
    let polygon = triangulate(&points);
    if let Some(warning) = polygon.warning {
        report.warn(file, place(), WarningCode::BadPolygon, warning);
    }
    polygon.triangles
}

/// Whether the areas of triangles add up to that of the polygon, as they do where no edges cross.
fn covers(corners: &[[f64; 2]], triangles: &[usize]) -> bool {
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let next = corners.iter().cycle().skip(1);
    let whole: f64 = corners.iter().zip(next).map(|(a, b)| cross(*a, *b)).sum();
    let area = |[a, b, c]: [usize; 3]| {
        let [a, b, c] = [a, b, c].map(|corner| corners[corner]);
        cross([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]).abs()
    };
    let sum: f64 = triangles.as_chunks::<3>().0.iter().copied().map(area).sum();
    (sum - whole.abs()).abs() <= 1e-6 * sum
}
/// A normal of the polygon by M. Newell's method, which works for every shape.
fn newell(corners: &[DVec3]) -> DVec3 {
    let next = corners.iter().cycle().skip(1);
    corners
        .iter()
        .zip(next)
        .fold(DVec3::ZERO, |sum, (a, b)| sum + a.cross(*b))
}

fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let at = |i: usize| corners[i % corners.len()];
    let turns = (0..corners.len()).map(|i| {
        let (before, after) = (at(i + 1) - at(i), at(i + 2) - at(i + 1));
        before.cross(after).dot(normal) / (before.length() * after.length()).max(f64::MIN_POSITIVE)
    });
    // The turn at a corner on a straight line is a rounding error.
    let turns_left = turns.into_iter().all(|turn| turn > -1e-6);
    // A polygon that goes around twice turns left everywhere too, but a fan of it turns back.
    let mut fan = corners[1..].windows(2).map(|edge| {
        let (to_first, to_second) = (edge[0] - corners[0], edge[1] - corners[0]);
        to_first.cross(to_second).dot(normal)
            / (to_first.length() * to_second.length()).max(f64::MIN_POSITIVE)
    });
    turns_left && fan.all(|turn| turn > -1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        let normal = newell(corners).normalize();
        let areas = triangles.iter().map(|triangle| {
            let [a, b, c] = triangle.map(|i| corners[i]);
            0.5 * (b - a).cross(c - a).dot(normal)
        });
        areas
            .map(|area| if area < 0.0 { f64::NAN } else { area })
            .sum()
    }

    #[test]
    fn convex_polygons_become_fans() {
        let corners = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 2.0), (0.0, 1.0)];
        let corners = corners.map(|(x, y)| DVec3::new(x, y, 0.5 * x));
        let fan = triangulate(&corners);
        assert_eq!(fan.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!(fan.warning, None);
    }

    #[test]
    fn concave_polygons_are_covered_exactly_once() {
        // An arrow, seen from both sides, and a comb.
        let arrow = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (3.0, 1.0)];
        let mut comb = vec![(0.0, 0.0), (9.0, 0.0)];
        for tooth in (0..9).rev().map(f64::from) {
            comb.extend([(tooth + 1.0, 2.0), (tooth + 0.5, 0.5)]);
        }
        comb.push((0.0, 2.0));
        for shape in [arrow.to_vec(), arrow.into_iter().rev().collect(), comb] {
            let corners: Vec<DVec3> = shape.iter().map(|(x, y)| DVec3::new(7.0, *x, *y)).collect();
            let Triangulation { triangles, warning } = triangulate(&corners);
            assert_eq!(warning, None, "{shape:?}");
            let whole = 0.5 * newell(&corners).length();
            let sum = area(&corners, &triangles);
            assert!(
                (sum - whole).abs() < 1e-9,
                "{sum} of {whole}: {triangles:?}"
            );
        }
    }

    /// As in a map: the corners are far from the origin, and rounded to `f32`.
    #[test]
    fn concave_polygons_are_covered_far_from_the_origin() {
        let shape = [
            (0.0, 0.0),
            (2.0, 0.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 2.0),
            (0.0, 2.0),
        ];
        for (far, size) in [(400_000.0, 2.0), (50_000.0, 0.2)] {
            let corners: Vec<DVec3> = shape
                .iter()
                .map(|(x, y)| DVec3::new(far + size * x, 1.5 * far + size * y, 0.3 * size * x))
                .map(|corner| corner.as_vec3().as_dvec3())
                .collect();
            for turn in 0..corners.len() {
                let mut corners = corners.clone();
                corners.rotate_left(turn);
                let found = triangulate(&corners);
                assert_eq!(found.warning, None, "{far}, from corner {turn}");
            }
        }
    }

    #[test]
    fn corners_may_repeat_or_be_on_a_line() {
        let shape = [
            (0.0, 0.0),
            (1.0, 0.0),
            (2.0, 0.0),
            (2.0, 1.0),
            (2.0, 1.0),
            (1.0, 1.0),
            (1.0, 1.5),
            (1.0, 2.0),
            (0.0, 2.0),
            (0.0, 1.0),
        ];
        let corners = shape.map(|(x, y)| DVec3::new(x, y, 0.0));
        for turn in 0..corners.len() {
            let mut corners = corners;
            corners.rotate_left(turn);
            let found = triangulate(&corners);
            assert_eq!(
                (found.warning, found.triangles.len()),
                (None, 8),
                "from corner {turn}"
            );
            let sum = area(&corners, &found.triangles);
            assert!((sum - 3.0).abs() < 1e-9, "{sum}: {:?}", found.triangles);
        }
    }

    #[test]
    fn a_long_concave_polygon_is_a_fan() {
        let zigzag = |count: u32| -> Vec<DVec3> {
            let corner = |i: u32| DVec3::new(f64::from(i), f64::from(i % 2), 0.0);
            let mut corners: Vec<DVec3> = (0..count - 1).map(corner).collect();
            corners.push(DVec3::new(f64::from(count / 2), 1e9, 0.0));
            corners
        };
        assert_eq!(triangulate(&zigzag(1000)).warning, None);
        let long = triangulate(&zigzag(70_000));
        assert_eq!(
            (long.warning, long.triangles.len()),
            (Some(TOO_LONG), 69_998)
        );
    }

    #[test]
    fn polygons_without_area_become_fans() {
        let line: Vec<DVec3> = (0..5).map(|i| DVec3::splat(f64::from(i))).collect();
        let fan = triangulate(&line);
        assert_eq!((fan.triangles.len(), fan.warning), (3, Some(NOT_SIMPLE)));
        assert_eq!(triangulate(&line[..2]).triangles, Vec::<[usize; 3]>::new());
    }

    #[test]
    fn polygons_that_cross_themselves_become_fans() {
        // A bow tie, a pentagram, and a loop at the end of a strip.
        let star = [0, 2, 4, 1, 3].map(|corner| {
            let turn = f64::from(corner) * std::f64::consts::TAU / 5.0;
            (libm::cos(turn), libm::sin(turn))
        });
        let bow = [(0.0, 0.0), (2.0, 0.0), (0.0, 1.0), (2.0, 1.0)];
        let ribbon = [
            (0.0, 0.0),
            (4.0, 1.0),
            (5.0, 0.0),
            (5.0, 1.0),
            (4.0, 0.0),
            (0.0, 1.0),
        ];
        for shape in [bow.to_vec(), star.to_vec(), ribbon.to_vec()] {
            let corners: Vec<DVec3> = shape.iter().map(|(x, y)| DVec3::new(*x, *y, 1.0)).collect();
            let found = triangulate(&corners);
            assert_eq!(found.warning, Some(NOT_SIMPLE), "{shape:?}");
            assert_eq!(found.triangles.len(), shape.len() - 2);
        }
    }
}
