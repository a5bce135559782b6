//! What every structure is put through.

use kd_core::Mesh;
use kd_oracle::trials::{self, Structures, Trial};

use crate::check::Subject;

fn build(mesh: &Mesh) -> Structures<'_> {
    let subjects = Subject::all(mesh).into_iter();
    subjects.map(|subject| Box::new(subject) as _).collect()
}

fn run(_name: &str, trial: Trial) {
    trial(&trials::Subject {
        build,
        rays: 10_000,
        points: 6,
    });
}

kd_oracle::trials!(run);
