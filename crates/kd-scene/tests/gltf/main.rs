//! The glTF reader: animated nodes, skins, materials, and errors.

mod extensions;
mod file;
mod instances;
mod morph;
mod tolerance;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use kd_scene::{ColorSpace, SceneDescription, Surface, TextureSource};
use serde_json::{Value, json};

use file::{File, TRIANGLE, read, read_bytes};

/// A static square with a texture, and a triangle on a rotating arm.
pub(crate) fn moving() -> Value {
    let mut file = File::default();
    let square = file.floats(
        "VEC3",
        3,
        &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 2.0, 0.0, 0.0, 2.0, 0.0],
    );
    let corners = file.indices(&[0, 1, 2, 0, 2, 3]);
    let uvs = file.floats("VEC2", 2, &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let triangle = file.floats("VEC3", 3, &TRIANGLE);
    let normals = file.floats("VEC3", 3, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let times = file.floats("SCALAR", 1, &[0.0, 2.0]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = file.floats("VEC4", 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    file.finish(json!({
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "mesh": 0, "translation": [0.0, 0.0, -1.0] },
            { "name": "arm", "translation": [5.0, 0.0, 0.0], "children": [2, 3] },
            { "name": "hand", "mesh": 1, "translation": [1.0, 0.0, 0.0] },
            { "name": "eye", "camera": 0, "translation": [0.0, 0.0, 7.0] },
        ],
        "meshes": [
            { "primitives": [{ "attributes": { "POSITION": square, "TEXCOORD_0": uvs }, "indices": corners, "material": 0 }] },
            { "primitives": [{ "attributes": { "POSITION": triangle, "NORMAL": normals } }] },
        ],
        "materials": [{ "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 1.0, 1.0], "baseColorTexture": { "index": 0 }, "metallicFactor": 0.0,
        } }],
        "textures": [{ "source": 0 }],
        "images": [{ "uri": "wood%20.png" }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }],
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }],
            "samplers": [{ "input": times, "output": turns }],
        }],
    }))
}

#[test]
fn static_and_animated_triangles_are_separate_parts() {
    let scene = read(&moving()).expect("valid");
    assert_eq!(scene.colors, ColorSpace::Linear);
    let names: Vec<_> = scene
        .parts
        .iter()
        .map(|part| (part.name.as_str(), part.mesh.len()))
        .collect();
    assert_eq!(names, [("", 2), ("arm", 1)]);
    let [fixed, arm] = scene.parts.as_slice() else {
        unreachable!("the two parts above");
    };
    assert_eq!(
        fixed.mesh.corners(1)[1],
        Vec3::new(2.0, 2.0, -1.0),
        "transformed by its node"
    );
    assert_eq!(fixed.surface.textures, [0, 0]);
    assert_eq!(fixed.surface.uvs[1], [[0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
    assert_eq!(arm.surface.normals, [[Vec3::Z; 3]]);
    assert_eq!(
        scene.textures[0].source,
        TextureSource::File("a/wood .png".into())
    );
    assert_eq!(scene.materials[0].diffuse, Vec3::new(0.5, 0.25, 1.0));
    let span = scene.span.expect("an animation");
    assert_eq!((span.end, span.frames), (2.0, 51));
    // A rotation by 90 degrees about the end of the arm.
    for (time, expected) in [
        (0.0, Vec3::new(7.0, 0.0, 0.0)),
        (2.0, Vec3::new(5.0, 2.0, 0.0)),
    ] {
        let nodes = scene.placed_nodes(time);
        let to = SceneDescription::placed_part(arm, &nodes);
        let corner = to.transform_point3(arm.mesh.corners(0)[1]);
        assert!(corner.distance(expected) < 1e-5, "{time}: {corner}");
    }
    let camera = scene.camera_at(2.0).expect("a camera");
    assert!(
        camera.eye.distance(Vec3::new(5.0, 0.0, 7.0)) < 1e-5,
        "{camera:?}"
    );
    assert!(
        camera.target.distance(Vec3::new(5.0, 0.0, 6.0)) < 1e-5,
        "{camera:?}"
    );
    assert!(
        camera.up.distance(Vec3::NEG_X) < 1e-5,
        "the camera rotates with the arm: {camera:?}"
    );
}

#[test]
fn skins_follow_their_joints() {
    let mut file = File::default();
    let triangle = file.floats("VEC3", 3, &TRIANGLE);
    let joints = file.add(&[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0], 5121, "VEC4", 3, None);
    let weights = file.floats(
        "VEC4",
        4,
        &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0],
    );
    let times = file.floats("SCALAR", 1, &[0.0, 1.0]);
    let moves = file.floats("VEC3", 3, &[0.0, 0.0, 0.0, 0.0, 0.0, 4.0]);
    let file = file.finish(json!({
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "mesh": 0, "skin": 0, "translation": [100.0, 0.0, 0.0] },
            { "children": [2] },
            {},
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": triangle, "JOINTS_0": joints, "WEIGHTS_0": weights } }] }],
        "skins": [{ "joints": [1, 2] }],
        "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 2, "path": "translation" } }],
            "samplers": [{ "input": times, "output": moves }],
        }],
    }));
    let scene = read(&file).expect("valid");
    let nodes = scene.placed_nodes(0.5);
    let positions = scene.parts[0].deformed(0.5, &nodes).expect("a skin");
    assert_eq!(
        positions,
        [[0.0, 0.0, 0.0], [1.0, 0.0, 2.0], [0.0, 1.0, 1.0]],
        "the transform of the node of a skin is ignored"
    );
    assert_eq!(
        scene.mesh_at(0.5).expect("finite positions").corners(0)[2],
        Vec3::new(0.0, 1.0, 1.0)
    );
}

#[test]
fn strips_and_fans_become_triangles() {
    for (mode, expected) in [(5, [[0, 1, 2], [1, 3, 2]]), (6, [[0, 1, 2], [0, 2, 3]])] {
        let mut file = File::default();
        let square = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
        let positions = file.floats("VEC3", 3, &square);
        let file = file.finish(json!({
            "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions }, "mode": mode }] }],
        }));
        let scene = read(&file).expect("valid");
        assert_eq!(scene.parts[0].mesh.triangles(), expected, "mode {mode}");
        assert_eq!(
            scene.parts[0].surface,
            Surface {
                materials: vec![0; 2],
                ..Surface::default()
            }
        );
    }
}

#[test]
fn binary_and_text_files_give_the_same_scene() {
    let mut file = moving();
    let expected = read(&file).expect("text");
    let uri = file["buffers"][0]
        .as_object_mut()
        .expect("an object")
        .remove("uri");
    let uri = uri.expect("the bytes");
    let (_, encoded) = uri.as_str().expect("text").split_once(',').expect("data");
    let mut json = file.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let bytes = STANDARD.decode(encoded).expect("base64");
    let word = |number: usize| {
        u32::try_from(number)
            .expect("fits in 32 bits")
            .to_le_bytes()
    };
    let length = word(28 + json.len() + bytes.len());
    let chunks: [&[u8]; 8] = [
        b"glTF\x02\0\0\0",
        &length,
        &word(json.len()),
        b"JSON",
        &json,
        &word(bytes.len()),
        b"BIN\0",
        &bytes,
    ];
    let binary = chunks.concat();
    let scene = read_bytes(binary.clone()).expect("binary");
    assert_eq!(scene.parts.len(), expected.parts.len());
    for (part, other) in scene.parts.iter().zip(&expected.parts) {
        assert_eq!(part.mesh.positions(), other.mesh.positions());
        assert_eq!(part.surface, other.surface);
    }
    // Every truncated file is an error.
    for end in 0..binary.len() {
        assert!(read_bytes(binary[..end].to_vec()).is_err(), "{end} bytes");
    }
    // The file length in the header is ignored.
    let mut short = binary;
    short[8..12].fill(0);
    assert!(
        read_bytes(short).is_ok(),
        "the lengths of the chunks suffice"
    );
}

/// Sparse positions over a buffer view, or over zeros.
#[test]
fn sparse_accessors_replace_values() {
    let file = |base: bool, count: usize, place: u16| {
        let mut file = File::default();
        let positions = file.floats("VEC3", 3, &TRIANGLE);
        let indices = file.indices(&[0, 1, 2]);
        let places = file.indices(&[1, place]);
        let others = file.floats("VEC3", 3, &[5.0, 0.0, 0.0, 0.0, 7.0, 0.0]);
        let view = |accessor: usize| file.accessors[accessor]["bufferView"].clone();
        let sparse = json!({
            "count": 2,
            "indices": { "bufferView": view(places), "componentType": 5123 },
            "values": { "bufferView": view(others) },
        });
        if !base {
            file.accessors[positions]
                .as_object_mut()
                .expect("an object")
                .remove("bufferView");
        }
        file.accessors[positions]["sparse"] = sparse;
        file.accessors[positions]["count"] = json!(count);
        read(&file.finish(json!({
            "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions }, "indices": indices }] }],
        })))
    };
    let first = Vec3::from_slice(&TRIANGLE);
    for (base, first) in [(true, first), (false, Vec3::ZERO)] {
        let scene = file(base, 3, 2).expect("valid");
        let corners = scene.parts[0].mesh.corners(0);
        assert_eq!(corners, [first, 5.0 * Vec3::X, 7.0 * Vec3::Y], "{base}");
    }
    for (base, count, place, problem) in [
        (true, 3, 3, "has the sparse index 3 out of range"),
        (
            false,
            1 << 40,
            2,
            "has no bufferView for its 1099511627776 values",
        ),
        (true, 4, 2, "needs 48 bytes, its bufferView has 36"),
    ] {
        let error = file(base, count, place).expect_err(problem).to_string();
        assert!(error.ends_with(problem), "{error}");
    }
}

#[test]
fn errors_name_the_invalid_element() {
    let mesh = |file: File, positions: usize, indices: usize| {
        file.finish(json!({
            "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions }, "indices": indices }] }],
        }))
    };
    let mut file = File::default();
    let (positions, indices) = (file.floats("VEC3", 3, &TRIANGLE), file.indices(&[0, 1, 7]));
    let error = read(&mesh(file, positions, indices))
        .expect_err("index 7")
        .to_string();
    assert_eq!(
        error,
        "a/scene.gltf: /meshes/0/primitives/0/indices: the index 7 is out of range, there are 3 vertices"
    );

    let mut file = File::default();
    let mut far = TRIANGLE;
    far[4] = f32::NAN;
    let bytes: Vec<u8> = far.iter().flat_map(|x| x.to_le_bytes()).collect();
    let bounds = Some([vec![0.0; 3], vec![1.0; 3]]);
    let (positions, indices) = (
        file.add(&bytes, 5126, "VEC3", 3, bounds),
        file.indices(&[0, 1, 2]),
    );
    let error = read(&mesh(file, positions, indices))
        .expect_err("NaN")
        .to_string();
    assert_eq!(
        error,
        "a/scene.gltf: /meshes/0/primitives/0/attributes/POSITION: vertex 1 is not finite in f32"
    );

    let mut file = moving();
    file["buffers"][0]["byteLength"] = json!(100_000);
    let error = read(&file).expect_err("too short").to_string();
    assert!(
        error.starts_with("a/scene.gltf: /buffers/0: has ")
            && error.ends_with("a byteLength of 100000"),
        "{error}"
    );

    let mut file = moving();
    file["buffers"][0]["uri"] = json!("none.bin");
    let error = read(&file).expect_err("a missing file").to_string();
    assert_eq!(
        error,
        "a/scene.gltf: /buffers/0: `none.bin`: entity not found"
    );

    let mut file = moving();
    file["nodes"][2]["children"] = json!([1]);
    let error = read(&file).expect_err("a node within itself").to_string();
    assert_eq!(error, "a/scene.gltf: /nodes/1: has two parents");

    let mut file = moving();
    file["scenes"][0]["nodes"] = json!([9]);
    let error = read(&file).expect_err("no such node").to_string();
    assert_eq!(error, "a/scene.gltf: /nodes/9: does not exist, there are 4");

    for bytes in [&b"glTF\x02\0\0\0"[..], b"{}", b"", b"[]"] {
        let error = read_bytes(bytes.to_vec())
            .expect_err("not glTF")
            .to_string();
        assert!(error.starts_with("a/scene.gltf: header: "), "{error}");
    }
    // A truncated text file must not panic.
    let whole = moving().to_string();
    for end in (0..whole.len()).step_by(97) {
        let _ = read_bytes(whole.as_bytes()[..end].to_vec());
    }
}

/// Random changes of digits and other bytes must not panic.
#[test]
fn damaged_files_do_not_panic() {
    let whole = moving().to_string().into_bytes();
    let digits: Vec<usize> = (0..whole.len())
        .filter(|i| whole[*i].is_ascii_digit())
        .collect();
    let mut rng = fastrand::Rng::with_seed(3);
    let mut valid = 0;
    for _ in 0..5000 {
        let mut bytes = whole.clone();
        for _ in 0..rng.usize(1..4) {
            if rng.bool() {
                let at = digits[rng.usize(..digits.len())];
                bytes[at] = b'0' + rng.u8(..10);
                if rng.u8(..4) == 0 {
                    bytes.insert(at, b'9');
                }
            } else {
                let at = rng.usize(..bytes.len());
                bytes[at] = rng.u8(..);
            }
        }
        if let Ok(scene) = read_bytes(bytes) {
            let _ = scene.mesh_at(0.5);
            let _ = scene.camera_at(0.5);
            valid += 1;
        }
    }
    assert!(valid > 100, "only {valid} of the damaged files are valid");
}
