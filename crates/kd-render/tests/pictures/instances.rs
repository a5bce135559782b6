//! Parts that have several instances.

use std::fmt::Write;
use std::path::Path;

use kd::glam::{DAffine3, DQuat, DVec3, Vec3};
use kd::{BuildOptions, MergeMethod, Strategy};
use kd_render::{RenderOptions, Rendering, Stage, render};
use kd_scene::{AffOptions, SceneDescription, Spd, read_aff, read_gltf};

use crate::brute_force::BruteForce;
use crate::{difference, picture, small};

const MOVES: [[f32; 3]; 4] = [
    [-1.5, 0.5, 0.0],
    [-0.5, -0.5, 0.3],
    [0.6, 0.5, -0.2],
    [1.4, -0.4, 0.0],
];
const TURNS: [[f32; 4]; 4] = [
    [0.0, 0.0, 0.0, 1.0],
    [0.0, 0.6, 0.0, 0.8],
    [0.6, 0.0, 0.0, 0.8],
    [0.0, 0.0, 0.8, 0.6],
];
/// The second and the last instance are mirrored.
const SCALES: [[f32; 3]; 4] = [
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [0.5, 1.5, 0.8],
    [-1.2, -0.7, -1.0],
];
/// A pyramid, its vertex normals, and its triangles with the outside in front.
const CORNERS: [[f32; 3]; 4] = [
    [-0.4, -0.4, 0.4],
    [0.5, -0.4, 0.2],
    [0.0, -0.3, -0.5],
    [0.1, 0.6, 0.0],
];
const TRIANGLES: [[u8; 3]; 4] = [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]];

/// Four pyramids on a turning node in front of a wall, as instances, or as nodes of their own.
fn pyramids(material: &str, with_normals: bool, by_nodes: bool) -> SceneDescription {
    let wall = [
        [-4.0, -3.0, -2.0],
        [4.0, -3.0, -2.0],
        [4.0, 3.0, -2.0],
        [-4.0, 3.0, -2.0],
    ];
    let times = [0.0, 1.0];
    let keys = [[0.0, 0.0, 0.0, 1.0], [0.0, 0.8, 0.0, 0.6]];
    let arrays: [(&str, &[f32]); 8] = [
        ("VEC3", CORNERS.as_flattened()),
        ("VEC3", MOVES.as_flattened()),
        ("VEC4", TURNS.as_flattened()),
        ("VEC3", SCALES.as_flattened()),
        ("VEC3", wall.as_flattened()),
        ("SCALAR", &times),
        ("VEC4", keys.as_flattened()),
        // Normals from the middle, which are not of unit length.
        ("VEC3", CORNERS.as_flattened()),
    ];
    let (mut bytes, mut views, mut accessors) = (Vec::new(), String::new(), String::new());
    let mut add = |data: &[u8], component: u32, kind: &str, count: usize, number: usize| {
        let (start, length) = (bytes.len(), data.len());
        bytes.extend_from_slice(data);
        let comma = if number == 0 { "" } else { "," };
        let view =
            format!(r#"{comma}{{ "buffer": 0, "byteOffset": {start}, "byteLength": {length} }}"#);
        views.push_str(&view);
        let _ = write!(
            accessors,
            r#"{comma}{{ "bufferView": {number}, "componentType": {component}, "type": "{kind}", "count": {count} }}"#
        );
    };
    for (number, (kind, floats)) in arrays.into_iter().enumerate() {
        let data: Vec<u8> = floats.iter().flat_map(|x| x.to_le_bytes()).collect();
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        add(&data, 5126, kind, floats.len() / width, number);
    }
    add(TRIANGLES.as_flattened(), 5121, "SCALAR", 12, 8);
    add(&[0, 1, 2, 0, 2, 3], 5121, "SCALAR", 6, 9);
    let (turning, mut others) = if by_nodes {
        (r#""children": [4, 5, 6, 7]"#, String::new())
    } else {
        let of = r#""mesh": 0, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": {
            "TRANSLATION": 1, "ROTATION": 2, "SCALE": 3 } } }"#;
        (of, String::new())
    };
    if by_nodes {
        for ((at, turn), scale) in MOVES.iter().zip(TURNS).zip(SCALES) {
            let _ = write!(
                others,
                r#", {{ "mesh": 0, "translation": {at:?}, "rotation": {turn:?}, "scale": {scale:?} }}"#
            );
        }
    }
    let normals = if with_normals { r#", "NORMAL": 7"# } else { "" };
    let length = bytes.len();
    let text = format!(
        r#"{{ "asset": {{ "version": "2.0" }},
        "extensions": {{ "KHR_lights_punctual": {{ "lights": [{{ "type": "directional" }}] }} }},
        "scenes": [{{ "nodes": [0, 1, 2, 3] }}],
        "nodes": [
            {{ {turning} }},
            {{ "mesh": 1 }},
            {{ "camera": 0, "translation": [0, 0, 6] }},
            {{ "extensions": {{ "KHR_lights_punctual": {{ "light": 0 }} }}, "rotation": [-0.3, 0.2, 0, 0.9] }}
            {others}
        ],
        "meshes": [
            {{ "primitives": [{{ "attributes": {{ "POSITION": 0 {normals} }}, "indices": 8, "material": 0 }}] }},
            {{ "primitives": [{{ "attributes": {{ "POSITION": 4 }}, "indices": 9 }}] }}
        ],
        "materials": [{{ {material} }}],
        "cameras": [{{ "type": "perspective", "perspective": {{ "yfov": 0.6, "znear": 0.1 }} }}],
        "animations": [{{
            "channels": [{{ "sampler": 0, "target": {{ "node": 0, "path": "rotation" }} }}],
            "samplers": [{{ "input": 5, "output": 6 }}]
        }}],
        "buffers": [{{ "byteLength": {length}, "uri": "data.bin" }}],
        "bufferViews": [{views}],
        "accessors": [{accessors}] }}"#
    );
    let mut files = |path: &Path| match path.extension() {
        Some(extension) if extension == "bin" => Ok(bytes.clone()),
        _ => Ok(text.clone().into_bytes()),
    };
    read_gltf("pyramids.gltf".as_ref(), &mut files).expect("valid")
}

const RED: &str =
    r#""pbrMetallicRoughness": { "baseColorFactor": [0.9, 0.2, 0.1, 1], "metallicFactor": 0 }"#;
/// Which side of its surface is outside decides how it refracts.
const GLASS: &str =
    r#""extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.9 } }"#;

fn strategies() -> [Strategy; 7] {
    [
        Strategy::Auto,
        Strategy::Instances,
        Strategy::Rebuild(BuildOptions::fast()),
        Strategy::Merge(MergeMethod::Guided),
        Strategy::Merge(MergeMethod::PartitionTrees),
        Strategy::Refit,
        Strategy::Dual,
    ]
}

/// Pictures at several times on one stage.
fn pictures(scene: &SceneDescription, strategy: Strategy, times: &[f64]) -> Vec<Rendering> {
    let mut stage =
        Stage::new(scene.clone(), BuildOptions::best(), strategy).expect("within the limits");
    let pictures = times.iter().map(|time| {
        stage.show(*time).expect("finite positions");
        picture(&stage, &small())
    });
    pictures.collect()
}

/// The pictures of [`pictures`] by a test of every triangle, with as many rays.
fn by_all_triangles(scene: &SceneDescription, times: &[f64]) -> Vec<Rendering> {
    let mut stage =
        Stage::new(scene.clone(), BuildOptions::best(), Strategy::Auto).expect("within the limits");
    let pictures = times.iter().map(|time| {
        stage.show(*time).expect("finite positions");
        let every_triangle = BruteForce::new(&stage);
        render(&stage, &every_triangle, &stage.camera(), &small(), &|_| {})
    });
    pictures.collect()
}

#[test]
fn instances_look_the_same_with_every_strategy() {
    const TIMES: [f64; 2] = [0.0, 0.4];
    for with_normals in [false, true] {
        for material in [RED, GLASS] {
            let scene = pyramids(material, with_normals, false);
            assert_eq!(scene.parts[1].instances.len(), 4);
            let expected = by_all_triangles(&scene, &TIMES);
            assert!(expected[0].picture != expected[1].picture, "they turn");
            for strategy in strategies() {
                let name = format!("{strategy:?}, {with_normals}, {material}");
                assert!(pictures(&scene, strategy, &TIMES) == expected, "{name}");
            }
        }
    }
}

#[test]
fn instances_look_as_separate_nodes_do() {
    const TIMES: [f64; 2] = [0.0, 0.4];
    for with_normals in [false, true] {
        for material in [RED, GLASS] {
            let [instances, nodes] = [false, true].map(|by_nodes| {
                let scene = pyramids(material, with_normals, by_nodes);
                let mesh = scene.mesh_at(0.0).expect("finite");
                (pictures(&scene, Strategy::Instances, &TIMES), mesh)
            });
            assert_eq!(instances.1.len(), nodes.1.len());
            for (ours, theirs) in instances.0.iter().zip(&nodes.0) {
                // Normals are normalized before instances stretch them, those of nodes after that.
                let (mean, far) = difference(&ours.picture, &theirs.picture.to_image());
                assert!(
                    mean < 1.0 && far <= 30,
                    "{material}, {with_normals}: {mean} of 255, {far} pixels"
                );
            }
        }
    }
}

/// The transforms of three instances beside each other.
fn three() -> Vec<DAffine3> {
    let instance = |i: u8| {
        let at = DVec3::new(1.4 * (f64::from(i) - 1.0), 0.0, 0.0);
        let turn = DQuat::from_rotation_y(0.4 * f64::from(i));
        let scale = DVec3::new(0.6, 0.6, if i == 2 { -0.6 } else { 0.4 });
        DAffine3::from_scale_rotation_translation(scale, turn, at)
    };
    (0..3).map(instance).collect()
}

fn aff(text: &str) -> SceneDescription {
    let mut files = |_: &Path| Ok(text.as_bytes().to_vec());
    let scene = read_aff("scene.aff".as_ref(), &mut files, &AffOptions::default());
    scene.expect("valid")
}

#[test]
fn instances_are_hidden_together() {
    let mut scene = aff(
        "l 5 5 5 x ball { s 0 0 0 1 } k ball { visibility 2 1 0 2 1 } a 0 3 4
        v from 0 0 4 at 0 0 0 up 0 1 0 angle 60 hither 0.1 resolution 4 4",
    );
    scene.parts[0].instances = three();
    for strategy in strategies() {
        let mut stage =
            Stage::new(scene.clone(), BuildOptions::best(), strategy).expect("within the limits");
        for (time, expected) in [(0.0, 3), (1.5, 0), (2.5, 3), (1.2, 0), (0.5, 3)] {
            stage.show(time).expect("finite positions");
            assert_eq!(stage.scene().frame().parts().len(), expected, "{time} s");
            let seen = picture(&stage, &small()).picture;
            let pixels = [[14, 24], [32, 24], [50, 24]];
            let is_seen = pixels.map(|[x, y]| seen.at(x, y) != Vec3::ZERO);
            assert_eq!(is_seen, [expected == 3; 3], "{time} s");
        }
    }
}

/// They are not copied while they have no extent.
#[test]
fn instances_grow_from_nothing() {
    let mut scene = aff("l 5 5 5 x ball { s 0 0 0 1 } a 0 3 4
        k ball { scale 4 0 0 0 0 0 0 0 0 0 0 0 0 0 0 2 1 1 1 0 0 0 3 1 1 1 0 0 0 }
        v from 0 0 4 at 0 0 0 up 0 1 0 angle 60 hither 0.1 resolution 4 4");
    scene.parts[0].instances = three();
    const TIMES: [f64; 4] = [0.0, 2.0, 0.0, 1.0];
    let expected = by_all_triangles(&scene, &TIMES);
    for strategy in strategies() {
        let name = format!("{strategy:?}");
        assert!(pictures(&scene, strategy, &TIMES) == expected, "{name}");
    }
    let mut stage = Stage::new(scene, BuildOptions::fast(), Strategy::Instances).expect("few");
    for (time, parts) in TIMES.into_iter().zip([0, 3, 0, 3]) {
        let report = stage.show(time).expect("finite positions");
        assert_eq!(report.parts, parts, "{time} s");
    }
}

#[test]
fn instances_of_a_part_that_deforms_follow_it() {
    const TIMES: [f64; 3] = [0.0, 1.1, 0.4];
    let mut scene = aff("b 0.1 0.2 0.3 l 3 5 5 a 0 3 4
        tpa 2 0 -1 1 0 0 0 -1 1 1 0 0 0 -1 0 2 0 0 0 -1 2 -1 2 0 0 1 -1 1 2 0 0 1 -1 0 3 1 0 1 -1
        v from 0 1 6 at 0 0.5 0 up 0 1 0 angle 40 hither 0.1 resolution 4 4");
    let moving = scene.parts.iter_mut().find(|part| part.may_move());
    moving.expect("a part that deforms").instances = three();
    let expected = by_all_triangles(&scene, &TIMES);
    assert!(expected[0].picture != expected[1].picture, "it deforms");
    for strategy in strategies() {
        let name = format!("{strategy:?}");
        assert!(pictures(&scene, strategy, &TIMES) == expected, "{name}");
    }
}

/// A stage of many instances takes the memory of one mesh, and at most 1 kB each, also when all of them move.
#[test]
fn an_instance_takes_at_most_a_kilobyte() {
    const INSTANCES: u16 = 2000;
    let mesh = Spd::Balls.generate(2).expect("small").mesh;
    assert!(mesh.len() > 5000, "{}", mesh.len());
    let mut scene = aff("l 5 5 5 x all { s 0 0 0 1 } k all { transl 4 0 0 0 0 0 0 0 0 0 0 0 0 0 0 2 9 0 0 0 0 0 2 9 0 0 0 0 0 }
        a 0 2 3 v from 0 0 900 at 0 0 0 up 0 1 0 angle 40 hither 0.1 resolution 4 4");
    scene.parts[0].surface.materials = vec![0; mesh.len()];
    scene.parts[0].surface.normals.clear();
    scene.parts[0].mesh = mesh.into();
    let taken = |scene: &SceneDescription, time: f64| {
        let mut stage = Stage::new(scene.clone(), BuildOptions::fast(), Strategy::Auto)
            .expect("within the limits");
        let report = stage.show(time).expect("finite positions");
        picture(
            &stage,
            &RenderOptions {
                bounces: 0,
                ..small()
            },
        );
        report
    };
    let one = taken(&scene, 0.0).bytes.total();
    let grid = (0..INSTANCES).map(|i| {
        let [x, y] = [i % 50, i / 50].map(|at| 6.0 * f64::from(at));
        DAffine3::from_translation(DVec3::new(x - 150.0, y - 120.0, 0.0))
    });
    scene.parts[0].instances = grid.collect();
    for time in [0.0, 1.0] {
        let report = taken(&scene, time);
        assert_eq!(report.parts, usize::from(INSTANCES));
        assert_eq!(report.triangles, report.parts * scene.parts[0].mesh.len());
        let (bytes, limit) = (report.bytes.total(), one + 1000 * report.parts);
        assert!(bytes <= limit, "{bytes} bytes, at most {limit}");
    }
}
