//! The uniform grid.

use std::sync::Arc;

use kd::Mesh;
use kd_grid::{GridOptions, Overlap, UniformGrid};

use super::{Ours, Single};
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
    let measured = Measured::try_of(|| UniformGrid::build(Arc::clone(mesh), &options))?;
    Ok(measured.into_built(|grid, _| Box::new(Single(grid))))
}

impl Ours for UniformGrid {
    fn shape(&self) -> Shape {
        let stats = self.stats().with_zero_area(self.mesh().zero_area_count());
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
