//! sombrero: a hat-shaped height field.

use std::f64::consts::TAU;

use glam::DVec3;

use super::{CameraAndLights, camera_and_lights};
use crate::Camera;
use crate::tessellate::MeshDraft;

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let side = 16 << size;
    let mut corners = Vec::new();
    for row in 0..side {
        for column in 0..side {
            // The samples end one step before +4, as in the original ...
            let sample = |step: u32| 8.0 * f64::from(step) / f64::from(side) - 4.0;
            let distance = libm::hypot(sample(column), sample(row));
            let height = 3.0 * libm::cos(TAU * distance) * libm::exp(-distance);
            // ... and are stretched to the whole field. Heights are along y.
            let coordinate = |step: u32| 8.0 * f64::from(step) / f64::from(side - 1) - 4.0;
            corners.push(draft.vertex(DVec3::new(coordinate(column), height, coordinate(row))));
        }
    }
    let corner = |row: u32, column: u32| corners[(row * side + column) as usize];
    for row in 0..side - 1 {
        for column in 0..side - 1 {
            draft.quad([
                corner(row, column),
                corner(row + 1, column),
                corner(row + 1, column + 1),
                corner(row, column + 1),
            ]);
        }
    }
    let CameraAndLights { camera, lights } =
        camera_and_lights([0.0, 5.0, -8.0], [0.0; 3], &[[10.0, 10.0, -10.0]]);
    (
        draft,
        CameraAndLights {
            camera: Camera {
                fov_degrees: 40.0,
                ..camera
            },
            lights,
        },
    )
}
