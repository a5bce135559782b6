//! The same cube in every format gives the same hits, and broken files are refused by element or line.

use std::path::PathBuf;

use kd::tree::FileError;
use kd::{BuildOptions, KdTree, Ray, load_mesh};

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
fn a_mesh_is_no_tree() {
    let other = KdTree::load(testdata("cube.obj")).expect_err("another format");
    assert!(matches!(other, FileError::WrongMagic { .. }), "{other}");
}
