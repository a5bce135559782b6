//! balls: every sphere carries nine spheres of a third of its radius.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use glam::{DMat3, DQuat, DVec3};

use super::{CameraAndLights, camera_and_lights};
use crate::tessellate::{MeshDraft, RESOLUTION, UnitSphere};

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    draft.floor(DVec3::new(0.0, 0.0, -0.5), 12.0);
    let grower = Grower {
        unit: UnitSphere::new(RESOLUTION),
        nine: nine_directions(),
    };
    grower.grow(&mut draft, size, DVec3::ZERO, 0.5, DVec3::Z);
    let lights = [[4.0, 3.0, 2.0], [1.0, -4.0, 4.0], [-3.0, 1.0, 5.0]];
    (draft, camera_and_lights([2.1, 1.3, 1.7], [0.0; 3], &lights))
}

struct Grower {
    unit: UnitSphere,
    nine: [DVec3; 9],
}

impl Grower {
    /// Adds a sphere whose axis is `direction`, and nine smaller spheres on it, recursively to `depth`.
    fn grow(
        &self,
        draft: &mut MeshDraft,
        depth: u32,
        center: DVec3,
        radius: f64,
        direction: DVec3,
    ) {
        draft.sphere(&self.unit, center, radius);
        if depth == 0 {
            return;
        }
        let turn = turn_from_z(direction);
        for child in self.nine {
            let child = turn * child;
            let apart = radius + radius / 3.0;
            self.grow(
                draft,
                depth - 1,
                center + apart * child,
                radius / 3.0,
                child,
            );
        }
    }
}

/// The directions of the nine spheres on a sphere whose axis is +z: three groups of three, 120 degrees apart.
fn nine_directions() -> [DVec3; 9] {
    const D: f64 = FRAC_1_SQRT_2;
    let tilt = rotation(DVec3::new(D, -D, 0.0), libm::asin(2.0 / libm::sqrt(6.0)));
    let trio = [
        DVec3::new(D, D, 0.0),
        DVec3::new(D, 0.0, -D),
        DVec3::new(0.0, D, -D),
    ];
    let mut third = 0.0;
    let trios = [(); 3].map(|()| {
        let turn = rotation(DVec3::Z, third * TAU / 3.0);
        third += 1.0;
        trio.map(|direction| turn * (tilt * direction))
    });
    std::array::from_fn(|index| trios[index / 3][index % 3])
}

/// The shortest rotation from +z to `direction`.
fn turn_from_z(direction: DVec3) -> DMat3 {
    if direction.z >= 0.9999 {
        DMat3::IDENTITY
    } else if direction.z <= -0.9999 {
        DMat3::from_cols(DVec3::NEG_X, DVec3::Y, DVec3::NEG_Z)
    } else {
        DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, direction.normalize()))
    }
}

/// A rotation about the unit vector `axis`, counter-clockwise as seen from its tip.
pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sine, cosine) = libm::sincos(angle);
    let column = |v: DVec3| v * cosine + axis.cross(v) * sine + axis * axis.dot(v) * (1.0 - cosine);
    DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nine_spheres_do_not_overlap() {
        let nine = nine_directions();
        for (index, direction) in nine.iter().enumerate() {
            assert!((direction.length() - 1.0).abs() < 1e-12, "{direction}");
            for other in &nine[index + 1..] {
                // The centers are at a distance of 4/3 R and the radii are R/3: spheres touch at an angle of 2 asin(1/4).
                let apart = (*direction - *other).length() * 4.0 / 3.0;
                assert!(apart >= 2.0 / 3.0 - 1e-9, "{direction} and {other} overlap");
            }
        }
        assert!(
            nine.iter().all(|direction| direction.z > -0.6),
            "no sphere is at the contact with the parent"
        );
    }

    #[test]
    fn turn_from_z_maps_z_to_the_direction() {
        for direction in [DVec3::X, DVec3::NEG_Z, DVec3::Z, DVec3::new(1.0, -2.0, 3.0)] {
            let direction = direction.normalize();
            assert!(
                (turn_from_z(direction) * DVec3::Z - direction).length() < 1e-12,
                "{direction}"
            );
        }
    }
}
