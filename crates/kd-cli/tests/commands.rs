//! The program as one uses it.

use std::path::Path;
use std::process::{Command, Output};

fn kd(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_kd");
    let run = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output();
    run.expect("it can be started")
}

/// Runs it, and gives what it printed.
#[track_caller]
fn told(folder: &Path, arguments: &[&str]) -> String {
    let output = kd(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[track_caller]
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = kd(folder, arguments);
    assert!(!output.status.success(), "{arguments:?} should fail");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!errors.contains("panicked"), "{arguments:?}: {errors}");
    errors
}

/// As by `kd stats room | head -1`.
#[test]
fn nobody_need_read_what_is_printed() {
    let folder = tempfile::tempdir().expect("a folder");
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let mut run = Command::new(env!("CARGO_BIN_EXE_kd"));
    let run = run
        .args(["stats", "room:1"])
        .current_dir(&folder)
        .stdout(writer);
    let output = run.output().expect("it can be started");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && errors.is_empty(), "{errors}");
}

#[test]
fn an_obj_file_is_a_picture_with_one_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    told(at, &["convert", "balls:1", "-o", "balls.obj"]);
    let text = told(at, &["render", "balls.obj", "--size", "64x48"]);
    assert!(
        text.contains("out.png") && text.contains("rays a second"),
        "{text}"
    );
    let picture = image::open(at.join("out.png")).expect("written").to_rgb8();
    assert_eq!(picture.dimensions(), (64, 48));
    let first = picture.get_pixel(0, 0);
    assert!(
        picture.pixels().any(|pixel| pixel != first),
        "something is seen"
    );
}

#[test]
fn an_animation_is_numbered_or_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    told(
        at,
        &[
            "render", "room:1", "--frames", "3..5", "--size", "32x24", "-o", "a.png",
        ],
    );
    let open = |name: &str| image::open(at.join(name)).expect("written").to_rgb8();
    assert_ne!(open("a_0003.png"), open("a_0004.png"), "something moves");
    told(
        at,
        &[
            "render", "room:1", "--frames", "0..3", "--size", "32x24", "-o", "a.gif",
        ],
    );
    let file = std::fs::File::open(at.join("a.gif")).expect("written");
    let decoder = image::codecs::gif::GifDecoder::new(std::io::BufReader::new(file));
    let frames = image::AnimationDecoder::into_frames(decoder.expect("a GIF"));
    assert_eq!(frames.count(), 3);
}

#[test]
fn views_of_the_tree_are_other_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
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
        told(at, &arguments);
        pictures.push(image::open(at.join(file)).expect("written").to_rgb8());
    }
    for (i, a) in pictures.iter().enumerate() {
        assert!(
            pictures[..i].iter().all(|b| a != b),
            "picture {i} is another"
        );
    }
}

#[test]
fn scenes_are_told_compared_and_converted() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let text = told(at, &["stats", "room:1"]);
    assert!(
        text.contains("250 frames") && text.contains("car/wheel") && text.contains("SAH cost"),
        "{text}"
    );
    let text = told(at, &["compare", "gears:1", "--size", "40x30"]);
    assert!(
        ["best", "balanced", "fast"]
            .iter()
            .all(|name| text.contains(name)),
        "{text}"
    );
    for name in ["a.ply", "a.kd"] {
        told(at, &["convert", "tetra:2", "-o", name]);
        assert!(at.join(name).exists(), "{name}");
    }
    let text = told(at, &["stats", "a.ply", "--builder", "fast"]);
    assert!(text.contains("triangles    16"), "{text}");
}

#[test]
fn what_is_wrong_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("bad.aff"), "s 0 0 0\nq").expect("written");
    std::fs::write(at.join("known.aff"), "s 0 0 0 1\nq 1 2").expect("written");
    for (arguments, expected) in [
        (&["render", "none.obj"][..], "none.obj: cannot open"),
        (
            &["render", "bad.aff"],
            "bad.aff: line 2: the radius of a sphere: `q` is not a number",
        ),
        (
            &["render", "known.aff"],
            "known.aff: line 2: `q` is not a command of AFF",
        ),
        (&["render", "nothing:3"], "no generated scene `nothing`"),
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
        (&["render", "gears:1", "--size", "0x5"], "from 1 to 32768"),
        (
            &["convert", "gears:1", "-o", "a.doc"],
            "meshes are written as .ply or .obj",
        ),
    ] {
        let errors = refused(at, arguments);
        assert!(errors.contains(expected), "{arguments:?}: {errors}");
    }
    let output = kd(at, &["render", "known.aff", "--lenient", "--size", "8x6"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && errors.contains("left out"),
        "{errors}"
    );
}
