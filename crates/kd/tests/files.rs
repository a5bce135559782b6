//! The same cube in every format gives the same hits, and broken files are refused by element or line.

use std::path::PathBuf;

use kd::tree::FileError;
use kd::{BuildOptions, KdTree, Ray, load_mesh};
use kd_scene::Spd;

fn testdata(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "../../testdata", name]
        .iter()
        .collect()
}

#[test]
fn the_cube_is_the_same_in_every_format() {
    for name in [
        "cube.obj",
        "cube_ascii.ply",
        "cube_little.ply",
        "cube_big.ply",
    ] {
        let mesh = load_mesh(testdata(name)).expect(name);
        assert_eq!(mesh.len(), 12, "{name}: six quads, fanned");
        let tree = KdTree::build(mesh, &BuildOptions::best()).expect("a tree");
        for axis in 0..3 {
            let mut origin = [0.3, 0.1, -0.4];
            origin[axis] = 3.0;
            let mut direction = [0.0; 3];
            direction[axis] = -1.0;
            let mut hits = vec![];
            tree.hits(&Ray::new(origin, direction), 9, &mut hits);
            let distances: Vec<f32> = hits.iter().map(|hit| hit.t).collect();
            assert_eq!(
                distances,
                [2.0, 4.0],
                "{name}: in through one face and out through the other"
            );
        }
    }
}

#[test]
fn broken_files_are_refused_where_they_are_broken() {
    for (name, what) in [
        ("truncated.ply", "ends at face 5 of 6"),
        ("lying_count.ply", "ends at face 6 of 4000000000"),
        ("not_finite.ply", "line 17: vertex 6 is not finite"),
        (
            "out_of_range.obj",
            "line 17: face 6: index 9 is out of range, there are 8 vertices",
        ),
        ("missing_indices.obj", "line 17: bad face"),
        ("no_such_file.ply", "cannot open"),
        ("README.md", "unknown format"),
    ] {
        let error = load_mesh(testdata(name)).expect_err(name).to_string();
        assert!(
            error.contains(name) && error.contains(what),
            "{name}: {error}"
        );
    }
}

#[test]
fn a_tree_survives_its_file() {
    let path = std::env::temp_dir().join(format!("kd-files-test-{}.kdtree", std::process::id()));
    let scene = Spd::Gears.generate(1).expect("a small size");
    let tree = KdTree::build(scene.mesh, &BuildOptions::best()).expect("a tree");
    tree.save(&path).expect("a folder for temporary files");
    let loaded = KdTree::load(&path).expect("just written");
    assert_eq!(loaded.nodes(), tree.nodes(), "the same nodes");
    assert_eq!(loaded.stats(), tree.stats(), "the same statistics");
    let view = scene.camera.view(1.0);
    let mut hits = 0;
    for pixel in 0..64 * 64 {
        let ray = Ray::new(view.eye, view.through_pixel(pixel % 64, pixel / 64, 64, 64));
        assert_eq!(loaded.intersect(&ray), tree.intersect(&ray), "{ray:?}");
        hits += usize::from(tree.occluded(&ray));
    }
    assert!(hits > 1000, "the scene is in view: {hits}");
    std::fs::remove_file(&path).expect("it is there");

    let gone = KdTree::load(&path).expect_err("it is gone");
    assert!(
        matches!(gone, FileError::Io { .. }) && gone.to_string().contains("kd-files-test"),
        "{gone}"
    );
    let other = KdTree::load(testdata("cube.obj")).expect_err("another format");
    assert!(matches!(other, FileError::WrongMagic { .. }), "{other}");
}
