//! Every query is equal to brute force, bit for bit, in scenes that are not small.

use std::slice;

use glam::Vec3;
use kd_core::Mesh;
use kd_oracle::effort;
use kd_scene::Spd;

use crate::check::{Subject, check, rays};
use crate::scenes::Soup;

const RAYS: usize = effort::count(1_000, 5_000);

#[track_caller]
fn check_scene(name: &str, mesh: &Mesh, count: usize) {
    check_subjects(name, mesh, &Subject::all(mesh), count);
}

/// The subjects take turns, ray by ray.
#[track_caller]
fn check_subjects(name: &str, mesh: &Mesh, subjects: &[Subject<'_>], count: usize) {
    let mut source = rays(mesh, subjects, 9);
    let hit = (0..count)
        .filter(|number| {
            let subject = &subjects[number % subjects.len()];
            check(name, mesh, slice::from_ref(subject), &source.draw()) > 0
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
                let mesh = Spd::$scene.generate($size).expect("valid").mesh;
                let default = Subject::new(&mesh, &kd_comparators::Options::default());
                check_subjects(stringify!($name), &mesh, &[default], RAYS);
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

/// A million times as wide as what stands in it.
#[test]
fn a_small_object_in_a_huge_room() {
    let object = Spd::Teapot.generate(2).expect("valid").mesh;
    let mut walls = Soup::default();
    walls.cuboid(Vec3::splat(-3e6), Vec3::new(2e6, 4e6, 5e6));
    let mesh = Mesh::concatenated([&object, &walls.mesh()]).expect("few");
    check_scene("teapot in a room", &mesh, RAYS);
}

/// All in one place, and as many that differ by a unit in the last place of a coordinate.
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
    let mesh = soup.mesh();
    let default = Subject::new(&mesh, &kd_comparators::Options::default());
    check_subjects("coincident", &mesh, &[default], 600);
}
