//! What is kept of meshes that are awkward.

use glam::Vec3;
use kd_core::Mesh;
use kd_oracle::scenes::Soup;

use crate::check::Subject;

#[test]
fn of_nothing_nothing_is_stored() {
    let mesh = Mesh::new(vec![[1.0; 3]], vec![]).expect("valid");
    for subject in Subject::all(&mesh) {
        for stats in [subject.octree.stats(), subject.bsp.stats()] {
            let sizes = (stats.nodes, stats.leaves, stats.references, stats.bytes);
            assert_eq!(sizes, (0, 0, 0, 0), "nothing is stored");
        }
    }
}

#[test]
fn triangles_without_area_are_kept() {
    let mut soup = Soup::default();
    let (a, b) = (Vec3::new(-1.0, 0.0, 1.0), Vec3::new(1.0, 0.3, 1.2));
    for _ in 0..20 {
        for corners in [[a, a, a], [a, b, b], [a, b, a.midpoint(b)]] {
            soup.triangle(corners);
        }
    }
    let mesh = soup.mesh();
    for subject in Subject::all(&mesh) {
        for stats in [subject.octree.stats(), subject.bsp.stats()] {
            assert!(stats.references >= mesh.len(), "all are kept: {stats:?}");
        }
    }
}
