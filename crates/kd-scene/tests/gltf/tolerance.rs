//! What others read, and what a lenient reader leaves out.

use glam::Vec3;
use kd_scene::WarningCode;
use serde_json::json;

use crate::file::{File, TRIANGLE, read, read_bytes};
use crate::moving;

#[test]
fn what_nothing_uses_cannot_be_wrong() {
    let mut file = moving();
    let materials = file["materials"].as_array_mut().expect("an array");
    materials.push(json!({ "alphaMode": 7, "pbrMetallicRoughness": "none" }));
    file["samplers"] = json!([{ "wrapS": 1 }]);
    file["images"]
        .as_array_mut()
        .expect("an array")
        .push(json!({}));
    file["buffers"]
        .as_array_mut()
        .expect("an array")
        .push(json!({ "uri": "none.bin", "byteLength": 9 }));
    file["extras"] = json!(3.5);
    file["nodes"][0]["extras"] = json!("by hand");
    let scene = read(&file).expect("valid");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(scene.materials.len(), 2, "those that are used");
}

#[test]
fn a_bad_material_is_replaced() {
    let mut file = moving();
    file["materials"][0]["pbrMetallicRoughness"]["metallicFactor"] = json!("much");
    let scene = read(&file).expect("the geometry is fine");
    let warning = &scene.warnings[0];
    assert_eq!(warning.code, WarningCode::BadMaterial);
    let text = warning.to_string();
    let expected = "a/scene.gltf: /materials/0/pbrMetallicRoughness/metallicFactor: ";
    assert!(
        text.starts_with(expected) && text.ends_with("using the default material instead"),
        "{text}"
    );
}

#[test]
fn a_file_without_a_scene_is_read_whole() {
    let mut file = moving();
    let whole = read(&file).expect("valid");
    file.as_object_mut().expect("an object").remove("scenes");
    file.as_object_mut().expect("an object").remove("scene");
    let library = read(&file).expect("valid");
    assert_eq!(library.nodes.len(), whole.nodes.len());
    assert_eq!(library.warnings[0].code, WarningCode::NoScene);
    let names = |scene: &kd_scene::SceneDescription| {
        scene
            .parts
            .iter()
            .map(|part| (part.name.clone(), part.mesh.len()))
            .collect::<Vec<_>>()
    };
    assert_eq!(names(&library), names(&whole));
    file.as_object_mut().expect("an object").remove("nodes");
    file.as_object_mut()
        .expect("an object")
        .remove("animations");
    let empty = read(&file).expect("valid");
    assert!(
        empty.parts.is_empty() && empty.warnings[0].code == WarningCode::NoScene,
        "{empty:?}"
    );
}

#[test]
fn key_times_may_be_equal_or_descend() {
    let mut file = File::default();
    let positions = file.floats("VEC3", 3, &TRIANGLE);
    let times = file.floats("SCALAR", 1, &[0.0, 2.0, 1.0, 2.0]);
    let moves = file.floats(
        "VEC3",
        3,
        &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 10.0, 0.0, 0.0, 4.0, 0.0, 0.0],
    );
    let file = file.finish(json!({
        "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
        "animations": [{
            "channels": [
                { "sampler": 0, "target": { "node": 0, "path": "translation" } },
                { "sampler": 9, "target": { "path": "translation" } },
                { "sampler": 0, "target": { "node": 0, "path": "pointer" } },
            ],
            "samplers": [{ "input": times, "output": moves }],
        }],
    }));
    let scene = read(&file).expect("valid");
    for (time, x) in [(0.5, 5.0), (1.0, 10.0), (1.5, 6.0), (2.0, 4.0), (3.0, 4.0)] {
        let corner = scene.mesh_at(time).expect("finite").corners(0)[0];
        assert_eq!(corner, Vec3::new(x, 0.0, 0.0), "{time}");
    }
    let codes: Vec<_> = scene.warnings.iter().map(|warning| warning.code).collect();
    let expected = [
        WarningCode::BadAnimation,
        WarningCode::BadAnimation,
        WarningCode::Unused,
    ];
    assert_eq!(codes, expected);
}

#[test]
fn strides_may_be_zero_but_not_too_short() {
    let mut file = moving();
    file["bufferViews"][0]["byteStride"] = json!(0);
    assert!(read(&file).is_ok(), "zero is as if it were not there");
    file["bufferViews"][0]["byteStride"] = json!(8);
    let error = read(&file).expect_err("too short").to_string();
    let expected =
        "a/scene.gltf: /accessors/0: has values of 12 bytes, but its bufferView a byteStride of 8";
    assert_eq!(error, expected);
}

#[test]
fn compressed_geometry_is_refused_by_name() {
    let mut file = moving();
    for view in file["bufferViews"].as_array_mut().expect("an array") {
        view["extensions"] = json!({ "EXT_meshopt_compression": {} });
    }
    assert!(read(&file).is_ok(), "the buffer has the data too");
    file["buffers"][0]
        .as_object_mut()
        .expect("an object")
        .remove("uri");
    let error = read(&file).expect_err("compressed").to_string();
    assert!(error.contains("EXT_meshopt_compression"), "{error}");

    let mut file = moving();
    file["meshes"][0]["primitives"][0]["extensions"] = json!({ "KHR_draco_mesh_compression": {} });
    assert!(read(&file).is_ok(), "the accessors have the data too");
    file["accessors"][0]
        .as_object_mut()
        .expect("an object")
        .remove("bufferView");
    let error = read(&file).expect_err("compressed").to_string();
    assert!(error.contains("KHR_draco_mesh_compression"), "{error}");
}

#[test]
fn other_versions_are_refused_by_name() {
    for (asset, found) in [
        (
            r#"{"asset": {"version": "1.0"}}"#,
            "the file is glTF 1.0, which is not supported; expected 2.0",
        ),
        (
            r#"{"asset": {"version": "2.0", "minVersion": "3.0"}}"#,
            "the file is glTF 3.0, which is not supported; expected 2.0",
        ),
        (
            r#"{"meshes": {"a": {}}}"#,
            "the file is glTF 1, which is not supported; expected 2.0",
        ),
        (
            r#"{"asset": {"version": 1}}"#,
            "the file is glTF 1, which is not supported; expected 2.0",
        ),
        (r#"{"a": 1}"#, "`asset.version` is missing; expected 2.0"),
    ] {
        let error = read_bytes(asset.as_bytes().to_vec())
            .expect_err(asset)
            .to_string();
        assert_eq!(error, format!("a/scene.gltf: header: {found}"));
    }
}
