//! Nothing gets out of a closed mesh.

use kd_oracle::watertight::{check_closed, closed_meshes};

use crate::check::{Subject, check};

/// From a few points in each of the three that are not small: these structures are slow.
#[test]
fn closed_meshes_hold_every_ray() {
    for (name, mesh, inside) in closed_meshes().into_iter().take(3) {
        let [default, fine, _] = Subject::all(&mesh);
        let subjects = [default, fine];
        check_closed(&name, &mesh, &inside[..4], |ray| {
            check(&name, &mesh, &subjects, ray)
        });
    }
}
