//! tree: Aono and Kunii's tree of cones, on a huge field.

use glam::{DMat3, DVec3};

use super::balls::rotation;
use super::{CameraAndLights, camera_and_lights};
use crate::tessellate::{MeshDraft, RESOLUTION, UnitSphere};

/// Ratio of the radius of a branch to that of its parent, and of its tip to its base.
const TAPER: f64 = 0.67;

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    draft.floor(DVec3::ZERO, 50.0);
    // Length relative to the parent, tilt away from it and rotation around it in degrees.
    let forks = [(0.65, 40.0, 90.0), (0.70, 25.0, 230.0)];
    let grower = Grower {
        unit: UnitSphere::new(RESOLUTION),
        forks: forks.map(|(length, tilt, turn): (f64, f64, f64)| {
            let tilt = rotation(DVec3::X, tilt.to_radians());
            rotation(DVec3::Z, turn.to_radians()) * tilt * length
        }),
    };
    grower.grow(&mut draft, size, DVec3::ZERO, DMat3::IDENTITY, 0.15);
    let lights = [
        [-5.0, 5.0, 50.0],
        [30.0, -30.0, 30.0],
        [-40.0, -30.0, 20.0],
        [10.0, 30.0, 40.0],
        [-30.0, 40.0, 10.0],
        [50.0, 25.0, 20.0],
        [-10.0, -60.0, 30.0],
    ];
    (
        draft,
        camera_and_lights([4.5, 0.4, 2.0], [0.0, 0.0, 1.5], &lights),
    )
}

struct Grower {
    unit: UnitSphere,
    forks: [DMat3; 2],
}

impl Grower {
    /// Adds a branch from `base` along the z axis of `frame`, and two branches at its tip, recursively to `depth`.
    fn grow(&self, draft: &mut MeshDraft, depth: u32, base: DVec3, frame: DMat3, radius: f64) {
        let tip = base + frame.z_axis;
        draft.cone(RESOLUTION, (base, radius), (tip, TAPER * radius));
        draft.sphere(&self.unit, tip, TAPER * radius);
        if depth > 0 {
            for fork in self.forks {
                self.grow(draft, depth - 1, tip, frame * fork, TAPER * radius);
            }
        }
    }
}
