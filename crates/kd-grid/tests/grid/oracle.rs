//! Every query of every grid equals brute force, bit for bit, on scenes that are not small.

use std::sync::Arc;

use kd_core::Mesh;
use kd_oracle::check;
use kd_oracle::rays::Rays;
use kd_scene::Spd;

use crate::grids::{borders, queries, several};

#[track_caller]
fn check_scene(name: &str, mesh: &Arc<Mesh>, rays: usize) {
    let grids = several(mesh);
    let borders = grids.iter().flat_map(borders).collect();
    let mut source = Rays::new(mesh, borders, 21);
    let hit = (0..rays)
        .filter(|_| check(name, mesh, &queries(&grids), &source.draw()) > 0)
        .count();
    assert!(10 * hit >= 3 * rays, "{name}: {hit} of {rays} rays hit");
}

/// Larger scenes, with triangles of all sizes, and few rays each.
#[test]
fn generated_scenes() {
    for scene in [Spd::Gears, Spd::Mount, Spd::Balls] {
        let mesh = scene.generate(2).expect("small").mesh;
        check_scene(&scene.to_string(), &Arc::new(mesh), 300);
    }
}
