//! Surfaces with holes, and surfaces that blend with what is behind them.

use std::path::Path;

use image::{Rgba, RgbaImage};
use kd::glam::{DAffine3, Vec3};
use kd::{BuildOptions, MergeMethod, Ray, Strategy};
use kd_render::{PartHit, RenderMethod, RenderOptions, Stage, Tracer, render};
use kd_scene::{AffOptions, AlphaMode, Camera, SceneDescription, load_scene};
use kd_trace::RayQuery;

use crate::brute_force::BruteForce;
use crate::{check_golden, picture, small};

/// A fence in front of a wall, both two units wide: the fence has two holes, each a quarter of its area, at the lower left and the upper
/// right. It turns about the vertical axis in two seconds. A lamp is far in front of it.
///
/// `material` is what the JSON of its material says of alpha, `alpha` that of its vertices.
fn fence(material: &str, alpha: f32) -> SceneDescription {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write_leaves(&folder.path().join("fence.png"));
    let mut data: Vec<f32> = Vec::new();
    // Corners of a square, their texture coordinates, their colors, and the keys of a half turn.
    data.extend([
        -1.0, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.0,
    ]);
    data.extend([0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    data.extend([[1.0, 1.0, 1.0, alpha]; 4].as_flattened());
    data.extend([0.0, 2.0]);
    data.extend([0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0]);
    let mut bytes: Vec<u8> = data.iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|x| x.to_le_bytes()));
    std::fs::write(folder.path().join("fence.bin"), &bytes).expect("a temporary file");
    let text = format!(
        r#"{{ "asset": {{ "version": "2.0" }},
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {{ "KHR_lights_punctual": {{ "lights": [{{ "type": "directional" }}] }} }},
        "scenes": [{{ "nodes": [0, 1, 2, 3] }}],
        "nodes": [
            {{ "mesh": 0 }},
            {{ "mesh": 1, "translation": [0, 0, -2], "scale": [3, 3, 1] }},
            {{ "camera": 0, "translation": [0, 0, 6] }},
            {{ "extensions": {{ "KHR_lights_punctual": {{ "light": 0 }} }} }}
        ],
        "meshes": [
            {{ "primitives": [{{ "attributes": {{ "POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2 }}, "indices": 5, "material": 0 }}] }},
            {{ "primitives": [{{ "attributes": {{ "POSITION": 0 }}, "indices": 5, "material": 1 }}] }}
        ],
        "materials": [
            {{ "pbrMetallicRoughness": {{ "baseColorTexture": {{ "index": 0 }}, "metallicFactor": 0 }}, {material} }},
            {{ "pbrMetallicRoughness": {{ "baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": 0 }} }}
        ],
        "textures": [{{ "source": 0 }}],
        "images": [{{ "uri": "fence.png" }}],
        "cameras": [{{ "type": "perspective", "perspective": {{ "yfov": 0.6, "znear": 0.1 }} }}],
        "animations": [{{
            "channels": [{{ "sampler": 0, "target": {{ "node": 0, "path": "rotation" }} }}],
            "samplers": [{{ "input": 3, "output": 4 }}]
        }}],
        "buffers": [{{ "byteLength": {}, "uri": "fence.bin" }}],
        "bufferViews": [
            {{ "buffer": 0, "byteLength": 48 }},
            {{ "buffer": 0, "byteOffset": 48, "byteLength": 32 }},
            {{ "buffer": 0, "byteOffset": 80, "byteLength": 64 }},
            {{ "buffer": 0, "byteOffset": 144, "byteLength": 8 }},
            {{ "buffer": 0, "byteOffset": 152, "byteLength": 32 }},
            {{ "buffer": 0, "byteOffset": 184, "byteLength": 12 }}
        ],
        "accessors": [
            {{ "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0] }},
            {{ "bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2" }},
            {{ "bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC4" }},
            {{ "bufferView": 3, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [2] }},
            {{ "bufferView": 4, "componentType": 5126, "count": 2, "type": "VEC4" }},
            {{ "bufferView": 5, "componentType": 5123, "count": 6, "type": "SCALAR" }}
        ] }}"#,
        bytes.len()
    );
    let file = folder.path().join("fence.gltf");
    std::fs::write(&file, text).expect("a temporary file");
    let mut scene = load_scene(&file, &AffOptions::default()).expect("valid");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    // The picture outlives the folder.
    let png = std::fs::read(folder.path().join("fence.png")).expect("written above");
    scene.textures[0].source = kd_scene::TextureSource::Bytes(png.into());
    scene.background = Vec3::new(0.2, 0.3, 0.5);
    scene
}

/// A green picture whose upper right and lower left quarters are holes.
fn write_leaves(path: &Path) {
    let image = RgbaImage::from_fn(32, 32, |x, y| {
        let is_hole = (x < 16) != (y < 16);
        Rgba([40, 160, 30, if is_hole { 0 } else { 255 }])
    });
    image.save(path).expect("a temporary file");
}

fn staged(scene: SceneDescription, strategy: Strategy, time: f64) -> Stage {
    let mut stage = Stage::new(scene, BuildOptions::best(), strategy).expect("within the limits");
    stage.show(time).expect("finite positions");
    stage
}

const MASK: &str = r#""alphaMode": "MASK""#;
const BLEND: &str = r#""alphaMode": "BLEND""#;

fn with(method: RenderMethod) -> RenderOptions {
    RenderOptions {
        method,
        bounces: 3,
        ..small()
    }
}

#[test]
fn holes_match_golden_images_with_every_strategy() {
    let scenes = [("mask", fence(MASK, 1.0)), ("blend", fence(BLEND, 0.6))];
    for (name, mut scene) in scenes {
        // Slanted light, so that the shadow is beside the fence.
        let node = scene.lights[0].node.expect("lights are in nodes");
        scene.nodes[node].transform = DAffine3::from_rotation_y(-0.5);
        for method in [RenderMethod::Whitted, RenderMethod::Diffuse] {
            let strategies = [
                Strategy::Auto,
                Strategy::Merge(MergeMethod::Guided),
                Strategy::Merge(MergeMethod::PartitionTrees),
                Strategy::Rebuild(BuildOptions::fast()),
            ];
            let pictures = strategies.map(|strategy| {
                let stage = staged(scene.clone(), strategy, 0.2);
                picture(&stage, &with(method))
            });
            assert!(
                pictures.iter().all(|other| *other == pictures[0]),
                "{name}, {method:?}: a strategy gives another picture"
            );
            let stage = staged(scene.clone(), Strategy::Auto, 0.2);
            let camera = stage.camera();
            let by_all = BruteForce::new(&stage);
            let by_all = render(&stage, &by_all, &camera, &with(method), &|_| {});
            assert!(
                by_all == pictures[0],
                "{name}, {method:?}: a test of every triangle gives another picture"
            );
            for threads in [1, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
                let here = pool
                    .expect("threads")
                    .install(|| picture(&stage, &with(method)));
                assert!(
                    here == pictures[0],
                    "{name}, {method:?}: threads change the picture"
                );
            }
        }
        let options = RenderOptions {
            bounces: 2,
            subpixels: 2,
            ..small()
        };
        let stage = staged(scene, Strategy::Auto, 0.2);
        check_golden(name, &picture(&stage, &options).picture);
    }
}

#[test]
fn a_texture_of_opacity_makes_holes_where_it_is_black() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let holes =
        image::GrayImage::from_fn(32, 32, |x, _| image::Luma([if x < 16 { 0 } else { 255 }]));
    let save = |name: &str, text: &str| std::fs::write(folder.path().join(name), text);
    holes.save(folder.path().join("holes.png")).expect("a file");
    save("a.mtl", "newmtl leaf\nKd 1 0 0\nmap_d holes.png\n").expect("a file");
    let square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    let object = format!("mtllib a.mtl\n{square}usemtl leaf\nf 1/1 2/2 3/3 4/4\n");
    save("a.obj", &object).expect("a file");
    let scene = load_scene(folder.path().join("a.obj"), &AffOptions::default()).expect("valid");
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let background = scene.background;
    let stage = staged(scene, Strategy::Auto, 0.0);
    let camera = Camera {
        eye: Vec3::new(0.0, 0.0, 5.0),
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov_degrees: 30.0,
    };
    let options = with(RenderMethod::Whitted);
    let seen = render(&stage, &stage.tracer(), &camera, &options, &|_| {}).picture;
    assert_eq!(seen.at(24, 24), background, "a hole on the left");
    let leaf = seen.at(40, 24);
    assert!(leaf.x > 0.2 && leaf.y == 0.0, "red on the right: {leaf}");
}

#[test]
fn parts_that_were_hidden_keep_their_hits_in_order() {
    // Two triangles in one place; the first is hidden for a while.
    let text = "l 5 5 5 a 0 3 4 k one { visibility 2 1 0 2 1 } k two { visibility 1 0 1 }
        x one { p 3 -1 -1 0 1 -1 0 0 1 0 } x two { p 3 -1 -1 0 1 -1 0 0 1 0 }
        v from 0 0 4 at 0 0 0 up 0 1 0 angle 60 hither 0.1 resolution 4 4";
    let mut stage = crate::stage(text, 0.0);
    let ray = Ray::new([0.0, 0.0, 4.0], [0.0, 0.0, -1.0]);
    for (time, expected) in [(0.0, 2), (1.5, 1), (2.5, 2)] {
        stage.show(time).expect("finite positions");
        let tracer = stage.tracer();
        let mut all = Vec::new();
        tracer.hits(&ray, usize::MAX, &mut all);
        assert_eq!(all.len(), expected, "{time} s");
        let one_by_one: Vec<PartHit> = tracer.each_hit(&ray).collect();
        assert_eq!(one_by_one, all, "{time} s");
        for last in &all {
            let mut behind = Vec::new();
            let absent = PartHit { part: 9, ..*last };
            tracer.hits_behind(&ray, &absent, usize::MAX, &mut behind);
            assert_eq!(behind, all, "no part is before all parts");
        }
    }
}

/// Answers batches of two queries, and nothing else.
struct Narrow<'a>(kd_render::FrameTracer<'a>);

impl Tracer for Narrow<'_> {
    fn intersect(&self, rays: &[Ray], hits: &mut [Option<PartHit>]) {
        self.0.intersect_batch(rays, hits);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool]) {
        self.0.occluded_batch(rays, occluded);
    }
}

#[test]
fn tracers_without_filters_give_the_same_picture() {
    for scene in [fence(MASK, 1.0), fence(BLEND, 0.6)] {
        let stage = staged(scene, Strategy::Auto, 0.2);
        let options = with(RenderMethod::Whitted);
        let camera = stage.camera();
        let narrow = render(&stage, &Narrow(stage.tracer()), &camera, &options, &|_| {});
        assert!(narrow == picture(&stage, &options));
    }
}

/// The wall behind a fence that turns: what the camera sees at a place of the wall, and whether light reaches it.
fn wall_at(scene: &SceneDescription, x: f32, y: f32, time: f64) -> Vec3 {
    let stage = staged(scene.clone(), Strategy::Auto, time);
    let mut camera = stage.camera();
    // From the side, so that the fence is in the way of the light alone.
    camera.eye = Vec3::new(x, y, -1.0);
    camera.target = Vec3::new(x, y, -2.0);
    let options = with(RenderMethod::Whitted);
    let seen = render(&stage, &stage.tracer(), &camera, &options, &|_| {});
    seen.picture.at(32, 24)
}

#[test]
fn light_falls_through_holes_where_they_are() {
    let scene = fence(MASK, 1.0);
    let [shadow, light] = [[-0.5, 0.5], [0.5, 0.5]].map(|[x, y]| wall_at(&scene, x, y, 0.0));
    assert!(light.x > 0.5 && shadow.x < 0.3, "{light} {shadow}");
    for (x, y, is_lit) in [
        (0.5, 0.5, true),
        (-0.5, -0.5, true),
        (0.5, -0.5, false),
        (-0.5, 0.5, false),
        (0.02, 0.02, true),
        (-0.02, 0.02, false),
        (1.5, 0.5, true),
    ] {
        let expected = if is_lit { light } else { shadow };
        let found = wall_at(&scene, x, y, 0.0);
        assert!(
            found.distance(expected) < 0.02,
            "({x}, {y}): {found}, not {expected}"
        );
        // After half a turn, the holes are on the other sides.
        let turned = wall_at(&scene, -x, y, 2.0);
        assert!(
            turned.distance(expected) < 0.02,
            "turned ({x}, {y}): {turned}"
        );
    }
}

#[test]
fn blended_surfaces_dim_light_by_their_opacity() {
    let behind_leaf = |alpha| wall_at(&fence(BLEND, alpha), -0.5, 0.5, 0.0);
    let [shadow, dimmed, light] = [1.0, 0.25, 0.0].map(behind_leaf);
    assert!(light.x - shadow.x > 0.3, "{light} {shadow}");
    let expected = shadow.lerp(light, 0.75);
    assert!(dimmed.distance(expected) < 0.01, "{dimmed}, not {expected}");
    let hole = wall_at(&fence(BLEND, 0.25), 0.5, 0.5, 0.0);
    assert_eq!(hole, light, "a hole lets all light through");
}

#[test]
fn colors_are_blended_by_opacity() {
    let middle = |scene: SceneDescription| {
        let stage = staged(scene, Strategy::Auto, 0.0);
        let options = with(RenderMethod::Whitted);
        let seen = picture(&stage, &options).picture;
        // A leaf, left of the middle and above it.
        seen.at(27, 19)
    };
    let opaque = middle(fence(BLEND, 1.0));
    assert_eq!(opaque, middle(fence(MASK, 1.0)), "alpha of 1 covers all");
    let behind = middle(fence(BLEND, 0.0));
    assert_eq!(behind, middle(fence(MASK, 0.4)), "below the usual cutoff");
    let low = r#""alphaMode": "MASK", "alphaCutoff": 0.3"#;
    assert_eq!(opaque, middle(fence(low, 0.4)), "not below this cutoff");
    let half = middle(fence(BLEND, 0.5));
    // The wall is in the shadow of half of the leaf, and half of it is seen.
    let shadow = {
        let mut dark = fence(BLEND, 0.0);
        dark.lights.clear();
        dark.lights
            .push(kd_scene::Light::point(Vec3::ZERO, Vec3::ZERO));
        middle(dark)
    };
    let wall = 0.5 * (behind + shadow);
    let expected = 0.5 * opaque + 0.5 * wall;
    assert!(half.distance(expected) < 0.01, "{half}, not {expected}");
    let ignored = middle(fence(r#""alphaMode": "OPAQUE""#, 0.0));
    assert_eq!(opaque, ignored, "OPAQUE has no holes");
}

#[test]
fn without_textures_their_holes_are_closed() {
    let scene = fence(MASK, 1.0);
    assert_eq!(
        scene.materials[0].alpha_mode,
        AlphaMode::Mask { cutoff: 0.5 }
    );
    let stage = staged(scene, Strategy::Auto, 0.0);
    let at_hole = |textures| {
        let options = RenderOptions {
            textures,
            ..with(RenderMethod::Whitted)
        };
        picture(&stage, &options).picture.at(37, 19)
    };
    assert!(at_hole(true).distance(at_hole(false)) > 0.1);
}

#[test]
fn paths_end_at_blended_surfaces_in_proportion() {
    let mean = |scene: SceneDescription| {
        let stage = staged(scene, Strategy::Auto, 0.0);
        let options = RenderOptions {
            bounces: 0,
            subpixels: 8,
            ..with(RenderMethod::Diffuse)
        };
        let seen = picture(&stage, &options).picture;
        let around = (24..30).flat_map(|x| (16..22).map(move |y| (x, y)));
        around.map(|(x, y)| seen.at(x, y)).sum::<Vec3>() / 36.0
    };
    let [behind, opaque, quarter] = [0.0, 1.0, 0.25].map(|alpha| mean(fence(BLEND, alpha)));
    // The wall gets three quarters of its light, and three quarters of it are seen.
    let expected = 0.25 * opaque + 0.75 * 0.75 * behind;
    assert!(
        quarter.distance(expected) < 0.02,
        "{quarter}, not {expected}"
    );
}
