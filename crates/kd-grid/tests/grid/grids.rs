//! Grids under test.

use std::sync::Arc;

use kd_core::{Hit, Mesh};
use kd_grid::{GridOptions, Overlap, UniformGrid};
use kd_trace::RayQuery;

/// A grid, with options that must be valid.
pub(crate) fn grid(mesh: &Arc<Mesh>, options: &GridOptions) -> UniformGrid {
    UniformGrid::build(Arc::clone(mesh), options).expect("valid options")
}

/// Grids of few cells and of many, by box and exact.
pub(crate) fn several(mesh: &Arc<Mesh>) -> Vec<UniformGrid> {
    let by_box = GridOptions::new().with_overlap(Overlap::Box);
    let options = [
        GridOptions::new(),
        GridOptions::new().with_density(40.0),
        GridOptions::new().with_density(100.0),
        by_box.clone().with_density(0.3),
        by_box.with_density(7.0),
    ];
    options.iter().map(|options| grid(mesh, options)).collect()
}

/// Axis and position of the borders between cells.
pub(crate) fn borders(grid: &UniformGrid) -> Vec<(usize, f32)> {
    let bounds = grid.mesh().bounds();
    let along = |axis: usize| {
        let cells = grid.resolution()[axis];
        (0..=cells).map(move |i| {
            let share = i as f32 / cells as f32;
            let position = bounds.min[axis] * (1.0 - share) + bounds.max[axis] * share;
            (axis, position)
        })
    };
    (0..3).flat_map(along).collect()
}

/// As the oracle takes them.
pub(crate) fn queries(grids: &[UniformGrid]) -> Vec<&dyn RayQuery<Hit = Hit>> {
    grids.iter().map(|grid| grid as _).collect()
}
