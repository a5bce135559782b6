//! The uniform grid.

use std::sync::Arc;

use kd::{Hit, Mesh, Ray};
use kd_grid::{GridOptions, Overlap, UniformGrid};

use crate::record::Steps;
use crate::structure::{BuilderName, Built, Measured, Shape, Structure};

/// A grid, and the mesh that its queries take.
struct OverMesh {
    grid: UniformGrid,
    mesh: Arc<Mesh>,
}

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
    Ok(measured.into_built(|grid, _| Box::new(OverMesh { grid, mesh })))
}

impl Structure for OverMesh {
    fn closest(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.grid.intersect(&self.mesh, ray);
        }
    }

    fn any(&self, rays: &[Ray], hits: &mut [bool]) {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.grid.occluded(&self.mesh, ray);
        }
    }

    fn counted(&self, _: &Ray) -> Option<(Option<Hit>, Steps)> {
        None
    }

    fn shape(&self) -> Shape {
        let stats = self.grid.stats();
        Shape {
            leaves: stats.cells,
            empty_leaves: stats.empty_cells,
            refs: stats.references,
            bytes_total: stats.bytes,
            text: stats
                .with_zero_area(self.mesh.zero_area_count())
                .to_string(),
            ..Shape::unknown()
        }
    }

    fn flaw(&self) -> Option<String> {
        None
    }
}
