//! Nothing gets out of a closed mesh.

use kd_oracle::check;
use kd_oracle::watertight::{check_closed, closed_meshes};

use crate::subject::{Subject, all};

#[test]
fn closed_meshes_hold_every_ray() {
    for (name, mesh, inside) in closed_meshes() {
        let grids = Subject::several(&mesh);
        check_closed(&name, &mesh, &inside, |ray| {
            check(&name, &mesh, &all(&grids), ray)
        });
    }
}
