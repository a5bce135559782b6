//! Where a part is in its scene.

use glam::{Affine3A, DAffine3, DVec3, Vec3, Vec3A};
use kd_core::{Mesh, MeshError};
use robust::{Coord3D, orient3d};

/// The transform from the coordinates of a part's mesh to those of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Placement {
    /// Applied in f32.
    Single(Affine3A),
    /// Applied in f64, relative to the scene's origin. Positions are rounded once.
    Double(DAffine3),
}

impl Placement {
    pub(super) const IDENTITY: Self = Self::Single(Affine3A::IDENTITY);

    pub(super) fn is_finite(&self) -> bool {
        match self {
            Self::Single(transform) => transform.is_finite(),
            Self::Double(transform) => transform.is_finite(),
        }
    }

    pub(super) fn is_identity(&self) -> bool {
        match self {
            Self::Single(transform) => *transform == Affine3A::IDENTITY,
            Self::Double(transform) => *transform == DAffine3::IDENTITY,
        }
    }

    /// Whether the transform turns the front of triangles to their back: whether its determinant is negative, exactly.
    pub(super) fn is_mirrored(&self) -> bool {
        let columns = match self {
            Self::Single(Affine3A { matrix3, .. }) => {
                [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis].map(Vec3A::as_dvec3)
            }
            Self::Double(DAffine3 { matrix3, .. }) => {
                [matrix3.x_axis, matrix3.y_axis, matrix3.z_axis]
            }
        };
        let [x, y, z] = columns.map(coordinates);
        orient3d(x, y, z, coordinates(DVec3::ZERO)) < 0.0
    }

    /// A point, transformed, about.
    pub(super) fn place_point(&self, point: Vec3) -> Vec3 {
        match self {
            Self::Single(transform) => transform.transform_point3(point),
            Self::Double(transform) => transform.transform_point3(point.as_dvec3()).as_vec3(),
        }
    }

    /// The mesh, transformed.
    pub(super) fn place(&self, mesh: &Mesh) -> Result<Mesh, MeshError> {
        match self {
            Self::Single(transform) => mesh.transformed(transform),
            Self::Double(transform) => mesh.transformed_f64(transform),
        }
    }

    /// The factor by which the transform scales areas, on average.
    pub(super) fn area_scale(&self) -> f64 {
        let volume = match self {
            Self::Single(transform) => f64::from(transform.matrix3.determinant()),
            Self::Double(transform) => transform.matrix3.determinant(),
        };
        volume.abs().powf(2.0 / 3.0)
    }
}

fn coordinates(point: DVec3) -> Coord3D<f64> {
    let [x, y, z] = point.to_array();
    Coord3D { x, y, z }
}

#[cfg(test)]
mod tests {
    use glam::Mat3;

    use super::*;

    #[test]
    fn the_sign_of_a_determinant_is_exact() {
        let scale = |x: f32, y: f32, z: f32| Affine3A::from_scale(Vec3::new(x, y, z));
        let turned = Affine3A::from_rotation_y(1.0) * scale(1.0, -1e-20, 1e-20);
        let tiny = f32::from_bits(1);
        for (transform, expected) in [
            (Affine3A::IDENTITY, false),
            (scale(-1.0, 1.0, 1.0), true),
            (scale(-1.0, -1.0, 1.0), false),
            (scale(-1.0, -1.0, -1e-30), true),
            (scale(-1.0, 1.0, 0.0), false),
            (turned, true),
            (scale(tiny, tiny, -tiny), true),
        ] {
            let single = Placement::Single(transform);
            assert_eq!(single.is_mirrored(), expected, "{transform}");
            let double = Placement::Double(transform.as_daffine3());
            assert_eq!(double.is_mirrored(), expected, "{transform}, in f64");
        }
        // Columns that differ in the last bit.
        let a = Vec3::new(1.0, 2.0, 3.0);
        let b = Vec3::new(1.0, 2.0, 3.0_f32.next_up());
        let of = |x: Vec3, y: Vec3| {
            let matrix = Mat3::from_cols(x, y, Vec3::X);
            Placement::Single(Affine3A::from_mat3(matrix))
        };
        assert_ne!(of(a, b).is_mirrored(), of(b, a).is_mirrored());
    }
}
