//! Pictures are compared with golden images, with a test of every triangle, and across numbers of threads.
//!
//! `KD_GOLDEN=write` overwrites the golden images, for inspection by eye.

mod brute_force;
mod cutouts;
mod instances;

use std::path::{Path, PathBuf};

use kd::glam::Vec3;
use kd::{BuildOptions, MergeMethod, Ray, Strategy};
use kd_render::{
    Picture, RenderMethod, RenderOptions, Rendering, Stage, draw_boxes, heat_map, leaf_depths,
    render,
};
use kd_scene::{AffOptions, SceneDescription, load_aff, toy_room};
use kd_trace::RayQuery;

use brute_force::BruteForce;

const SPHERES: &str = "
b 0.2 0.3 0.5 v from 1 3 6 at 0 0.6 0 up 0 1 0 angle 40 hither 0.1 resolution 64 48
l 4 6 3 0.6 0.6 0.5  l -4 5 2 0.3 0.3 0.4
f 0.7 0.7 0.7 0.8 0.2 30 0 0  p 4 -5 0 5 5 0 5 5 0 -5 -5 0 -5
f 0.9 0.2 0.1 0.8 0.3 40 0 0  s -1.2 0.8 0 0.8
f 0.1 0.7 0.2 0.8 0.1 10 0 0  s 0.9 0.6 0.4 0.6
fm 0 0 0 0.1 0.1 0.1 0.8 0.8 0.8 90 0 0  s 0.2 1 -1.5 1
f 0.2 0.3 0.9 0.8 0.2 20 0 0  c 2.2 0 -0.5 0.5 2.2 1.5 -0.5 0.1
pp 3 -2.5 0 -2 0 0 1 -1.5 0 -2 1 0 1 -2 2 -2 0 1 1
";

const GLASS: &str = "
b 0.6 0.7 0.9 v from 0 1.2 5 at 0 0.8 0 up 0 1 0 angle 45 hither 0.1 resolution 64 48
l 3 5 4 0.8 0.8 0.8
f 0.9 0.9 0.8 0.7 0 0 0 0  p 4 -6 0 6 6 0 6 6 0 -6 -6 0 -6
f 0.9 0.1 0.1 0.8 0 0 0 0  p 4 -3 0 -3 -2 0 -3 -2 3 -3 -3 3 -3  p 4 1 0 -3 2 0 -3 2 3 -3 1 3 -3
fm 0 0 0 0 0 0 0.1 0.1 0.1 60 0.9 1.5  s -0.9 1 0 0.9
fm 0 0 0 0 0 0 0.1 0.1 0.1 60 0.9 1.0  s 1.2 0.8 0.5 0.7
fm 0 0 0 0 0 0 0 0 0 60 0.9 2.4  p 4 -0.2 0 1.4 0.4 0 1.4 0.4 1 1.4 -0.2 1 1.4
";

const MUSEUM: &str = "
b 0 0 0 v from 0 1.6 -6 at 0 1.6 0 up 0 1 0 angle 45 hither 0.1 resolution 64 48
l -3 4 -2 0.6 0.6 0.6  la lamp 3 4 -2 0.5 0.5 0.5
fm 0.2 0.2 0.2 0.7 0.7 0.6 0 0 0 20 0 0
p 8 4 0 -2 4 0 2 2 0 4 -2 0 4 -4 0 2 -4 0 -2 -2 0 -7 2 0 -7
p 4 -4 0 3 4 0 3 4 5 3 -4 5 3
fm 0.1 0.1 0.1 0.2 0.2 0.2 0.6 0.6 0.6 50 0 0
p 6 -1 0.5 -1 -1 0.5 1 1 0.5 1 1 0.5 -1 0.3 0.5 -0.2 -0.3 0.5 -0.2
c 0 0 0 0.4 0 0.5 0 0.3
fm 0.25 0.15 0.15 0.5 0.35 0.2 0.4 0.4 0.4 20 0 0
tpa 2 0 -1 1 0 0 0 -1 1 1 0 0 0 -1 0 2 0 0 0 -1 2 -1 2 0 0 1 -1 1 2 0 0 1 -1 0 3 1 0 1 -1
tpa 2 0 -1 1 0 0 0 -1 0 2 0 0 0 -1 -1 3 0 0 0 -1 2 1 2 0 0 1 -1 0 3 1 0 1 -1 1 3 -1 0 1 -1
a 0 2 3
k lamp { transl 4 0 0 0 0 0 0 0 0 0 0 0 0 0 0 2 -2 0 0 0 0 0 2 -2 0 0 0 0 0 }
k camera { transl 4 0 0 1.6 -6 0 0 0 0 0 1.6 -6 0 0 0 2 1 2 -5 0 0 0 2 1 2 -5 0 0 0
 rot 4 0 0 1 0 180 0 0 0 0 0 1 0 180 0 0 0 2 0 1 0 170 0 0 0 2 0 1 0 170 0 0 0 }
";

const TEXTURES: &str = "
b 0.3 0.3 0.4 v from 0.5 1.5 4 at 0.5 0.6 0 up 0 1 0 angle 45 hither 0.1 resolution 64 48
l 2 4 4 0.9 0.9 0.9
fm 0.3 0.3 0.3 0.8 0.8 0.8 0.1 0.1 0.1 20 0 0
m vertices 4 -3 0 3 4 0 3 4 0 -3 -3 0 -3 texturecoords 4 checks.ppm 0 0 7 0 7 6 0 6
 triangles 2 0 1 2 0 1 2 0 2 3 0 2 3
tt checks.ppm -1 0 -1 0 2 1 0 -1 2 2 1 2 -1 2 0
ttp missing.ppm 1 0 -1 0 0 1 0 1 2 0 -1 0.5 0 1 1 1 2 2 -1 0 0 1 1 0
";

/// The stage of an AFF text at a time, in a temporary folder with its texture.
fn stage(text: &str, time: f64) -> Stage {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let checks = "P3 4 2 255\n255 255 255 40 40 40 200 30 30 40 40 40\n40 40 40 30 30 200 40 40 40 250 250 100\n";
    std::fs::write(folder.path().join("checks.ppm"), checks).expect("a written file");
    let file = folder.path().join("scene.aff");
    std::fs::write(&file, text).expect("a written file");
    let scene = load_aff(file, &AffOptions::default()).expect("valid");
    staged(scene, time)
}

fn staged(scene: SceneDescription, time: f64) -> Stage {
    let mut stage =
        Stage::new(scene, BuildOptions::best(), Strategy::Auto).expect("within the limits");
    stage.show(time).expect("finite positions");
    stage
}

pub(crate) fn small() -> RenderOptions {
    RenderOptions {
        width: 64,
        height: 48,
        ..RenderOptions::default()
    }
}

pub(crate) fn picture(stage: &Stage, options: &RenderOptions) -> Rendering {
    render(stage, &stage.tracer(), &stage.camera(), options, &|_| {})
}

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/golden")
        .join(format!("{name}.png"))
}

/// The mean difference of two pictures, of 255, and the number of pixels that differ visibly (by more than 16).
pub(crate) fn difference(a: &Picture, b: &image::RgbImage) -> (f64, usize) {
    let a = a.to_image();
    assert_eq!(a.dimensions(), b.dimensions(), "equal size");
    let (mut sum, mut far) = (0.0, 0);
    for (a, b) in a.pixels().zip(b.pixels()) {
        let apart = a.0.iter().zip(b.0).map(|(a, b)| a.abs_diff(b));
        let apart = apart.max().expect("three channels");
        sum += f64::from(apart);
        far += usize::from(apart > 16);
    }
    (sum / f64::from(b.width() * b.height()), far)
}

/// Compares a picture with the golden image of that name.
pub(crate) fn check_golden(name: &str, ours: &Picture) {
    let path = golden(name);
    if std::env::var("KD_GOLDEN").as_deref() == Ok("write") {
        ours.save(&path).expect("a written file");
    }
    let known = image::open(&path).expect("a golden image").to_rgb8();
    let (mean, far) = difference(ours, &known);
    // Sines and powers differ in the last digits between platforms, so rays near edges may hit another surface.
    assert!(
        mean < 0.5 && far <= 15,
        "{name}: mean difference {mean} of 255, {far} pixels differ visibly"
    );
}

#[test]
fn pictures_match_golden_images() {
    let scenes = [
        ("room", staged(toy_room(1).expect("within the limits"), 1.2)),
        ("museum", stage(MUSEUM, 1.3)),
        ("spheres", stage(SPHERES, 0.0)),
        ("textures", stage(TEXTURES, 0.0)),
        ("glass", stage(GLASS, 0.0)),
    ];
    for (name, stage) in &scenes {
        let options = RenderOptions {
            bounces: 4,
            subpixels: 2,
            ..small()
        };
        let ours = picture(stage, &options).picture;
        check_golden(name, &ours);
        // A test of every triangle gives the same picture, bit for bit, with as many rays.
        let thumbnail = RenderOptions {
            width: 24,
            height: 18,
            bounces: 3,
            ..small()
        };
        let by_tree = picture(stage, &thumbnail);
        let camera = stage.camera();
        let by_all = render(stage, &BruteForce::new(stage), &camera, &thumbnail, &|_| {});
        assert!(
            by_tree == by_all,
            "{name}: a test of every triangle gives another picture"
        );
    }
}

#[test]
fn frame_tracer_equals_brute_force() {
    let stage = stage(MUSEUM, 1.3);
    let (tracer, every_triangle) = (stage.tracer(), BruteForce::new(&stage));
    let view = stage.camera().view(4.0 / 3.0);
    let (mut of_tree, mut of_all) = (Vec::new(), Vec::new());
    let mut most = 0;
    for pixel in 0..40 * 30 {
        let direction = view.through_pixel(pixel % 40, pixel / 40, 40, 30);
        let ray = Ray::new(view.eye, direction);
        assert_eq!(
            tracer.intersect(&ray),
            every_triangle.intersect(&ray),
            "{ray:?}"
        );
        assert_eq!(
            tracer.occluded(&ray),
            every_triangle.occluded(&ray),
            "{ray:?}"
        );
        tracer.hits(&ray, 3, &mut of_tree);
        every_triangle.hits(&ray, 3, &mut of_all);
        assert_eq!(of_tree, of_all, "{ray:?}");
        most = most.max(of_all.len());
    }
    assert_eq!(most, 3, "some ray has several hits");
}

#[test]
fn every_strategy_gives_the_same_picture() {
    let room = toy_room(1).expect("within the limits");
    let mut pictures = vec![];
    for strategy in [
        Strategy::Auto,
        Strategy::Merge(MergeMethod::Guided),
        Strategy::Merge(MergeMethod::PartitionTrees),
        Strategy::Rebuild(BuildOptions::fast()),
    ] {
        let mut stage =
            Stage::new(room.clone(), BuildOptions::best(), strategy).expect("within the limits");
        for time in [0.4, 2.0] {
            stage.show(time).expect("finite positions");
        }
        pictures.push(picture(&stage, &small()));
    }
    assert!(pictures.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn thread_count_does_not_change_pictures() {
    let stage = stage(MUSEUM, 0.5);
    for method in [RenderMethod::Whitted, RenderMethod::Diffuse] {
        let options = RenderOptions {
            method,
            bounces: 3,
            ..small()
        };
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| picture(&stage, &options))
        };
        let (one, three) = (on(1), on(3));
        assert!(one == three, "{method:?}");
        let kinds = [one.rays.mirrored > 0, one.rays.diffuse > 0];
        assert_eq!(
            kinds,
            [
                method == RenderMethod::Whitted,
                method == RenderMethod::Diffuse
            ]
        );
        assert_eq!(one.rays.primary, 64 * 48);
    }
}

#[test]
fn diffuse_light_passes_the_white_furnace_test() {
    // A white body under a white sky is invisible.
    let text = "b 1 1 1 fm 0 0 0 1 1 1 0 0 0 0 0 0
        p 3 -1 0 1 1 0 1 0 1.5 0 p 3 1 0 1 0 0 -1 0 1.5 0 p 3 0 0 -1 -1 0 1 0 1.5 0 p 3 0 0 -1 1 0 1 -1 0 1
        v from 0 1 4 at 0 0.5 0 up 0 1 0 angle 30 hither 0.1 resolution 8 8";
    let stage = stage(&format!("l 0 0 0 0 0 0 {text}"), 0.0);
    let options = RenderOptions {
        method: RenderMethod::Diffuse,
        bounces: 20,
        ..small()
    };
    let white = picture(&stage, &options).picture;
    let far = white
        .pixels
        .iter()
        .filter(|color| color.distance(Vec3::ONE) > 1e-3);
    assert_eq!(
        far.count(),
        0,
        "a convex body reflects light of the sky only"
    );
}

#[test]
fn missing_textures_and_lights_are_warnings() {
    let with_textures = stage(TEXTURES, 0.0);
    let warnings = with_textures.warnings().join("\n");
    assert!(
        warnings.contains("missing.ppm") && warnings.contains("plain color"),
        "{warnings}"
    );
    let dark = stage("s 0 0 0 1", 0.0);
    assert!(
        dark.warnings().join("\n").contains("no light"),
        "{:?}",
        dark.warnings()
    );
    let picture = picture(&dark, &small()).picture;
    assert!(
        picture.at(32, 24).max_element() > 0.3,
        "the default light makes the sphere visible"
    );
}

#[test]
fn every_camera_gives_finite_pixels() {
    for text in [
        "s 0 0 0 1 v from 0 0 0 at 0 0 1 up 0 1 0 angle 60 hither 0.1 resolution 4 4",
        "s 0 0 0 1 v from 0 0 0 at 0 0 0 up 0 0 0 angle 60 hither 0.1 resolution 4 4",
        "v from 0 0 0 at 0 0 1 up 0 0 1 angle 60 hither 0.1 resolution 4 4",
        "p 3 0 0 0 1 1 1 2 2 2 l 0 0 0",
        "",
    ] {
        let stage = stage(text, 0.0);
        let picture = picture(&stage, &small()).picture;
        assert!(
            picture.pixels.iter().all(|color| color.is_finite()),
            "{text}"
        );
    }
}

#[test]
fn invisible_parts_are_not_rendered() {
    let text = "l 5 5 5 x ball { s 0 0 0 1 } k ball { visibility 2 1 0 2 1 } a 0 3 4
        v from 0 0 4 at 0 0 0 up 0 1 0 angle 60 hither 0.1 resolution 4 4";
    let mut stage = stage(text, 0.0);
    let mut seen = vec![];
    for time in [0.0, 1.5, 2.5, 1.2, 0.5] {
        stage.show(time).expect("finite positions");
        seen.push(picture(&stage, &small()).picture.at(32, 24) != Vec3::ZERO);
    }
    assert_eq!(seen, [true, false, true, false, true]);
}

#[test]
fn a_failed_show_leaves_other_times_intact() {
    let text = "l 5 5 5 x ball { s 0 0 0 1.5 } a 0 3 4
        k ball { scale 4 0 1 1 1 0 0 0 0 1 1 1 0 0 0 2 3e38 1 1 0 0 0 3 3e38 1 1 0 0 0 }
        v from 0 0 4 at 0 0 0 up 0 1 0 angle 60 hither 0.1 resolution 4 4";
    let mut stage = stage(text, 0.0);
    let before = picture(&stage, &small());
    assert!(stage.show(2.0).is_err(), "positions overflow f32");
    stage.show(0.0).expect("valid again");
    assert!(
        picture(&stage, &small()) == before,
        "the picture is unchanged"
    );
}

#[test]
fn views_agree_with_the_tree() {
    let stage = staged(toy_room(1).expect("within the limits"), 0.0);
    let mesh = stage.description().mesh_at(0.0).expect("finite positions");
    let tree = kd::KdTree::build(mesh, &BuildOptions::best()).expect("within the limits");
    let camera = stage.camera();
    let heat = heat_map(&tree, &camera, [32, 24]);
    assert!(
        heat.mean > 1.0 && heat.brightest as f64 >= heat.mean,
        "{}, {}",
        heat.mean,
        heat.brightest
    );
    let depths = leaf_depths(&tree, &camera, [32, 24]).expect("a small tree");
    let deepest =
        u64::try_from(tree.kd_tree().expect("built").depth()).expect("a depth of at most 64");
    assert!(
        depths.mean > 3.0 && depths.brightest <= deepest,
        "{}, {}",
        depths.mean,
        depths.brightest
    );
    let plain = picture(&stage, &small()).picture;
    let mut changed = vec![];
    for level in [0, 4, 8] {
        let mut picture = plain.clone();
        draw_boxes(&mut picture, &tree, &camera, level).expect("built");
        let pairs = picture.pixels.iter().zip(&plain.pixels);
        changed.push(pairs.filter(|(a, b)| a != b).count());
    }
    assert!(
        changed.is_sorted() && changed[2] > 200,
        "deeper levels draw more boxes: {changed:?}"
    );
}
