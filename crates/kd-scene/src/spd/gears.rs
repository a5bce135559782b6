//! gears: layers of interlocking gears with 36 teeth each.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{CameraAndLights, camera_and_lights};
use crate::tessellate::MeshDraft;

const TEETH: u32 = 36;
/// The four corners of a tooth: the angle in tooth pitches, and whether the corner is at the tip.
const TOOTH: [(f64, bool); 4] = [(-0.19, true), (0.19, true), (0.3, false), (0.7, false)];

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    draft.floor(DVec3::ZERO, 2.0);
    let s = f64::from(size);
    let pitch_radius = 1.0 / (s - (s - 1.0) * 0.05);
    let thickness = f64::min(0.1, 1.0 / (2.0 * s));
    for z in 0..size {
        for y in 0..size {
            for x in 0..size {
                let across = |index: u32| -1.0 + pitch_radius * (1.0 + 1.9 * f64::from(index));
                let center = DVec3::new(across(x), across(y), 1.0 - f64::from(z) / s);
                let phase = if (x + y + z) % 2 == 1 {
                    PI / f64::from(TEETH)
                } else {
                    0.0
                };
                gear(&mut draft, center, pitch_radius, thickness, phase);
            }
        }
    }
    let lights = [
        [2.0, 4.0, 4.0],
        [-2.0, 4.0, 3.0],
        [2.0, -2.5, 2.5],
        [-1.0, -4.0, 2.0],
        [-1.111, -2.121, 2.626],
    ];
    (
        draft,
        camera_and_lights([-1.1, -2.1, 2.6], [0.0; 3], &lights),
    )
}

/// Adds a gear with the center of its upper cap at `center`.
fn gear(draft: &mut MeshDraft, center: DVec3, pitch_radius: f64, thickness: f64, phase: f64) {
    let mut outline = |drop: f64| -> Vec<u32> {
        let corners = (0..TEETH).flat_map(|tooth| TOOTH.map(|corner| (tooth, corner)));
        corners
            .map(|(tooth, (at, tip))| {
                let angle = phase + TAU * (f64::from(tooth) + at) / f64::from(TEETH);
                let (sine, cosine) = libm::sincos(angle);
                let radius = pitch_radius * if tip { 0.995 } else { 0.9 };
                draft.vertex(center + DVec3::new(radius * cosine, radius * sine, -drop))
            })
            .collect()
    };
    let (top, bottom) = (outline(0.0), outline(thickness));
    for corners in cap() {
        draft.triangle(corners.map(|corner| top[corner]));
    }
    for [a, b, c] in cap() {
        draft.triangle([c, b, a].map(|corner| bottom[corner]));
    }
    for corner in 0..top.len() {
        let next = (corner + 1) % top.len();
        draft.quad([top[corner], bottom[corner], bottom[next], top[next]]);
    }
}

/// The triangles of the concave outline, without overlap: two for each tooth above the chord between its feet, and a fan for
/// the remaining convex polygon, whose corners are the feet on one circle.
fn cap() -> Vec<[usize; 3]> {
    let teeth = TEETH as usize;
    let mut triangles = Vec::with_capacity(4 * teeth - 2);
    let mut feet = Vec::with_capacity(2 * teeth);
    for tooth in 0..teeth {
        let [tip, next_tip, foot, next_foot] = [0, 1, 2, 3].map(|corner| 4 * tooth + corner);
        let last_foot = (tip + 4 * teeth - 1) % (4 * teeth);
        triangles.push([last_foot, tip, next_tip]);
        triangles.push([last_foot, next_tip, foot]);
        feet.extend([foot, next_foot]);
    }
    triangles.extend(feet[1..].windows(2).map(|edge| [feet[0], edge[0], edge[1]]));
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caps_cover_their_outline_exactly() {
        for phase in [0.0, PI / 36.0] {
            let mut draft = MeshDraft::default();
            gear(&mut draft, DVec3::ZERO, 1.0, 0.1, phase);
            let mesh = draft.into_mesh().expect("a mesh");
            let flat = |corner: usize| mesh.positions()[corner].map(f64::from);
            let twice_area = |[a, b, c]: [[f64; 3]; 3]| {
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            };
            let mut covered = 0.0;
            for corners in cap() {
                let area = twice_area(corners.map(flat)) / 2.0;
                assert!(area > 0.0, "{corners:?} is reversed or has no area");
                covered += area;
            }
            let shoelace = (0..144).map(|corner| {
                let (a, b) = (flat(corner), flat((corner + 1) % 144));
                (a[0] * b[1] - a[1] * b[0]) / 2.0
            });
            let outline: f64 = shoelace.sum();
            assert_eq!(
                cap().len(),
                142,
                "a polygon of n corners has n - 2 triangles"
            );
            assert!(
                (covered / outline - 1.0).abs() < 1e-12,
                "{covered} of {outline}"
            );
            assert_eq!(mesh.bounds().max.z, 0.0);
            assert_eq!(mesh.bounds().min.z, -0.1);
        }
    }
}
