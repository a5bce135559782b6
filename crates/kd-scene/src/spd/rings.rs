//! rings: a pyramid of interlocking rings, each of five spheres and five cylinders.

use std::f64::consts::{FRAC_PI_8, PI, TAU};

use glam::DVec3;

use super::balls::rotation;
use super::{CameraAndLights, camera_and_lights};
use crate::tessellate::{MeshDraft, RESOLUTION, UnitSphere};

const RADIUS: f64 = 0.07412;

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let unit = UnitSphere::new(RESOLUTION);
    let spread = 1.0 / libm::sin(FRAC_PI_8);
    let eye = DVec3::new(-1.0, -spread, 0.5);

    // The wall is slightly larger than the view.
    let wall_y = spread * f64::from(size + 1);
    let half = 1.01 * (wall_y - eye.y) * libm::tan(FRAC_PI_8);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, z)| DVec3::new(eye.x + half * x, wall_y, eye.z + half * z));
    let corners = corners.map(|corner| draft.vertex(corner));
    draft.quad(corners);

    let object = pentagons();
    for layer in 0..size {
        let across = |index: u32| 2.0 * f64::from(index) - f64::from(layer);
        for z in 0..=layer {
            for x in 0..=layer {
                let center = DVec3::new(across(x), spread * f64::from(layer + 1), across(z));
                for pentagon in &object {
                    for (index, &corner) in pentagon.iter().enumerate() {
                        let last = center + pentagon[(index + 4) % 5];
                        let corner = center + corner;
                        draft.cone(RESOLUTION, (corner, RADIUS), (last, RADIUS));
                        draft.sphere(&unit, corner, RADIUS);
                    }
                }
            }
        }
    }
    let eye = eye.as_vec3();
    let target = [eye.x, eye.y + 1.0, eye.z];
    let lights = [[3.0, eye.y, 3.0], [-4.0, eye.y, 1.0], [2.0, eye.y, -4.0]];
    (draft, camera_and_lights(eye.to_array(), target, &lights))
}

/// Six pentagons whose corners are the midpoints of the edges of a dodecahedron. With spheres at the corners, they touch the
/// unit sphere from inside.
fn pentagons() -> [[DVec3; 5]; 6] {
    let mut corner = 0.0;
    let first = [(); 5].map(|()| {
        let (sine, cosine) = libm::sincos(corner * TAU / 5.0);
        corner += 1.0;
        DVec3::new(cosine, sine, 0.0) / (1.0 + RADIUS)
    });
    let tilt = 2.0 * libm::acos(libm::cos(PI / 3.0) / libm::sin(PI / 5.0));
    let tilt = rotation(DVec3::X, tilt);
    let mut pentagons = [first; 6];
    let mut fifth = 0.0;
    for pentagon in &mut pentagons[1..] {
        let turn = rotation(DVec3::Z, PI * (2.0 * fifth + 1.0) / 5.0);
        fifth += 1.0;
        *pentagon = first.map(|corner| turn * (tilt * corner));
    }
    pentagons
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_are_those_of_an_icosidodecahedron() {
        let all: Vec<DVec3> = pentagons().into_iter().flatten().collect();
        let mut neighbors = 0;
        for (index, corner) in all.iter().enumerate() {
            assert!(
                (corner.length() * (1.0 + RADIUS) - 1.0).abs() < 1e-12,
                "{corner}"
            );
            for other in &all[index + 1..] {
                let apart = (*corner - *other).length() * (1.0 + RADIUS);
                assert!(apart > 0.6, "{corner} and {other} are the same corner");
                // The edges of an icosidodecahedron subtend 36 degrees.
                let edge = 2.0 * libm::sin(PI / 10.0);
                neighbors += usize::from((apart - edge).abs() < 1e-6);
            }
        }
        assert_eq!(
            (all.len(), neighbors),
            (30, 60),
            "an icosidodecahedron has 60 edges"
        );
    }
}
