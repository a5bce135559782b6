//! One mesh of all parts of a scene, with a copy for each instance.

use std::borrow::Cow;

use kd_core::{Mesh, MeshError};
use thiserror::Error;

use crate::SceneDescription;
use crate::description::mirrors;
use crate::draft::MOST_REPEATED;

/// Why the triangles of a scene cannot be one mesh.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum WholeMeshError {
    /// A position is not finite in f32, or there are too many triangles.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Copies of the meshes of instances would be far larger than the scene.
    #[error(
        "copies of all instances have {elements} vertices and triangles, more than {MOST_REPEATED} beyond those of the scene"
    )]
    TooManyCopies {
        /// The number of vertices and triangles, with a copy for each instance.
        elements: usize,
    },
}

impl SceneDescription {
    /// All triangles at `time`, in seconds, as one mesh in the order of the parts, and of the instances of each. Invisible parts are
    /// included. Time and memory are linear in the number of triangles, with a copy for each instance.
    ///
    /// # Errors
    ///
    /// [`WholeMeshError`] if a position is not finite in `f32`, or the mesh has too many vertices or triangles.
    pub fn mesh_at(&self, time: f64) -> Result<Mesh, WholeMeshError> {
        self.check_copies()?;
        let nodes = self.placed_nodes(time);
        let mut meshes = Vec::new();
        for part in &self.parts {
            let to = Self::placed_part(part, &nodes);
            let mesh = match part.deformed(time, &nodes) {
                Some(positions) => Cow::Owned(part.mesh.with_positions(positions)?),
                None => Cow::Borrowed(&*part.mesh),
            };
            if part.instances.is_empty() {
                meshes.push(mesh.transformed(&to)?);
                continue;
            }
            let is_mirrored = part.instances.iter().any(mirrors);
            let mirrored = is_mirrored.then(|| reversed(&mesh)).transpose()?;
            for instance in &part.instances {
                let mirrored = mirrored.as_ref().filter(|_| mirrors(instance));
                let mesh = mirrored.unwrap_or(&mesh).transformed_f64(instance)?;
                meshes.push(mesh.transformed(&to)?);
            }
        }
        Ok(Mesh::concatenated(&meshes)?)
    }

    /// Refuses copies that a short file may have any number of.
    fn check_copies(&self) -> Result<(), WholeMeshError> {
        let (mut own, mut copied) = (0_usize, 0_usize);
        for part in &self.parts {
            let elements = part.mesh.positions().len() + part.mesh.len();
            own = own.saturating_add(elements);
            copied = copied.saturating_add(elements.saturating_mul(part.copies()));
        }
        if copied > own.saturating_add(MOST_REPEATED) {
            return Err(WholeMeshError::TooManyCopies { elements: copied });
        }
        Ok(())
    }
}

/// The mesh with the reverse order of corners.
fn reversed(mesh: &Mesh) -> Result<Mesh, MeshError> {
    let triangles = mesh.triangles().iter().map(|[a, b, c]| [*a, *c, *b]);
    Mesh::new(mesh.positions().to_vec(), triangles.collect())
}
