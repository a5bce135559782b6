//! The trials of every structure.

use std::sync::Arc;

use kd_core::Mesh;
use kd_oracle::trials::{self, Structure, Trial};

use crate::check::{Pair, planes};

fn build(mesh: &Arc<Mesh>) -> Vec<Structure<'_>> {
    let pairs = Pair::all(mesh).into_iter();
    pairs
        .flat_map(|Pair { bvh, wide, .. }| {
            let planes = planes(&bvh);
            [
                Structure::new(bvh, planes),
                Structure::new(wide, Vec::new()),
            ]
        })
        .collect()
}

fn run(_name: &str, trial: Trial) {
    trial(&trials::Subject {
        build,
        rays: 10_000,
        points: 6,
    });
}

kd_oracle::trials!(run);
