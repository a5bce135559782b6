//! Runs the program and checks its output, files and errors.

mod program;

use std::process::Command;

use program::{error_of, kd, stdout_of};

/// As in `kd stats room:1 | head -1`.
#[test]
fn a_closed_stdout_is_not_an_error() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let mut run = Command::new(env!("CARGO_BIN_EXE_kd"));
    let run = run
        .args(["stats", "room:1"])
        .current_dir(&folder)
        .stdout(writer);
    let output = run.output().expect("the program starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{errors}");
}

#[test]
fn one_command_renders_an_obj_file() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    stdout_of(at, &["convert", "balls:1", "-o", "balls.obj"]);
    let text = stdout_of(at, &["render", "balls.obj", "--size", "64x48"]);
    assert!(
        text.contains("out.png") && text.contains("rays per second"),
        "{text}"
    );
    let picture = image::open(at.join("out.png"))
        .expect("a written file")
        .to_rgb8();
    assert_eq!(picture.dimensions(), (64, 48));
    let first = picture.get_pixel(0, 0);
    assert!(
        picture.pixels().any(|pixel| pixel != first),
        "the scene is visible"
    );
}

#[test]
fn an_animation_becomes_numbered_files_or_a_gif() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    stdout_of(
        at,
        &[
            "render", "room:1", "--frames", "3..5", "--size", "32x24", "-o", "a.png",
        ],
    );
    let open = |name: &str| {
        image::open(at.join(name))
            .expect("a written file")
            .to_rgb8()
    };
    assert_ne!(open("a_0003.png"), open("a_0004.png"), "the frames differ");
    stdout_of(
        at,
        &[
            "render", "room:1", "--frames", "0..3", "--size", "32x24", "-o", "a.gif",
        ],
    );
    let file = std::fs::File::open(at.join("a.gif")).expect("a written file");
    let decoder = image::codecs::gif::GifDecoder::new(std::io::BufReader::new(file));
    let frames = image::AnimationDecoder::into_frames(decoder.expect("a GIF"));
    assert_eq!(frames.count(), 3);
}

#[test]
fn every_view_gives_a_different_picture() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let mut pictures = vec![];
    for (name, view) in [
        ("scene", &[][..]),
        ("heat", &["--heatmap"]),
        ("depth", &["--view", "depth"]),
        ("boxes", &["--view", "boxes", "--level", "3"]),
        ("soft", &["--diffuse"]),
    ] {
        let file = format!("{name}.png");
        let mut arguments = vec!["render", "room:1", "--size", "40x30", "-o", &file];
        arguments.extend(view);
        stdout_of(at, &arguments);
        pictures.push(
            image::open(at.join(file))
                .expect("a written file")
                .to_rgb8(),
        );
    }
    for (i, a) in pictures.iter().enumerate() {
        assert!(
            pictures[..i].iter().all(|b| a != b),
            "picture {i} differs from all others"
        );
    }
}

#[test]
fn stats_compare_and_convert_succeed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    let text = stdout_of(at, &["stats", "room:1"]);
    assert!(
        text.contains("250 frames") && text.contains("car/wheel") && text.contains("SAH cost"),
        "{text}"
    );
    let text = stdout_of(at, &["compare", "gears:1", "--size", "40x30"]);
    assert!(
        ["best", "balanced", "fast"]
            .iter()
            .all(|name| text.contains(name)),
        "{text}"
    );
    for name in ["a.ply", "a.kd"] {
        stdout_of(at, &["convert", "tetra:2", "-o", name]);
        assert!(at.join(name).exists(), "{name}");
    }
    let text = stdout_of(at, &["stats", "a.ply", "--builder", "fast"]);
    assert!(text.contains("triangles    16"), "{text}");
}

/// A triangle, in three places.
const INSTANCES: &str = r#"{ "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }],
    "nodes": [{ "name": "leaf", "mesh": 0, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 1 } } } }],
    "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
    "accessors": [
        { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 },
        { "bufferView": 0, "byteOffset": 36, "componentType": 5126, "type": "VEC3", "count": 3 }
    ],
    "bufferViews": [{ "buffer": 0, "byteLength": 72 }],
    "buffers": [{ "byteLength": 72, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAAAAAAQAAAAAAAAAAAAACAQAAAAAAAAAAA" }]
}"#;

#[test]
fn triangles_count_with_instances() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    std::fs::write(at.join("leaves.gltf"), INSTANCES).expect("a temporary file");
    let text = stdout_of(at, &["stats", "leaves.gltf"]);
    assert!(
        text.contains("triangles    3, of which 0 can move")
            && text.contains("leaf: 1 in each of 3 instances"),
        "{text}"
    );
    let text = stdout_of(at, &["render", "leaves.gltf", "--size", "8x6"]);
    assert!(text.contains("out.png: 3 triangles, 1 frame"), "{text}");
    std::fs::write(at.join("rays.csv"), "4.2,0.2,5,0,0,-1\n").expect("a temporary file");
    let text = stdout_of(at, &["cast", "leaves.gltf", "rays.csv"]);
    assert!(text.contains("1 of which hit one of 3 triangles"), "{text}");
}

#[test]
fn errors_name_their_cause() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = folder.path();
    std::fs::write(at.join("bad.aff"), "s 0 0 0\nq").expect("a written file");
    std::fs::write(at.join("known.aff"), "s 0 0 0 1\nq 1 2").expect("a written file");
    for (arguments, expected) in [
        (&["render", "none.obj"][..], "none.obj: cannot open"),
        (
            &["render", "bad.aff"],
            "bad.aff: line 2: the radius of a sphere: `q` is not a number",
        ),
        (
            &["render", "known.aff"],
            "known.aff: line 2: unknown command `q`",
        ),
        (
            &["render", "nothing:3"],
            "unknown generated scene `nothing`",
        ),
        (&["render", "gears:0"], "size must be at least 1"),
        (&["render", "gears:1", "-o", "a.txt"], "a.txt"),
        (
            &["render", "gears:1", "--frame", "3"],
            "the scene has no animation",
        ),
        (
            &["render", "room:1", "--frames", "240..251"],
            "the animation has 250 frames",
        ),
        (
            &["render", "gears:1", "--size", "0x5"],
            "must be from 1 to 32768",
        ),
        (
            &["convert", "gears:1", "-o", "a.doc"],
            "use .ply or .obj for a mesh, .kd for a tree",
        ),
    ] {
        let errors = error_of(at, arguments);
        assert!(errors.contains(expected), "{arguments:?}: {errors}");
    }
    let output = kd(at, &["render", "known.aff", "--lenient", "--size", "8x6"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && errors.contains("skipped"),
        "{errors}"
    );
}
