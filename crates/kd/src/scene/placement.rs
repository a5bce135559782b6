//! Where a part is in its scene.

use glam::{Affine3A, DAffine3};
use kd_core::{Mesh, MeshError};

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
