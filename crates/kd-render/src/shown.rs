//! What the surfaces of a part need at the current time.

use std::sync::Arc;

use kd::Mesh;
use kd::glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec3};
use kd_scene::{InstancePlace, Part};

/// The surfaces of a part at the current time.
#[derive(Clone, Debug)]
pub(crate) struct ShownPart {
    /// The triangles in scene coordinates, of a visible part without instances: for those, the frame computes corners, since it may have no
    /// copies of them.
    pub(crate) mesh: Option<Arc<Mesh>>,
    pub(crate) instances: Vec<ShownInstance>,
    /// Vertex normals of a deformed part, in the coordinates of its node; empty if the part does not deform.
    pub(crate) morphed_normals: Vec<[Vec3; 3]>,
}

/// The surfaces of an instance at the current time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShownInstance {
    /// Transforms vertex normals to scene coordinates.
    pub(crate) inverse_transpose: Mat3A,
    /// Whether the triangles have the reverse order of corners.
    pub(crate) is_mirrored: bool,
}

impl ShownPart {
    /// A part before its mesh is known. `nodes` are the transforms of the nodes at `time`, in seconds.
    pub(crate) fn new(
        part: &Part,
        places: &[InstancePlace],
        nodes: &[DAffine3],
        time: f64,
    ) -> Self {
        let instances = places.iter().map(|place| ShownInstance {
            inverse_transpose: inverse_transpose(&place.transform),
            is_mirrored: place.is_mirrored,
        });
        Self {
            mesh: None,
            instances: instances.collect(),
            morphed_normals: part.deformed_normals(time, nodes).unwrap_or_default(),
        }
    }
}

/// The inverse transpose, which transforms normals; the matrix itself if it is singular.
fn inverse_transpose(transform: &Affine3A) -> Mat3A {
    let matrix = transform.matrix3.as_dmat3();
    if matrix.determinant() == 0.0 {
        return transform.matrix3;
    }
    let matrix = matrix.inverse().transpose();
    let column = |column: DVec3| column.as_vec3().into();
    Mat3A::from_cols(
        column(matrix.x_axis),
        column(matrix.y_axis),
        column(matrix.z_axis),
    )
}
