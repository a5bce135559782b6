//! Every query of every grid is equal to brute force, bit for bit, in scenes that are not small.

use kd_core::Mesh;
use kd_oracle::check;
use kd_oracle::rays::Rays;
use kd_scene::Spd;

use crate::subject::{Subject, all};

#[track_caller]
fn check_scene(name: &str, mesh: &Mesh, rays: usize) {
    let grids = Subject::several(mesh);
    let borders = grids.iter().flat_map(Subject::borders).collect();
    let mut source = Rays::new(mesh, borders, 21);
    let hit = (0..rays)
        .filter(|_| check(name, mesh, &all(&grids), &source.draw()) > 0)
        .count();
    assert!(10 * hit >= 3 * rays, "{name}: {hit} of {rays} rays hit");
}

/// Larger scenes, with triangles of all sizes, and few rays each.
#[test]
fn generated_scenes() {
    for scene in [Spd::Gears, Spd::Mount, Spd::Balls] {
        let setup = scene.generate(2).expect("small");
        check_scene(&scene.to_string(), &setup.mesh, 300);
    }
}
