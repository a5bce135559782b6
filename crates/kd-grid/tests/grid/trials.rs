//! What every structure is put through.

use kd_core::Mesh;
use kd_oracle::trials::{self, Structures, Trial};

use crate::subject::Subject;

fn build(mesh: &Mesh) -> Structures<'_> {
    let grids = Subject::several(mesh).into_iter();
    grids.map(|grid| Box::new(grid) as _).collect()
}

fn run(_name: &str, trial: Trial) {
    trial(&trials::Subject {
        build,
        rays: 15_000,
        points: usize::MAX,
    });
}

kd_oracle::trials!(run);
