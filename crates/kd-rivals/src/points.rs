//! Closest points by rivals.

use kd_core::Mesh;

use crate::{RivalError, crates, embree};

/// A library that finds closest points.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum PointRival {
    /// Embree 3 or 4: a point query with a function in f32, as Open3D has it
    Embree,
    /// The crate `parry3d`
    Parry3d,
}

/// Queries of points.
pub trait PointQueries: Send + Sync {
    /// The distance of each point from the mesh, in scene units, one point after the other. Both slices have the same length.
    fn distances(&self, points: &[[f32; 3]], out: &mut [f32]);
}

impl PointRival {
    /// Builds the structure over a copy of the mesh.
    ///
    /// # Errors
    ///
    /// If the rival is not compiled in or not installed, or if its library refuses the mesh.
    pub fn build(self, mesh: &Mesh, threads: usize) -> Result<Box<dyn PointQueries>, RivalError> {
        match self {
            Self::Embree => embree::points(mesh, threads),
            Self::Parry3d => crates::parry3d_points(mesh),
        }
    }
}
