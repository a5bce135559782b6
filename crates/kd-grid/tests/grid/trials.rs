//! The trials of every structure.

use std::sync::Arc;

use kd_core::Mesh;
use kd_oracle::trials::{self, Structure, Trial};

use crate::grids::{borders, several};

fn build(mesh: &Arc<Mesh>) -> Vec<Structure<'_>> {
    let grids = several(mesh).into_iter();
    grids
        .map(|grid| {
            let borders = borders(&grid);
            Structure::new(grid, borders)
        })
        .collect()
}

fn run(_name: &str, trial: Trial) {
    trial(&trials::Subject {
        build,
        rays: 15_000,
        points: usize::MAX,
    });
}

kd_oracle::trials!(run);
