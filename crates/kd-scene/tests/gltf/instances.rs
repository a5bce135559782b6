//! Instances of the mesh of a node (`EXT_mesh_gpu_instancing`).

use glam::Vec3;
use kd_scene::{
    LoadError, LoadOptions, SceneDescription, Strictness, WarningCode, WholeMeshError, load_mesh,
    load_scene_with,
};
use serde_json::{Value, json};

use crate::extensions::triangle;
use crate::file::{File, TRIANGLE, read};

const NAME: &str = "EXT_mesh_gpu_instancing";

#[test]
fn instances_are_placed() {
    let mut file = File::default();
    let moves = file.floats("VEC3", 3, &[5.0, 0.0, 0.0, 0.0, 0.0, 7.0]);
    // A quarter turn about z, as normalized bytes would have it too.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let turns = file.floats("VEC4", 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    let scales = file.floats("VEC3", 3, &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0]);
    let of = json!({ "attributes": { "TRANSLATION": moves, "ROTATION": turns, "SCALE": scales, "_ID": scales } });
    let node = json!({ "name": "tree", "translation": [0, 100, 0], "extensions": { NAME: of } });
    let file = triangle(file, node, json!({}), json!({}));
    let scene = read(&file).expect("valid");
    let [part] = scene.parts.as_slice() else {
        panic!("{:?}", scene.parts);
    };
    assert_eq!(part.name, "tree");
    assert_eq!((part.mesh.len(), part.copies()), (1, 2));
    let mesh = scene.mesh_at(0.0).expect("finite");
    assert_eq!(mesh.len(), 2);
    assert_eq!(mesh.corners(0)[1], Vec3::new(6.0, 100.0, 0.0));
    let second = mesh.corners(1)[1];
    assert!(
        second.distance(Vec3::new(0.0, 102.0, 7.0)) < 1e-5,
        "{second}"
    );
    let places = part.places(&scene.placed_nodes(0.0));
    let corner = places[1].transform.transform_point3(Vec3::X);
    assert!(corner.distance(second) < 1e-5, "{corner}");

    let mut wrong = file;
    let one = json!(0);
    wrong["accessors"][0]["count"] = json!(1);
    wrong["nodes"][0]["extensions"][NAME]["attributes"]["TRANSLATION"] = one;
    let error = read(&wrong).expect_err("two counts").to_string();
    assert!(
        error.ends_with("attributes: the accessors have different counts"),
        "{error}"
    );
}

#[test]
fn one_instance_is_no_part_of_its_own() {
    let mut file = File::default();
    let moves = file.floats("VEC3", 3, &[5.0, 0.0, 0.0]);
    let of = json!({ "attributes": { "TRANSLATION": moves } });
    let node = json!({ "extensions": { NAME: of } });
    let scene = read(&triangle(file, node, json!({}), json!({}))).expect("valid");
    assert!(scene.parts[0].instances.is_empty());
    assert_eq!(scene.parts[0].mesh.corners(0)[0], Vec3::new(5.0, 0.0, 0.0));
}

#[test]
fn mirrored_instances_face_the_same_side() {
    let mut file = File::default();
    let scales = file.floats("VEC3", 3, &[1.0, 1.0, 1.0, 1.0, 1.0, -1.0]);
    let of = json!({ "attributes": { "SCALE": scales } });
    let node = json!({ "extensions": { NAME: of } });
    let scene = read(&triangle(file, node, json!({}), json!({}))).expect("valid");
    let part = &scene.parts[0];
    assert_eq!(part.mesh.triangles(), [[0, 1, 2]]);
    let places = part.places(&[]).into_iter();
    let is_mirrored: Vec<bool> = places.map(|place| place.is_mirrored).collect();
    assert_eq!(is_mirrored, [false, true]);
    let mesh = scene.mesh_at(0.0).expect("finite");
    assert_eq!(mesh.triangles(), [[0, 1, 2], [3, 5, 4]]);
}

const MOVES: [[f32; 3]; 4] = [
    [0.1, 0.0, 0.0],
    [3.3, -1.0, 0.7],
    [-2.9, 0.4, 1e3],
    [0.0, 7.7, 0.0],
];
const TURNS: [[f32; 4]; 4] = [
    [0.0, 0.0, 0.0, 1.0],
    [0.3, 0.1, -0.2, 0.9],
    [0.0, 1.0, 0.0, 0.5],
    [0.7, 0.0, 0.7, 0.0],
];
const SCALES: [[f32; 3]; 4] = [
    [1.0, 1.0, 1.0],
    [1.0, -1.5, 0.3],
    [-0.1, -2.0, 1.1],
    [-1.0, -1.0, -1.0],
];

/// Four instances below a node, which turns if `is_moving`, in a node that mirrors: by the extension, or as nodes.
fn grove(is_moving: bool, by_nodes: bool) -> Value {
    let mut file = File::default();
    let positions = file.floats("VEC3", 3, &TRIANGLE.map(|x| x + 0.3));
    let moves = file.floats("VEC3", 3, MOVES.as_flattened());
    let turns = file.floats("VEC4", 4, TURNS.as_flattened());
    let scales = file.floats("VEC3", 3, SCALES.as_flattened());
    let times = file.floats("SCALAR", 1, &[0.0, 2.0]);
    let keys = file.floats("VEC4", 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.6, 0.0, 0.8]);
    let mut nodes = vec![
        json!({ "children": [1], "scale": [1, 1, -2], "translation": [0.3, 0, 0] }),
        json!({ "name": "turning" }),
    ];
    if by_nodes {
        nodes[1]["children"] = json!([2, 3, 4, 5]);
        for i in 0..4 {
            let [at, scale] = [MOVES[i], SCALES[i]].map(|all| all.map(f64::from));
            let turn = TURNS[i].map(f64::from);
            nodes.push(json!({ "mesh": 0, "translation": at, "rotation": turn, "scale": scale }));
        }
    } else {
        nodes[1]["mesh"] = json!(0);
        let attributes = json!({ "TRANSLATION": moves, "ROTATION": turns, "SCALE": scales });
        nodes[1]["extensions"] = json!({ NAME: { "attributes": attributes } });
    }
    let mut rest = json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": nodes,
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
    });
    if is_moving {
        rest["animations"] = json!([{
            "channels": [{ "sampler": 0, "target": { "node": 1, "path": "rotation" } }],
            "samplers": [{ "input": times, "output": keys }],
        }]);
    }
    file.finish(rest)
}

/// To the bit: copies of instances are what separate nodes are.
#[test]
fn a_whole_mesh_is_that_of_separate_nodes() {
    for is_moving in [false, true] {
        let of = |by_nodes: bool| read(&grove(is_moving, by_nodes)).expect("valid");
        let [instances, nodes] = [false, true].map(of);
        assert_eq!(instances.parts[0].instances.len(), 4);
        assert!(nodes.parts[0].instances.is_empty());
        for time in [0.0, 0.7, 2.0] {
            let at = |scene: &SceneDescription| scene.mesh_at(time).expect("finite");
            assert_eq!(at(&instances), at(&nodes), "{is_moving}, {time} s");
        }
        assert_eq!(instances.lights, nodes.lights);
    }
}

/// A short file with many instances of a mesh of 20 000 triangles.
fn repeated(instances: usize) -> Value {
    let mut file = File::default();
    let moves = file.floats("VEC3", 3, &[0.0; 3]);
    file.accessors[moves] = json!({ "componentType": 5126, "type": "VEC3", "count": instances });
    let corners: Vec<u16> = (0..60_000).map(|corner| corner % 3).collect();
    let corners = file.indices(&corners);
    let of = json!({ "attributes": { "TRANSLATION": moves } });
    let node = json!({ "extensions": { NAME: of } });
    triangle(file, node, json!({ "indices": corners }), json!({}))
}

#[test]
fn a_short_file_cannot_have_any_number_of_triangles() {
    let file = repeated(4000);
    let expected = "the file repeats its meshes to more than 67108864 vertices and triangles";
    // By nodes, by morph targets, and by instances that take as much as copies.
    let mut by_nodes = file.clone();
    by_nodes["nodes"] = json!(vec![json!({ "mesh": 0 }); 4000]);
    by_nodes["scenes"][0]["nodes"] = json!((0..4000).collect::<Vec<_>>());
    let mut by_targets = file.clone();
    by_targets["nodes"] = json!([{ "mesh": 0 }]);
    let moves = json!(0);
    let primitive = &mut by_targets["meshes"][0]["primitives"][0];
    primitive["attributes"]["POSITION"] = moves.clone();
    primitive["targets"] = json!(vec![json!({ "POSITION": moves }); 20_000]);
    let mut by_flat_instances = file;
    let attributes = &mut by_flat_instances["nodes"][0]["extensions"][NAME]["attributes"];
    *attributes = json!({ "SCALE": 0 });
    // An instance takes memory, too.
    let mut by_instances = repeated(60_000);
    by_instances["meshes"][0]["primitives"][0]["indices"] = Value::Null;
    let node = by_instances["nodes"][0].clone();
    by_instances["nodes"] = json!(vec![node; 200]);
    by_instances["scenes"][0]["nodes"] = json!((0..200).collect::<Vec<_>>());
    for file in [by_nodes, by_targets, by_flat_instances, by_instances] {
        let error = read(&file).expect_err("too many").to_string();
        assert!(error.ends_with(expected), "{error}");
    }
}

/// Writes a file, and calls with its path.
fn with_file<T>(test: &str, file: &Value, call: impl FnOnce(&std::path::Path) -> T) -> T {
    let name = format!("kd-scene-{test}-{}.gltf", std::process::id());
    let path = std::env::temp_dir().join(name);
    std::fs::write(&path, file.to_string()).expect("a temporary file");
    let result = call(&path);
    // A file that cannot be removed is harmless.
    drop(std::fs::remove_file(&path));
    result
}

#[test]
fn copies_of_many_instances_are_refused() {
    let scene = read(&repeated(4000)).expect("one mesh, and 4000 transforms");
    assert_eq!(
        (scene.parts[0].mesh.len(), scene.parts[0].copies()),
        (20_000, 4000)
    );
    let error = scene.mesh_at(0.0).expect_err("too many");
    let elements = 4000 * 20_003;
    assert_eq!(error, WholeMeshError::TooManyCopies { elements });
    let error = with_file("copies", &repeated(4000), |path| load_mesh(path));
    let error = error.expect_err("too many");
    assert!(matches!(error, LoadError::TooManyCopies { .. }), "{error}");
    let expected = "copies of all instances have 80012000 vertices and triangles, more than 67108864 beyond those of the scene";
    assert!(error.to_string().ends_with(expected), "{error}");
}

#[test]
fn instances_that_are_not_finite_are_left_out() {
    let of = |scales: &[f32]| {
        let mut file = File::default();
        let scales = file.floats("VEC3", 3, scales);
        let of = json!({ "attributes": { "SCALE": scales } });
        // Even instances of ordinary size overflow in some nodes.
        let node = json!({ "scale": [3e38, 1, 1], "extensions": { NAME: of } });
        triangle(file, node, json!({}), json!({}))
    };
    let file = of(&[1.0, 1.0, 1.0, 2.0, 1.0, 1.0]);
    let error = read(&file).expect_err("not finite").to_string();
    let expected =
        "/nodes/0/extensions/EXT_mesh_gpu_instancing/attributes: instance 1 is not finite in f32";
    assert!(error.ends_with(expected), "{error}");
    let lenient = |file: &Value| {
        let options = LoadOptions::new().with_strictness(Strictness::Lenient);
        with_file("finite", file, |path| load_scene_with(path, &options))
    };
    let loaded = lenient(&file).expect("one instance is left");
    assert_eq!(loaded.value.parts[0].instances.len(), 1);
    assert_eq!(loaded.warnings[0].code, WarningCode::NotFinite);
    assert_eq!(loaded.value.mesh_at(0.0).expect("finite").len(), 1);
    let none = lenient(&of(&[2.0; 6])).expect("no instance is left");
    assert!(none.value.parts.is_empty(), "{:?}", none.value.parts);
}
