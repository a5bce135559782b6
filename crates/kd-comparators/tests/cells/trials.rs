//! The trials of every structure.

use std::sync::Arc;

use kd_core::Mesh;
use kd_oracle::trials::{self, Structure, Trial};

use crate::check::{Pair, planes};

fn build(mesh: &Arc<Mesh>) -> Vec<Structure<'_>> {
    let pairs = Pair::all(mesh).into_iter();
    pairs
        .flat_map(|Pair { octree, bsp }| {
            [
                Structure::new(octree, planes(mesh)),
                Structure::new(bsp, Vec::new()),
            ]
        })
        .collect()
}

/// These structures are slow: fewer rays.
fn run(_name: &str, trial: Trial) {
    trial(&trials::Subject {
        build,
        rays: 5000,
        points: 4,
    });
}

kd_oracle::trials!(run);
