//! Extensions that the reader uses.

use glam::{Vec2, Vec3};
use kd_scene::{AlphaMode, LightKind, TextureSource};
use serde_json::{Value, json};

use crate::file::{File, TRIANGLE, read};

/// A triangle in one node, with what `rest` adds.
pub(crate) fn triangle(mut file: File, node: Value, primitive: Value, rest: Value) -> Value {
    let positions = file.floats("VEC3", 3, &TRIANGLE);
    let mut all = json!({
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": positions } }] }],
    });
    merge(&mut all["nodes"][0], node);
    merge(&mut all["meshes"][0]["primitives"][0], primitive);
    merge(&mut all, rest);
    file.finish(all)
}

fn merge(to: &mut Value, from: Value) {
    match (to, from) {
        (Value::Object(to), Value::Object(from)) => {
            for (name, value) in from {
                merge(to.entry(name).or_insert(Value::Null), value);
            }
        }
        (to, from) => *to = from,
    }
}

/// A mirror reverses the order of corners, two of them do not (glTF 2.0, §3.7.4).
#[test]
fn mirrored_triangles_face_the_same_side() {
    for (outer, inner, corners) in [(1, 1, [0, 1, 2]), (-1, 1, [0, 2, 1]), (-1, -2, [0, 1, 2])] {
        let node = json!({ "scale": [1, outer, 1], "children": [1] });
        let rest = json!({ "nodes": [{ "mesh": 1 }, { "mesh": 0, "scale": [inner, 1, 1] }] });
        let mut file = triangle(File::default(), json!({}), json!({}), rest);
        file["nodes"][0] = node;
        let scene = read(&file).expect("valid");
        assert_eq!(
            scene.parts[0].mesh.triangles(),
            [corners],
            "{outer} {inner}"
        );
    }
    // Keys that scale a node say whether it mirrors.
    for (at_rest, key, corners) in [(-1.0, 1.0, [0, 1, 2]), (1.0, -1.0, [0, 2, 1])] {
        let mut file = File::default();
        let times = file.floats("SCALAR", 1, &[0.0]);
        let keys = file.floats("VEC3", 3, &[key, 1.0, 1.0]);
        let rest = json!({ "animations": [{
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "scale" } }],
            "samplers": [{ "input": times, "output": keys }],
        }] });
        let file = triangle(file, json!({ "scale": [at_rest, 1, 1] }), json!({}), rest);
        let scene = read(&file).expect("valid");
        assert_eq!(
            scene.parts[0].mesh.triangles(),
            [corners],
            "{at_rest} {key}"
        );
    }
}

#[test]
fn colors_of_vertices_are_read() {
    for (component, bytes) in [
        (5121, vec![255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255]),
        (
            5126,
            [1.0_f32, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect(),
        ),
    ] {
        let mut file = File::default();
        let kind = if component == 5121 { "VEC4" } else { "VEC3" };
        let colors = file.add(&bytes, component, kind, 3, None);
        let primitive = json!({ "attributes": { "COLOR_0": colors } });
        let scene = read(&triangle(file, json!({}), primitive, json!({}))).expect("valid");
        assert_eq!(
            scene.parts[0].surface.colors,
            [[Vec3::X, Vec3::Y, Vec3::Z]],
            "{kind}"
        );
    }
}

#[test]
fn lights_follow_their_nodes() {
    let lights = json!([
        { "type": "point", "color": [1, 0.5, 0], "intensity": 4 },
        { "type": "directional" },
        { "type": "spot", "intensity": 0, "spot": { "innerConeAngle": 0.25, "outerConeAngle": 0.5 } },
        { "type": "area" },
        { "type": "spot", "intensity": 0, "spot": { "outerConeAngle": -1 } },
    ]);
    let with = |light: u32| json!({ "KHR_lights_punctual": { "light": light } });
    let rest = json!({
        "nodes": [
            { "mesh": 0, "extensions": with(0), "translation": [0, 0, 2] },
            { "extensions": with(1), "rotation": [-1, 0, 0, 1] },
            { "extensions": with(2) },
            { "extensions": with(3) },
            { "extensions": { "KHR_lights_punctual": { "light": 4.0 } } },
        ],
        "scenes": [{ "nodes": [0, 1, 2, 3, 4] }],
        "extensions": { "KHR_lights_punctual": { "lights": lights } },
    });
    let scene = read(&triangle(File::default(), json!({}), json!({}), rest)).expect("valid");
    let kinds: Vec<LightKind> = scene.lights.iter().map(|light| light.kind).collect();
    let spot = LightKind::Spot {
        inner: 0.25,
        outer: 0.5,
    };
    let closed = LightKind::Spot {
        inner: 0.0,
        outer: 0.0,
    };
    assert_eq!(
        kinds,
        [LightKind::Point, LightKind::Directional, spot, closed]
    );
    let nodes = scene.placed_nodes(0.0);
    assert_eq!(
        scene.lights[0].placed(0.0, &nodes).0,
        Vec3::new(0.0, 0.0, 2.0)
    );
    let down = scene.lights[1].placed(0.0, &nodes).1;
    assert!(down.distance(Vec3::NEG_Y) < 1e-6, "{down}");
    let [red, green] = [0, 1].map(|i| scene.lights.iter().map(|light| light.color[i]).sum::<f32>());
    assert!(
        (red - 1.0).abs() < 1e-6 && green < 1.0,
        "exposed: {red} {green}"
    );
    assert_eq!(scene.lights[2].color, Vec3::ZERO);
    let warning = scene.warnings[0].to_string();
    assert!(
        warning.ends_with("lights/3: a light has the unknown type `area`; it is left out"),
        "{warning}"
    );
}

#[test]
fn textures_are_transformed() {
    let mut file = File::default();
    let uvs = file.floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let primitive = json!({ "attributes": { "TEXCOORD_1": uvs }, "material": 0 });
    let transform =
        json!({ "offset": [0.5, 0.25], "rotation": 1.570_796_4, "scale": [2, 3], "texCoord": 1 });
    let texture = json!({ "index": 0, "extensions": { "KHR_texture_transform": transform } });
    let rest = json!({
        "materials": [{ "pbrMetallicRoughness": { "baseColorTexture": texture } }],
        "textures": [{ "extensions": { "EXT_texture_webp": { "source": 0 } } }],
        "images": [{ "uri": "a.webp" }],
    });
    let scene = read(&triangle(file, json!({}), primitive, rest)).expect("valid");
    let expected = [
        Vec2::new(0.5, 0.25),
        Vec2::new(0.5, -1.75),
        Vec2::new(3.5, 0.25),
    ];
    for (uv, expected) in scene.parts[0].surface.uvs[0].into_iter().zip(expected) {
        assert!(
            Vec2::from(uv).distance(expected) < 1e-5,
            "{uv:?}, not {expected}"
        );
    }
    assert_eq!(
        scene.textures[0].source,
        TextureSource::File("a/a.webp".into())
    );
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn materials_have_what_their_extensions_say() {
    let material = |material: Value| {
        let primitive = json!({ "material": 0 });
        let rest = json!({ "materials": [material] });
        let scene = read(&triangle(File::default(), json!({}), primitive, rest)).expect("valid");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        scene.materials[0].clone()
    };
    let glowing = material(json!({
        "emissiveFactor": [0.5, 0, 1],
        "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 2 } },
    }));
    assert_eq!(glowing.emission, Vec3::new(1.0, 0.0, 2.0));
    let glass = material(json!({ "extensions": {
        "KHR_materials_transmission": { "transmissionFactor": 0.75 },
        "KHR_materials_ior": { "ior": 1.25 },
    } }));
    assert_eq!((glass.transmittance, glass.refraction), (0.75, 1.25));
    let glossy = material(
        json!({ "extensions": { "KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.25, 0.5, 0.75, 1], "specularFactor": [0, 0, 0], "glossinessFactor": 0.5,
    } } }),
    );
    assert_eq!(glossy.diffuse, Vec3::new(0.25, 0.5, 0.75));
    let unlit = material(json!({
        "pbrMetallicRoughness": { "baseColorFactor": [1, 0, 0, 1] },
        "extensions": { "KHR_materials_unlit": {} },
    }));
    assert_eq!((unlit.ambient, unlit.diffuse), (Vec3::X, Vec3::ZERO));
    let factor = json!({ "baseColorFactor": [1, 1, 1, 0.25] });
    let clear = material(json!({ "pbrMetallicRoughness": factor.clone(), "alphaMode": "BLEND" }));
    assert_eq!((clear.alpha, clear.alpha_mode), (0.25, AlphaMode::Blend));
    assert_eq!(clear.transmittance, 0.0, "alpha is coverage, not glass");
    let unlit = json!({ "KHR_materials_unlit": {} });
    let unlit = json!({ "pbrMetallicRoughness": factor.clone(), "alphaMode": "BLEND", "extensions": unlit });
    let unlit = material(unlit);
    assert_eq!(
        (unlit.alpha, unlit.alpha_mode),
        (0.25, AlphaMode::Blend),
        "also without light"
    );
    let opaque = material(json!({ "pbrMetallicRoughness": factor }));
    assert_eq!(opaque.alpha_mode, AlphaMode::Opaque);
    for (cutoff, expected) in [(json!(null), 0.5), (json!(0.25), 0.25)] {
        let mask = material(json!({ "alphaMode": "MASK", "alphaCutoff": cutoff }));
        assert_eq!(mask.alpha_mode, AlphaMode::Mask { cutoff: expected });
    }
}

#[test]
fn alpha_of_vertices_is_kept_where_it_has_a_meaning() {
    let colors = [
        1.0, 0.5, 0.25, 0.75, 1.0, 1.0, 1.0, 2.0, 0.0, 0.0, 0.0, -1.0,
    ];
    let alphas = |mode: &str| {
        let mut file = File::default();
        let at = file.floats("VEC4", 4, &colors);
        let primitive = json!({ "material": 0, "attributes": { "COLOR_0": at } });
        let rest = json!({ "materials": [{ "alphaMode": mode }] });
        let scene = read(&triangle(file, json!({}), primitive, rest)).expect("valid");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let surface = &scene.parts[0].surface;
        assert_eq!(surface.colors[0][0], Vec3::new(1.0, 0.5, 0.25), "{mode}");
        surface.alphas.clone()
    };
    for mode in ["MASK", "BLEND"] {
        assert_eq!(alphas(mode), [[0.75, 1.0, 0.0]], "{mode}");
    }
    assert!(alphas("OPAQUE").is_empty());
}

#[test]
fn alpha_of_a_texture_is_no_warning() {
    let surface = json!({ "baseColorTexture": { "index": 0 } });
    for mode in ["MASK", "BLEND"] {
        let mut file = File::default();
        let uvs = file.floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
        let primitive = json!({ "material": 0, "attributes": { "TEXCOORD_0": uvs } });
        let rest = json!({
            "materials": [{ "alphaMode": mode, "pbrMetallicRoughness": surface.clone() }],
            "textures": [{ "source": 0 }],
            "images": [{ "uri": "leaf.png" }],
        });
        let scene = read(&triangle(file, json!({}), primitive, rest)).expect("valid");
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        assert_eq!(scene.parts[0].surface.textures, [0], "{mode}");
    }
}

#[test]
fn hidden_nodes_are_left_out() {
    let node = json!({ "extensions": { "KHR_node_visibility": { "visible": false } } });
    let scene = read(&triangle(File::default(), node, json!({}), json!({}))).expect("valid");
    assert!(scene.parts.is_empty(), "{:?}", scene.parts);
}
