//! The contents of structures over degenerate meshes.

use std::sync::Arc;

use glam::Vec3;
use kd_core::Mesh;
use kd_oracle::scenes::Soup;

use crate::check::Pair;

#[test]
fn an_empty_mesh_stores_nothing() {
    let mesh = Arc::new(Mesh::new(vec![[1.0; 3]], vec![]).expect("valid"));
    for pair in Pair::all(&mesh) {
        for stats in pair.stats() {
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
    let mesh = Arc::new(soup.mesh());
    for pair in Pair::all(&mesh) {
        for stats in pair.stats() {
            assert!(stats.references >= mesh.len(), "all are kept: {stats:?}");
        }
    }
}
