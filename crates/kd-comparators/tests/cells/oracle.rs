//! Every query equals brute force, bit for bit, on scenes that are not small.

use std::slice;
use std::sync::Arc;

use glam::Vec3;
use kd_comparators::CellOptions;
use kd_core::Mesh;
use kd_oracle::effort;
use kd_scene::Spd;

use crate::check::{Pair, check, rays};
use crate::scenes::Soup;

const RAYS: usize = effort::count(1_000, 5_000);

#[track_caller]
fn check_scene(name: &str, mesh: &Arc<Mesh>, count: usize) {
    check_pairs(name, mesh, &Pair::all(mesh), count);
}

/// The pairs take turns, ray by ray.
#[track_caller]
fn check_pairs(name: &str, mesh: &Mesh, pairs: &[Pair], count: usize) {
    let mut source = rays(mesh, 9);
    let hit = (0..count)
        .filter(|number| {
            let pair = &pairs[number % pairs.len()];
            check(name, mesh, slice::from_ref(pair), &source.draw()) > 0
        })
        .count();
    assert!(4 * hit >= count, "{name}: {hit} of {count} rays hit");
}

/// A test for each of the generated scenes.
macro_rules! generated {
    ($($name:ident: $scene:ident, $size:literal;)*) => {
        $(
            #[test]
            fn $name() {
                let mesh = Arc::new(Spd::$scene.generate($size).expect("valid").mesh);
                let default = Pair::new(&mesh, &CellOptions::default());
                check_pairs(stringify!($name), &mesh, &[default], RAYS);
            }
        )*
    };
}

generated! {
    gears: Gears, 1;
    mount: Mount, 2;
    teapot: Teapot, 3;
    tetra: Tetra, 4;
    jacks: Jacks, 1;
}

/// A room a million times as wide as the object in it.
#[test]
fn a_small_object_in_a_huge_room() {
    let object = Spd::Teapot.generate(2).expect("valid").mesh;
    let mut walls = Soup::default();
    walls.cuboid(Vec3::splat(-3e6), Vec3::new(2e6, 4e6, 5e6));
    let mesh = Arc::new(Mesh::concatenated([&object, &walls.mesh()]).expect("few"));
    check_scene("teapot in a room", &mesh, RAYS);
}

/// Triangles in one place, and as many that differ by a unit in the last place of a coordinate.
#[test]
fn thousands_of_coincident_triangles() {
    let mut soup = Soup::default();
    let [a, b, c] = [[0.1, 0.2, 0.3], [1.7, 0.4, 0.9], [0.3, 1.5, -0.8]].map(Vec3::from);
    for number in 0..1000 {
        soup.triangle([a, b, c]);
        let mut nudged = c;
        nudged[number % 3] = nudged[number % 3].next_up();
        soup.triangle([b, nudged, a]);
    }
    let mesh = Arc::new(soup.mesh());
    let default = Pair::new(&mesh, &CellOptions::default());
    check_pairs("coincident", &mesh, &[default], 600);
}
