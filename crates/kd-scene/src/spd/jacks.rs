//! jacks: every cross of cylinders and spheres contains eight crosses of half its size.

use glam::{DMat3, DVec3, Vec3};

use super::balls::rotation;
use super::{CameraAndLights, camera_and_lights};
use crate::Camera;
use crate::tessellate::{MeshDraft, UnitSphere};

/// Coarser than in the other scenes.
const RESOLUTION: u32 = 2;

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let tilt = rotation(DVec3::X, (-30.0_f64).to_radians());
    let frame = rotation(DVec3::Y, (-20.0_f64).to_radians()) * tilt;
    grow(
        &mut draft,
        &UnitSphere::new(RESOLUTION),
        size,
        DVec3::ZERO,
        frame,
    );
    let CameraAndLights { camera, lights } =
        camera_and_lights([0.0, 0.0, -8.0], [0.0; 3], &[[-10.0, 3.0, -20.0]]);
    (
        draft,
        CameraAndLights {
            camera: Camera {
                up: Vec3::Y,
                fov_degrees: 25.0,
                ..camera
            },
            lights,
        },
    )
}

/// Adds a jack whose arms are the columns of `frame`, and `depth - 1` generations in its octants.
fn grow(draft: &mut MeshDraft, unit: &UnitSphere, depth: u32, center: DVec3, frame: DMat3) {
    // The factor keeps neighbors from overlapping.
    let arms = [frame.x_axis, frame.y_axis, frame.z_axis].map(|arm| arm * 0.75);
    let scale = arms[0].length();
    for arm in arms {
        draft.cone(
            RESOLUTION,
            (center - arm, 0.1 * scale),
            (center + arm, 0.1 * scale),
        );
        draft.sphere(unit, center - arm, 0.2 * scale);
        draft.sphere(unit, center + arm, 0.2 * scale);
    }
    if depth > 1 {
        for octant in 0..8 {
            let sign = |axis: u32| if octant & 1 << axis == 0 { -0.5 } else { 0.5 };
            let center = center + frame * DVec3::new(sign(0), sign(1), sign(2));
            grow(draft, unit, depth - 1, center, frame * 0.5);
        }
    }
}
