//! jacks: crosses of cylinders and spheres, eight half-sized ones in every one.

use glam::{DMat3, DVec3, Vec3};

use super::balls::rotation;
use super::{Look, look};
use crate::Camera;
use crate::tessellate::{Draft, UnitSphere};

/// Coarser than in the other scenes.
const RESOLUTION: u32 = 2;

pub(super) fn make(size: u32) -> (Draft, Look) {
    let mut draft = Draft::default();
    let tilt = rotation(DVec3::X, (-30.0_f64).to_radians());
    let frame = rotation(DVec3::Y, (-20.0_f64).to_radians()) * tilt;
    grow(
        &mut draft,
        &UnitSphere::new(RESOLUTION),
        size,
        DVec3::ZERO,
        frame,
    );
    let Look { camera, lights } = look([0.0, 0.0, -8.0], [0.0; 3], &[[-10.0, 3.0, -20.0]]);
    (
        draft,
        Look {
            camera: Camera {
                up: Vec3::Y,
                fov_degrees: 25.0,
                ..camera
            },
            lights,
        },
    )
}

/// A jack in `frame`, whose columns are its arms, and `depth - 1` generations in its octants.
fn grow(draft: &mut Draft, unit: &UnitSphere, depth: u32, center: DVec3, frame: DMat3) {
    // Shrunk so that neighbours do not overlap.
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
