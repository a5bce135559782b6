//! Morph targets.

use glam::Vec3;
use kd_scene::SceneDescription;
use serde_json::{Value, json};

use crate::file::{File, TRIANGLE, read};

/// A triangle with two targets: one lifts the second corner along z, the other moves all along x and tilts the normals.
fn with_targets(mut file: File) -> (File, Value) {
    let positions = file.floats("VEC3", 3, &TRIANGLE);
    let normals = file.floats("VEC3", 3, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let lift = file.floats("VEC3", 3, &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let shift = file.floats("VEC3", 3, &[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let primitive = json!({
        "attributes": { "POSITION": positions, "NORMAL": normals },
        "targets": [{ "POSITION": lift }, { "POSITION": shift, "NORMAL": shift }],
    });
    (file, primitive)
}

#[test]
fn constant_weights_change_the_mesh() {
    let (file, primitive) = with_targets(File::default());
    let mut file = file.finish(json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [primitive], "weights": [0.5, 0] }],
    }));
    let at_rest = read(&file).expect("valid");
    assert_eq!(
        at_rest.parts[0].mesh.corners(0)[1],
        Vec3::new(1.0, 0.0, 0.5)
    );
    file["nodes"][0]["weights"] = json!([0, 3]);
    let of_node = read(&file).expect("valid");
    assert_eq!(
        of_node.parts[0].mesh.corners(0)[1],
        Vec3::new(4.0, 0.0, 0.0)
    );
    let normal = of_node.parts[0].surface.normals[0][0];
    assert!(
        normal.distance(Vec3::new(3.0, 0.0, 1.0).normalize()) < 1e-6,
        "{normal}"
    );
    assert!(
        of_node.parts[0].deformation.is_none() && of_node.warnings.is_empty(),
        "static"
    );
}

#[test]
fn animated_weights_deform_the_part() {
    let (mut file, primitive) = with_targets(File::default());
    let times = file.floats("SCALAR", 1, &[0.0, 2.0]);
    let weights = file.floats("SCALAR", 1, &[0.0, 0.0, 1.0, 2.0]);
    let joints = file.add(&[0; 12], 5121, "VEC4", 3, None);
    let influences = file.floats("VEC4", 4, &[1.0, 0.0, 0.0, 0.0].repeat(3));
    let mut file = file.finish(json!({
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0, "translation": [0, 10, 0] }, { "translation": [0, 0, 100] }],
        "meshes": [{ "primitives": [primitive] }],
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
            "samplers": [{ "input": times, "output": weights }],
        }],
    }));
    let corner =
        |scene: &SceneDescription, time: f64| scene.mesh_at(time).expect("finite").corners(0)[1];
    let scene = read(&file).expect("valid");
    assert_eq!(scene.span.map(|span| span.end), Some(2.0));
    assert_eq!(corner(&scene, 0.0), Vec3::new(1.0, 10.0, 0.0));
    assert_eq!(corner(&scene, 1.0), Vec3::new(2.0, 10.0, 0.5));
    assert_eq!(corner(&scene, 2.0), Vec3::new(3.0, 10.0, 1.0));
    let normals = scene.parts[0].deformed_normals(2.0, &scene.placed_nodes(2.0));
    assert_eq!(normals, Some(vec![[Vec3::new(2.0, 0.0, 1.0); 3]]));

    // A skin moves what the targets have changed, and ignores the transform of its node.
    let primitive = &mut file["meshes"][0]["primitives"][0];
    primitive["attributes"]["JOINTS_0"] = json!(joints);
    primitive["attributes"]["WEIGHTS_0"] = json!(influences);
    file["nodes"][0]["skin"] = json!(0);
    file["skins"] = json!([{ "joints": [1] }]);
    let scene = read(&file).expect("valid");
    assert_eq!(corner(&scene, 1.0), Vec3::new(2.0, 0.0, 100.5));
    let normals = scene.parts[0].deformed_normals(2.0, &scene.placed_nodes(2.0));
    assert_eq!(normals, Some(vec![[Vec3::new(2.0, 0.0, 1.0); 3]]));

    file["accessors"][5]["count"] = json!(3);
    let error = read(&file)
        .expect_err("three weights for two keys")
        .to_string();
    assert_eq!(
        error,
        "a/scene.gltf: /animations/0/samplers/0: has 2 key times, but 3 values"
    );
}

/// A node that scales makes normals shorter and offsets of positions longer; normals keep their direction.
#[test]
fn normals_of_targets_do_not_depend_on_scale() {
    for scale in [0.01, 1.0, 100.0] {
        let (mut file, primitive) = with_targets(File::default());
        let times = file.floats("SCALAR", 1, &[0.0, 1.0]);
        let weights = file.floats("SCALAR", 1, &[0.0, 0.0, 0.0, 1.0]);
        let moves = file.floats("VEC3", 3, &[0.0; 3]);
        let file = file.finish(json!({
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0, "scale": [scale, scale, scale], "extensions": {
                "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": moves } }
            } }],
            "meshes": [{ "primitives": [primitive] }],
            "animations": [{
                "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
                "samplers": [{ "input": times, "output": weights }],
            }],
        }));
        let scene = read(&file).expect("valid");
        let nodes = scene.placed_nodes(1.0);
        let normals = scene.parts[0]
            .deformed_normals(1.0, &nodes)
            .expect("a deforming part");
        let expected = Vec3::new(1.0, 0.0, 1.0);
        assert!(
            normals[0][0].distance(expected) < 1e-5,
            "{scale}: {}",
            normals[0][0]
        );
        let warning = scene.warnings[0].to_string();
        assert!(
            warning.contains("instances of a mesh that changes its shape"),
            "{warning}"
        );
    }
}

/// An empty primitive between two others, and vertices that no triangle uses.
#[test]
fn arrays_of_vertices_stay_aligned() {
    let mut file = File::default();
    let spread: Vec<f32> = [[9.0; 9], TRIANGLE].concat();
    let positions = file.floats("VEC3", 3, &spread);
    let corners = file.indices(&[3, 4, 5]);
    let empty = file.floats("VEC3", 3, &[0.0; 3]);
    file.accessors[empty]["count"] = json!(0);
    let lift: Vec<f32> = [[0.0; 9], [0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0]].concat();
    let lift = file.floats("VEC3", 3, &lift);
    let joints = file.add(
        &[[7; 12], [0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]].concat(),
        5121,
        "VEC4",
        6,
        None,
    );
    let weights = file.floats("VEC4", 4, &[1.0, 0.0, 0.0, 0.0].repeat(6));
    let times = file.floats("SCALAR", 1, &[0.0, 1.0]);
    let curve = file.floats("SCALAR", 1, &[0.0, 1.0]);
    let whole = json!({
        "attributes": { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights },
        "indices": corners, "targets": [{ "POSITION": lift }],
    });
    let nothing = json!({ "attributes": { "POSITION": empty }, "targets": [{}] });
    let file = file.finish(json!({
        "scenes": [{ "nodes": [0, 1, 2] }],
        "nodes": [{ "mesh": 0, "skin": 0 }, {}, { "translation": [100, 0, 0] }],
        "meshes": [{ "primitives": [whole.clone(), nothing.clone(), whole, nothing] }],
        "skins": [{ "joints": [1, 2] }],
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
            "samplers": [{ "input": times, "output": curve }],
        }],
    }));
    let scene = read(&file).expect("valid");
    assert_eq!(
        scene.parts[0].mesh.positions().len(),
        6,
        "the others are dropped"
    );
    let mesh = scene.mesh_at(1.0).expect("finite");
    let expected = [
        Vec3::new(0.0, 0.0, 1.0),
        Vec3::new(101.0, 0.0, 2.0),
        Vec3::new(100.0, 1.0, 3.0),
    ];
    for triangle in 0..2 {
        assert_eq!(mesh.corners(triangle), expected, "{triangle}");
    }
}
