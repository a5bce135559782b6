//! Triangulation of polygons.

use earcut::Earcut;
use glam::{DVec2, DVec3};

/// The triangles of a polygon, as indices of its corners. Convex polygons become a fan from the first corner; concave polygons
/// are triangulated by ear clipping. Polygons that intersect themselves, or have no area, become a fan too.
pub(super) fn triangles(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let count = corners.len();
    let fan = || (2..count).map(|i| [0, i - 1, i]).collect();
    let normal = newell(corners).normalize_or_zero();
    if count <= 3 || normal == DVec3::ZERO || is_convex(corners, normal) {
        return fan();
    }
    let (x, y) = normal.any_orthonormal_pair();
    let flat: Vec<[f64; 2]> = corners
        .iter()
        .map(|corner| DVec2::new(corner.dot(x), corner.dot(y)).to_array())
        .collect();
    let mut found: Vec<usize> = Vec::new();
    Earcut::new().earcut(flat, &[], &mut found);
    if found.len() != 3 * (count - 2) {
        return fan();
    }
    found.as_chunks::<3>().0.to_vec()
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
    turns.into_iter().all(|turn| turn > -1e-6)
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
        assert_eq!(triangles(&corners), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
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
            let triangles = triangles(&corners);
            let whole = 0.5 * newell(&corners).length();
            let sum = area(&corners, &triangles);
            assert!(
                (sum - whole).abs() < 1e-9,
                "{sum} of {whole}: {triangles:?}"
            );
        }
    }

    #[test]
    fn polygons_without_area_become_fans() {
        let line: Vec<DVec3> = (0..5).map(|i| DVec3::splat(f64::from(i))).collect();
        assert_eq!(triangles(&line).len(), 3);
        assert_eq!(triangles(&line[..2]), Vec::<[usize; 3]>::new());
    }
}
