//! Every query of every grid is equal to brute force, bit for bit.

use kd_core::Mesh;
use kd_oracle::rays::Rays;
use kd_oracle::{check, scenes};
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

#[test]
fn nasty_scenes() {
    for (name, mesh) in scenes::all() {
        check_scene(name, &mesh, 15_000);
    }
}

/// Scenes of any size anywhere.
#[test]
fn scales_and_offsets() {
    let rows: [(f32, f32); 10] = [
        (1e-38, 0.0),
        (1e-30, 0.0),
        (1e-20, 0.0),
        (1e-6, 1.0),
        (1e-3, 0.0),
        (1.0, 1e5),
        (1e4, 0.0),
        (1e8, -3e9),
        (1e18, 0.0),
        (1e30, 0.0),
    ];
    for (scale, offset) in rows {
        for (name, mesh) in [("soup", scenes::soup()), ("room", scenes::room())] {
            let mesh = scenes::moved(&mesh, |p| p * scale + offset);
            check_scene(&format!("{name} * {scale:e} + {offset:e}"), &mesh, 3000);
        }
    }
}

/// Larger scenes, with triangles of all sizes, and few rays each.
#[test]
fn generated_scenes() {
    for scene in [Spd::Gears, Spd::Mount, Spd::Balls] {
        let setup = scene.generate(2).expect("small");
        check_scene(&scene.to_string(), &setup.mesh, 300);
    }
}
