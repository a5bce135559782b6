//! lattice: spheres on a grid in the unit cube, connected by cylinders.

use glam::{DVec3, Vec3};

use super::{CameraAndLights, camera_and_lights};
use crate::Camera;
use crate::tessellate::{MeshDraft, RESOLUTION, UnitSphere};

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    let unit = UnitSphere::new(RESOLUTION);
    let cell = 1.0 / f64::from(size);
    let (ball, rod) = (cell / 4.0, cell / 16.0);
    // The rods end inside of the spheres.
    let inset = 0.99 * ball * (1.0 - libm::sqrt(rod / ball));
    for x in 0..=size {
        for y in 0..=size {
            for z in 0..=size {
                let steps = [x, y, z];
                let center = DVec3::from(steps.map(|step| f64::from(step) * cell));
                draft.sphere(&unit, center, ball);
                for (step, axis) in steps.into_iter().zip(DVec3::AXES) {
                    if step < size {
                        let [from, to] = [inset, cell - inset].map(|along| center + along * axis);
                        draft.cone(RESOLUTION, (from, rod), (to, rod));
                    }
                }
            }
        }
    }
    #[expect(
        clippy::cast_precision_loss,
        reason = "sizes are at most a few hundred"
    )]
    let (s, middle) = (size as f32, (size / 2) as f32);
    let (across, inside) = ((middle + 0.5) / s, 1.0 / (2.0 * s));
    let lights = [
        [2.0, 0.5, 0.5],
        [-1.0, 0.5, 0.5],
        [0.5, 2.0, 0.5],
        [0.5, -1.0, 0.5],
        [0.5, 0.5, 2.0],
        [0.5, 0.5, -1.0],
    ];
    let (eye, target) = ([across, 1.0, 1.0 - inside], [across, -1.0, -1.0 - inside]);
    let CameraAndLights { camera, lights } = camera_and_lights(eye, target, &lights);
    let up = Vec3::new(0.2, 1.0, 0.0);
    (
        draft,
        CameraAndLights {
            camera: Camera {
                up,
                fov_degrees: 60.0,
                ..camera
            },
            lights,
        },
    )
}
