//! tetra: a Sierpinski tetrahedron.

use glam::{DVec3, Vec3};

use super::{CameraAndLights, camera_and_lights};
use crate::Camera;
use crate::tessellate::MeshDraft;

/// The four corners of a cube that form a tetrahedron: the product of their signs is +1.
const CORNERS: [[f64; 3]; 4] = [
    [1.0, 1.0, 1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
];

pub(super) fn make(size: u32) -> (MeshDraft, CameraAndLights) {
    let mut draft = MeshDraft::default();
    grow(&mut draft, size - 1, DVec3::ZERO, 1.0);
    let eye = [1.022_846, -3.177_154, -2.174_512];
    let CameraAndLights { camera, lights } = camera_and_lights(
        eye,
        [-0.004_103, -0.004_103, 0.216_539],
        &[[2.0, -18.0, -5.0]],
    );
    let up = Vec3::new(-0.816_497, -0.816_497, 0.816_497);
    (
        draft,
        CameraAndLights {
            camera: Camera { up, ..camera },
            lights,
        },
    )
}

/// Adds the tetrahedron in the cube `center` ± `half`, or, if `depth` > 0, four of half the size at its corners.
fn grow(draft: &mut MeshDraft, depth: u32, center: DVec3, half: f64) {
    if depth > 0 {
        for corner in CORNERS {
            grow(
                draft,
                depth - 1,
                center + DVec3::from(corner) * (half / 2.0),
                half / 2.0,
            );
        }
        return;
    }
    let [a, b, c, d] = CORNERS.map(|corner| draft.vertex(center + DVec3::from(corner) * half));
    for face in [[a, b, c], [a, c, d], [a, d, b], [b, d, c]] {
        draft.triangle(face);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_1_is_one_tetrahedron() {
        let (draft, _) = make(1);
        let mesh = draft.into_mesh().expect("a mesh");
        let corners = CORNERS.map(|corner| DVec3::from(corner).as_vec3().to_array());
        assert_eq!(mesh.positions(), corners);
        for triangle in 0..4 {
            let [a, b, c] = mesh.corners(triangle);
            let normal = (b - a).cross(c - a);
            assert_eq!(normal.abs(), Vec3::splat(4.0), "an oblique plane");
            assert!(
                normal.dot(a + b + c) > 0.0,
                "triangle {triangle} faces inwards"
            );
        }
    }
}
