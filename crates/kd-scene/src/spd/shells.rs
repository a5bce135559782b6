//! shells: a spiral of overlapping spheres, by Pickover.

use std::f64::consts::PI;

use glam::DVec3;

use super::{CameraAndLights, camera_and_lights};
use crate::tessellate::{MeshDraft, RESOLUTION, UnitSphere};

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let unit = UnitSphere::new(RESOLUTION);
    let steps = 180_i32 << size;
    for step in -2 * steps / 3..=steps / 3 {
        let angle = 18.0 * PI * f64::from(step) / f64::from(steps);
        let radius = libm::exp(0.15 * angle);
        let (sine, cosine) = libm::sincos(angle);
        draft.sphere(&unit, radius * DVec3::new(sine, cosine, -2.0), radius);
    }
    (
        draft,
        camera_and_lights(
            [-6.0, -60.0, 35.0],
            [0.0, 8.0, -15.0],
            &[[-100.0, -100.0, 100.0]],
        ),
    )
}
