//! The uniform grid.

use std::sync::Arc;

use kd::{Hit, Mesh, Ray};
use kd_grid::{GridOptions, Overlap, UniformGrid};

use super::{OverMesh, WithMesh};
use crate::structure::{BuilderName, Built, Measured, Shape};

pub(crate) fn build(
    builder: BuilderName,
    mesh: &Arc<Mesh>,
    threads: usize,
) -> anyhow::Result<Built> {
    let overlap = match builder {
        BuilderName::Boxes => Overlap::Box,
        _ => Overlap::Exact,
    };
    let options = GridOptions::new()
        .with_overlap(overlap)
        .with_threads(threads);
    let measured = Measured::try_of(|| UniformGrid::build(mesh, &options))?;
    let mesh = Arc::clone(mesh);
    Ok(measured.into_built(|structure, _| Box::new(WithMesh { structure, mesh })))
}

impl OverMesh for UniformGrid {
    fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        self.intersect(mesh, ray)
    }

    fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool {
        self.occluded(mesh, ray)
    }

    fn shape(&self, mesh: &Mesh) -> Shape {
        let stats = self.stats().with_zero_area(mesh.zero_area_count());
        Shape {
            leaves: stats.cells,
            empty_leaves: stats.empty_cells,
            refs: stats.references,
            bytes_total: stats.bytes,
            text: stats.to_string(),
            ..Shape::unknown()
        }
    }
}
