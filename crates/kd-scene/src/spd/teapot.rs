//! teapot: Newell's 32 Bézier patches on a board.
//!
//! The 290 distinct control points are computed from fewer numbers. Rim, body, lid and bottom are six curves that revolve about
//! z in four quarters; handle and spout are two bands of seven cross-sections each, mirrored in y.

use glam::DVec3;

use super::{CameraAndLights, camera_and_lights};
use crate::tessellate::MeshDraft;

/// The four control points of a profile curve: radius, height, and the reach of the inner control points of a quarter circle,
/// in radii.
type Turned = [(f64, f64, f64); 4];

/// The reach of Newell's circles. The best approximation of a circle is 0.5523.
const ROUND: f64 = 0.56;

const TURNED: [Turned; 6] = [
    // rim
    [
        (1.4, 2.4, ROUND),
        (1.3375, 2.53125, ROUND),
        (1.4375, 2.53125, ROUND),
        (1.5, 2.4, ROUND),
    ],
    // body
    [
        (1.5, 2.4, ROUND),
        (1.75, 1.875, ROUND),
        (2.0, 1.35, ROUND),
        (2.0, 0.9, ROUND),
    ],
    [
        (2.0, 0.9, ROUND),
        (2.0, 0.45, ROUND),
        (1.5, 0.225, ROUND),
        (1.5, 0.15, ROUND),
    ],
    // lid: one circle of its knob has another reach
    [
        (0.0, 3.15, ROUND),
        (0.8, 3.15, 0.5625),
        (0.0, 2.85, ROUND),
        (0.2, 2.7, ROUND),
    ],
    [
        (0.2, 2.7, ROUND),
        (0.4, 2.55, ROUND),
        (1.3, 2.55, ROUND),
        (1.3, 2.4, ROUND),
    ],
    // bottom
    [
        (1.5, 0.15, ROUND),
        (1.5, 0.075, ROUND),
        (1.425, 0.0, ROUND),
        (0.0, 0.0, ROUND),
    ],
];

/// A cross-section of a band: `[x, z]` of its inner and outer edge, and half its width in y.
type Section = ([f64; 2], [f64; 2], f64);

const HANDLE: [Section; 7] = [
    ([-1.6, 2.025], [-1.5, 2.25], 0.3),
    ([-2.3, 2.025], [-2.5, 2.25], 0.3),
    ([-2.7, 2.025], [-3.0, 2.25], 0.3),
    ([-2.7, 1.8], [-3.0, 1.8], 0.3),
    ([-2.7, 1.575], [-3.0, 1.35], 0.3),
    ([-2.5, 1.125], [-2.65, 0.9375], 0.3),
    ([-2.0, 0.9], [-1.9, 0.6], 0.3),
];

const SPOUT: [Section; 7] = [
    ([1.7, 1.425], [1.7, 0.6], 0.66),
    ([2.6, 1.425], [3.1, 0.825], 0.66),
    ([2.3, 2.1], [2.4, 2.025], 0.25),
    ([2.7, 2.4], [3.3, 2.4], 0.25),
    ([2.8, 2.475], [3.525, 2.49375], 0.25),
    ([2.9, 2.475], [3.45, 2.5125], 0.15),
    ([2.8, 2.4], [3.2, 2.4], 0.15),
];

/// The control points of a patch: four rows of four.
type Patch = [[DVec3; 4]; 4];

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    for patch in patches() {
        tessellate(&mut draft, &patch, size);
    }
    let across = |step: u32| 4.0 * (2.0 * f64::from(step) / f64::from(size) - 1.0);
    for x in 0..size {
        for y in 0..size {
            let corners = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
            let corners = corners.map(|(x, y)| DVec3::new(across(x), across(y), 0.0));
            let corners = corners.map(|corner| draft.vertex(corner));
            draft.quad(corners);
        }
    }
    (
        draft,
        camera_and_lights(
            [4.86, 7.2, 5.4],
            [0.0; 3],
            &[[-3.1, 9.8, 12.1], [11.3, 5.1, 8.8]],
        ),
    )
}

fn patches() -> Vec<Patch> {
    let mut patches = Vec::with_capacity(32);
    for curve in TURNED {
        // The quarters are in clockwise order as seen from above.
        for (from, to) in [
            (DVec3::X, DVec3::NEG_Y),
            (DVec3::NEG_Y, DVec3::NEG_X),
            (DVec3::NEG_X, DVec3::Y),
            (DVec3::Y, DVec3::X),
        ] {
            patches.push(curve.map(|(radius, height, reach)| {
                [(1.0, 0.0), (1.0, reach), (reach, 1.0), (0.0, 1.0)]
                    .map(|(a, b)| radius * (a * from + b * to) + height * DVec3::Z)
            }));
        }
    }
    for band in [HANDLE, SPOUT] {
        for sections in [&band[..4], &band[3..]] {
            for side in [-1.0, 1.0] {
                let half = |&(inner, outer, width): &Section| {
                    let point = |[x, z]: [f64; 2], y: f64| DVec3::new(x, y, z);
                    let y = side * width;
                    let row = [
                        point(inner, 0.0),
                        point(inner, y),
                        point(outer, y),
                        point(outer, 0.0),
                    ];
                    // The mirrored half is reversed, so that both halves face outwards.
                    if side < 0.0 {
                        row
                    } else {
                        [row[3], row[2], row[1], row[0]]
                    }
                };
                patches.push(std::array::from_fn(|row| half(&sections[row])));
            }
        }
    }
    patches
}

/// Adds `size` × `size` cells of two triangles, without triangles that have two corners on the axis.
fn tessellate(draft: &mut MeshDraft, patch: &Patch, size: u32) {
    let parameter = |step: u32| f64::from(step) / f64::from(size);
    let mut corners = Vec::new();
    for row in 0..=size {
        for column in 0..=size {
            let position = surface_point(patch, parameter(row), parameter(column));
            let on_axis = position.x.abs() < 1e-4 && position.y.abs() < 1e-4;
            corners.push((draft.vertex(position), on_axis));
        }
    }
    let corner = |row: u32, column: u32| corners[(row * (size + 1) + column) as usize];
    for row in 0..size {
        for column in 0..size {
            let [a, b, c, d] = [
                corner(row, column),
                corner(row, column + 1),
                corner(row + 1, column + 1),
                corner(row + 1, column),
            ];
            for triangle in [[a, b, c], [a, c, d]] {
                if triangle.iter().filter(|(_, on_axis)| *on_axis).count() < 2 {
                    draft.triangle(triangle.map(|(vertex, _)| vertex));
                }
            }
        }
    }
}

fn surface_point(patch: &Patch, u: f64, v: f64) -> DVec3 {
    curve_point(patch.map(|row| curve_point(row, v)), u)
}

fn curve_point([a, b, c, d]: [DVec3; 4], t: f64) -> DVec3 {
    let s = 1.0 - t;
    s * s * s * a + 3.0 * s * s * t * b + 3.0 * s * t * t * c + t * t * t * d
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn control_points_are_newells() {
        let patches = patches();
        let round = |point: &DVec3| (*point * 1e5).round().as_i64vec3();
        let distinct: HashSet<_> = patches.iter().flatten().flatten().map(round).collect();
        assert_eq!((patches.len(), distinct.len()), (32, 290), "as published");
        for known in [
            [1.3375, -0.749, 2.53125],
            [0.84, 1.5, 0.075],
            [-0.45, 0.8, 3.15],
            [-2.65, 0.3, 0.9375],
        ] {
            assert!(
                distinct.contains(&round(&DVec3::from(known))),
                "{known:?} is missing"
            );
        }
        let mirrored = |point: &glam::I64Vec3| glam::I64Vec3::new(point.x, -point.y, point.z);
        assert!(
            distinct
                .iter()
                .all(|point| distinct.contains(&mirrored(point))),
            "mirrored in y"
        );
    }

    #[test]
    fn the_surface_has_the_known_bounds() {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for patch in patches() {
            for step in 0..=20 * 20 {
                let (u, v) = (f64::from(step / 20) / 20.0, f64::from(step % 20) / 20.0);
                let point = surface_point(&patch, u, v);
                (low, high) = (low.min(point), high.max(point));
            }
        }
        assert!((low - DVec3::new(-3.0, -2.0, 0.0)).length() < 0.01, "{low}");
        assert!(
            (high - DVec3::new(3.434, 2.0, 3.15)).length() < 0.01,
            "{high}"
        );
    }

    /// Walks around every patch. Two adjacent patches must traverse their common edge in opposite directions.
    #[test]
    fn patches_are_consistently_oriented() {
        let mut open = HashSet::new();
        for patch in patches() {
            let column = |index: usize| [0, 1, 2, 3].map(|row| patch[row][index]);
            let back = |[a, b, c, d]: [DVec3; 4]| [d, c, b, a];
            for edge in [patch[0], column(3), back(patch[3]), back(column(0))] {
                if edge.iter().all(|point| point.distance(edge[0]) < 1e-9) {
                    continue; // the top of the lid and the middle of the bottom
                }
                let key = |edge: [DVec3; 4]| {
                    edge.map(|point| (point * 1e5).round().as_i64vec3().to_array())
                };
                if !open.remove(&key(back(edge))) {
                    assert!(
                        open.insert(key(edge)),
                        "two patches have opposite orientations: {edge:?}"
                    );
                }
            }
        }
        // The open edges are four quarters of the inner edge of the rim and of the outer edge of the lid, and two halves at
        // either end of handle and spout.
        assert_eq!(open.len(), 4 + 4 + 8, "{open:?}");
    }

    #[test]
    fn body_and_bands_face_outwards() {
        for (index, patch) in patches().iter().enumerate() {
            let mut draft = MeshDraft::default();
            tessellate(&mut draft, patch, 6);
            let mesh = draft.into_mesh().expect("a mesh");
            for triangle in 0..u32::try_from(mesh.len()).expect("72 triangles") {
                let [a, b, c] = mesh.corners(triangle);
                let (normal, middle) = ((b - a).cross(c - a), (a + b + c) / 3.0);
                let outwards = match index {
                    4..12 => middle - glam::Vec3::new(0.0, 0.0, 1.2),
                    24..32 if middle.y.abs() > 0.2 => glam::Vec3::Y * middle.y,
                    _ => continue,
                };
                assert!(
                    normal.dot(outwards) > 0.0,
                    "patch {index}, triangle {triangle}"
                );
            }
        }
    }
}
