//! Every query in every tree is equal to brute force, bit for bit.

use kd_core::Mesh;
use kd_oracle::effort;
use kd_sah::{BuildOptions, Method, build};

use crate::check::{self, Subject, check};
use crate::random_tree::random_tree;
use crate::scenes;

const RAYS: usize = effort::count(2_000, 100_000);

#[track_caller]
fn check_scene(name: &str, mesh: &Mesh, rays: usize) {
    let median = BuildOptions::default()
        .with_method(Method::Median)
        .with_max_depth(9);
    let trees = [
        build(mesh, &BuildOptions::best()).expect("valid"),
        random_tree(mesh, 1),
        build(mesh, &median).expect("valid"),
        random_tree(mesh, 2),
    ]
    .map(|tree| Subject::new(mesh, tree));
    for tree in &trees {
        let coverage = tree.check_coverage(mesh);
        assert_eq!(
            coverage,
            Ok(()),
            "{name}: bad or good, but nothing is missing"
        );
    }
    let [best, bad @ ..] = &trees;
    let mut source = check::rays(mesh, &trees, 9);
    let mut hit = 0;
    for number in 0..rays {
        let trees = [best, &bad[number % bad.len()]];
        hit += usize::from(check(name, mesh, trees, &source.draw()) > 0);
    }
    assert!(10 * hit >= 3 * rays, "{name}: {hit} of {rays} rays hit");
}

/// A test for each scene, so that they run side by side.
macro_rules! scenes {
    ($($name:ident),*) => {
        $(
            #[test]
            fn $name() {
                check_scene(stringify!($name), &scenes::$name(), RAYS);
            }
        )*
    };
}

scenes!(room, soup, slivers, duplicates, flat, stadium, bumpy);

#[test]
fn sphere() {
    check_scene("sphere", &scenes::sphere(2), RAYS);
}

#[test]
fn cube() {
    check_scene("cube", &scenes::cube(4), RAYS);
}
