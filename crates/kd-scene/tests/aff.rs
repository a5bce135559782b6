//! The AFF reader: every command, every error, and BART's scenes compared with known frames.
#![allow(clippy::print_stderr, reason = "a skipped test reports it")]

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use glam::Vec3;
use kd_scene::{
    AffOptions, LoadError, Place, SceneDescription, Surface, WarningCode, load_aff, load_mesh,
    read_aff,
};

/// Reads a scene from texts in memory; the first file is the scene.
fn read(files: &[(&str, &str)], options: &AffOptions) -> Result<SceneDescription, LoadError> {
    let all: HashMap<PathBuf, &str> = files
        .iter()
        .map(|(name, text)| (name.into(), *text))
        .collect();
    let mut open = |path: &Path| match all.get(path) {
        Some(text) => Ok(text.as_bytes().to_vec()),
        None => Err(io::ErrorKind::NotFound.into()),
    };
    read_aff(files[0].0.as_ref(), &mut open, options)
}

fn read_one(text: &str) -> Result<SceneDescription, LoadError> {
    read(&[("scene.aff", text)], &AffOptions::default())
}

const EVERYTHING: &str = "
% A comment, and then # another
b 0.1 0.2 0.3
v from 0 1 5 at 0 1 0 up 0 1 0 angle 40 hither 0.01 resolution 80 60
am 0.5 0.5 0.5
l 1 2 3
la lamp 4 5 6 0.7 0.8 0.9
f 1 0.5 0.25 0.8 0.2 30 0 0
s 0 0 0 1
c 0 0 0 1 0 2 0 0.5
fm 0.1 0.1 0.1 0.2 0.2 0.2 0.3 0.3 0.3 50 0.5 1.5
p 4 0 0 0 4 0 0 4 4 0 3 1 0
pp 3 0 0 0 0 0 1 1 0 0 0 0 2 0 1 0 0 0 3
tt a.ppm 0 0 0 0 1 1 0 0 1 1 0 1 0 0 0
xs 2 2 2 0 0 9 90 10 0 0 {
  ttp b.ppm 0 0 0 0 0 1 0 1 1 0 0 0 0 1 1 1 0 1 0 0 0 1 0 0
  x car{
    m vertices 3 0 0 0 1 0 0 0 1 0
      normals 1 0 0 5
      texturecoords 2 c.ppm 0 0 1 1
      triangles 1 0 1 2 0 0 0 0 1 0
    x wheel { i 0 wheel.aff }
    i 3 detail.aff
  }
}
tpa 2 1 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1 3 2 0 0 0 0 1 3 0 0 0 0 1 2 1 0 0 0 1
a 0 4 5
k car {
  transl 4 0 0 0 0 0 0 0 1 1 0 0 0 0 0 2 2 0 0 0 0 0 3 3 0 0 0 0 0
  visibility 2 2 0 3 1
}
k lamp { transl 4 0 0 0 0 0 0 0 0 0 1 0 0 0 0 4 0 1 0 0 0 0 4 0 1 0 0 0 0 }
k camera { transl 4 0 9 0 0 0 0 0 0 9 0 0 0 0 0 4 9 0 0 0 0 0 4 9 0 0 0 0 0
           rot 4 0 0 1 0 0 0 0 0 0 0 1 0 90 0 0 0 4 0 1 0 90 0 0 0 4 0 1 0 90 0 0 0 }
";

#[test]
fn every_command_is_read() {
    let wheel = "p 3 0 0 0 1 0 0 0 0 1";
    let files = [("scene.aff", EVERYTHING), ("wheel.aff", wheel)];
    let scene = read(&files, &AffOptions::default()).expect("valid");
    assert_eq!(scene.background, Vec3::new(0.1, 0.2, 0.3));
    assert_eq!(scene.ambient, Vec3::splat(0.5));
    assert_eq!(scene.resolution, Some([80, 60]));
    let lights: Vec<_> = scene
        .lights
        .iter()
        .map(|l| (l.placed(4.0, &[]).0, l.color))
        .collect();
    let lamp = (Vec3::new(4.0, 6.0, 6.0), Vec3::new(0.7, 0.8, 0.9));
    assert_eq!(lights, [(Vec3::new(1.0, 2.0, 3.0), Vec3::ONE), lamp]);
    let [simple, full] = scene.materials.as_slice() else {
        panic!("{:?}", scene.materials);
    };
    assert_eq!(
        (simple.diffuse.x, simple.specular, simple.shine),
        (0.8, Vec3::splat(0.2), 30.0)
    );
    assert_eq!((full.transmittance, full.refraction), (0.5, 1.5));
    let names: Vec<_> = scene.textures.iter().map(|t| t.name.as_str()).collect();
    assert_eq!(names, ["a.ppm", "b.ppm", "c.ppm"]);

    let parts: Vec<_> = scene
        .parts
        .iter()
        .map(|p| (p.name.as_str(), p.mesh.len()))
        .collect();
    let static_triangles = 192 + 32 + 2 + 1 + 1 + 1;
    assert_eq!(
        parts,
        [
            ("", static_triangles),
            ("car", 1),
            ("car/wheel", 1),
            ("", 1)
        ]
    );
    let [fixed, car, _, morphing] = scene.parts.as_slice() else {
        unreachable!("the four parts above");
    };
    let Surface {
        materials,
        textures,
        normals,
        uvs,
        ..
    } = &fixed.surface;
    assert_eq!(
        [materials.len(), textures.len(), normals.len(), uvs.len()],
        [fixed.mesh.len(); 4]
    );
    assert_eq!(
        textures[224..],
        [
            Surface::NO_TEXTURE,
            Surface::NO_TEXTURE,
            Surface::NO_TEXTURE,
            0,
            1
        ]
    );
    assert_eq!(normals[226][1], Vec3::Z, "normals have unit length");
    // Rotated by 90 degrees about z, and scaled by 2.
    let corners = fixed.mesh.corners(228);
    assert!(
        (corners[1] - Vec3::new(10.0, 2.0, 0.0)).length() < 1e-6,
        "{corners:?}"
    );
    assert_eq!(car.surface.uvs, [[[0.0, 0.0], [1.0, 1.0], [0.0, 0.0]]]);
    assert_eq!(
        car.mesh.corners(0)[1],
        Vec3::X,
        "the mesh is in the coordinates of its block"
    );

    let nodes = scene.placed_nodes(1.5);
    let at = SceneDescription::placed_part(car, &nodes).transform_point3(Vec3::X);
    assert!((at - Vec3::new(10.0, 5.0, 0.0)).length() < 1e-5, "{at}");
    let seen = [1.5, 2.5, 3.5].map(|time| scene.is_visible(&scene.parts[2], time));
    assert_eq!(
        seen,
        [true, false, true],
        "the wheel is visible when the car is"
    );
    let positions = morphing.deformed(2.0, &nodes).expect("a morphing part");
    assert_eq!(positions[0], [1.0, 0.0, 0.0], "halfway between two keys");
    assert_eq!(
        scene.mesh_at(1.5).expect("finite").len(),
        fixed.mesh.len() + 3
    );

    let span = scene.span.expect("present");
    assert_eq!(
        [0, 1, 4, 9].map(|frame| span.time_of(frame)),
        [0.0, 1.0, 4.0, 4.0]
    );
    let camera = scene.camera_at(9.0).expect("present");
    assert_eq!(
        (camera.eye, camera.fov_degrees),
        (Vec3::new(9.0, 0.0, 0.0), 40.0)
    );
    assert!(
        (camera.target - Vec3::new(8.0, 0.0, 0.0)).length() < 1e-6,
        "{camera:?}"
    );
}

#[test]
fn spheres_and_cones_have_the_expected_orientation() {
    for (text, outwards) in [
        ("s 1 2 3 2", 1.0),
        ("s 1 2 3 -2", -1.0),
        ("c 1 0 3 2 1 4 3 1", 1.0),
        ("c 1 0 3 -2 1 4 3 -1", -1.0),
        ("xs 1 1 -1 0 1 0 0 0 0 6 { s 1 2 3 2 }", -1.0),
    ] {
        let scene = read_one(text).expect(text);
        let part = &scene.parts[0];
        for triangle in 0..u32::try_from(part.mesh.len()).expect("fits in 32 bits") {
            let corners = part.mesh.corners(triangle);
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            let mut from_axis = middle - Vec3::new(1.0, 2.0, 3.0);
            if text.starts_with('c') {
                from_axis.y = 0.0;
            }
            let normal = part.mesh.normal(triangle);
            assert!(
                outwards * normal.dot(from_axis) > 0.0,
                "{text}: {corners:?}"
            );
            let smooth = part.surface.normals[triangle as usize];
            // A reflection reverses triangles, but not the side that the normals define as outside.
            let side = if text.starts_with('x') { -1.0 } else { 1.0 };
            for at_corner in smooth {
                assert!(
                    (at_corner.length() - 1.0).abs() < 1e-5,
                    "{text}: {at_corner}"
                );
                assert!(
                    side * at_corner.dot(normal) > 0.8,
                    "{text}: {at_corner} of {normal}"
                );
            }
        }
    }
}

#[test]
fn errors_name_file_and_line() {
    let triangle = "m vertices 3 0 0 0 1 0 0 0 1 0\n";
    for (text, expected) in [
        ("\nq 1", "scene.aff: line 2: unknown command `q`"),
        (
            "nff\nversion 2.0",
            "scene.aff: line 1: the NFF format of Sense8 is not supported",
        ),
        (
            "s 0 0 zero 1",
            "scene.aff: line 1: the center of a sphere: `zero` is not a number",
        ),
        (
            "s 0 0 0",
            "scene.aff: line 1: expected the radius of a sphere, found the end of the file",
        ),
        (
            "p 2 0 0 0 1 1 1",
            "scene.aff: line 1: a polygon has 2 corners, at least 3 are needed",
        ),
        (
            "p 3 0 0 0 1e300 0 0 0 1 0",
            "scene.aff: line 1: a vertex is not finite in f32, or the part has more than 2^32 vertices",
        ),
        (
            "m vertices 1 0 0 0 faces",
            "scene.aff: line 1: expected `triangles`, found `faces`",
        ),
        (
            "m vertices -1",
            "scene.aff: line 1: the number of vertices: `-1` is not a count",
        ),
        (
            &format!("{triangle}triangles 1\n0 1 3"),
            "scene.aff: line 3: face 0: index 3 is out of range, there are 3 vertices",
        ),
        (
            "m vertices 99999999999 0 0 0",
            "scene.aff: line 1: expected a vertex, found the end of the file",
        ),
        (
            "tpa 0",
            "scene.aff: line 1: a morphing triangle needs at least 1 key",
        ),
        (
            "i 0 none.aff",
            "scene.aff: line 1: cannot include `none.aff`: entity not found",
        ),
        (
            "i 0 scene.aff",
            "scene.aff: line 1: `scene.aff` includes itself, directly or through other files",
        ),
        (
            "i 0 loop.aff",
            "loop.aff: line 1: `scene.aff` includes itself, directly or through other files",
        ),
        (
            "xs 1 1 1 0 0 0 0 0 0 0",
            "scene.aff: line 1: expected `{`, found the end of the file",
        ),
        (
            "x a {",
            "scene.aff: line 1: the file ends in a block, `}` is missing",
        ),
        ("x a { } }", "scene.aff: line 1: unknown command `}`"),
        (
            "k a { transl 1 0 0 0 0 0 0 0 }",
            "scene.aff: line 1: `transl` has 1 keys, at least 4 are needed",
        ),
        ("k a { turn", "scene.aff: line 1: `turn` is not a track"),
        (
            "a 0 1 0",
            "scene.aff: line 1: an animation of 0 frames from 0 to 1 s; at least 1 frame is needed, and an end that is not before the start",
        ),
        (
            "v from 0 0 0 at 0 0 1 up 0 1 0 angle 180 hither 1 resolution 1 1",
            "scene.aff: line 1: the angle of view is 180 degrees, it must be between 0 and 180",
        ),
        (
            "v from 0 0 0 at 0 0 1 up 0 1 0 angle 90 hither 1 resolution 0 1",
            "scene.aff: line 1: the width and height of the picture must be from 1 to 4294967295",
        ),
    ] {
        let files = [("scene.aff", text), ("loop.aff", "i 0 scene.aff")];
        let error = read(&files, &AffOptions::default()).expect_err(text);
        assert_eq!(error.to_string(), expected);
    }
    let error = read(
        &[("deep.aff", &"x a {".repeat(5000))],
        &AffOptions::default(),
    );
    let error = error.expect_err("too deep").to_string();
    assert_eq!(
        error,
        "deep.aff: line 1: blocks and files are nested more than 100 deep"
    );
}

#[test]
fn the_number_of_includes_is_bounded() {
    let names: Vec<String> = (0..40).map(|i| format!("{i}.aff")).collect();
    let texts: Vec<String> = (1..41)
        .map(|i| format!("i 0 {i}.aff i 0 {i}.aff"))
        .collect();
    let mut files: Vec<(&str, &str)> = names
        .iter()
        .zip(&texts)
        .map(|(a, b)| (&**a, &**b))
        .collect();
    files.push(("40.aff", ""));
    let error = read(&files, &AffOptions::default()).expect_err("2^40 files");
    assert!(
        error.to_string().ends_with("more than 65536 includes"),
        "{error}"
    );
}

#[test]
fn what_is_left_out_or_replaced_has_a_warning() {
    use WarningCode::{BadAnimation, BadElement, BadMaterial, BadPolygon};

    let key = |time: f64, x: f64| format!("{time} {x} 0 0 0 0 0 ");
    let track = [0.0, 1.0, 5.0, 3.0, 8.0, 9.0]
        .map(|time| key(time, 10.0 * time))
        .concat();
    let text = format!(
        "c 1 1 1 1 1 1 1 2\n\
         f 1 0 0\n\
         p 4 0 0 0 1 1 0 1 0 0 0 1 0\n\
         k box {{ transl 6 {track} visibility 3 0 1 6 0 4 1 }}\n\
         tpa 2 1 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1 0 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n\
         x box {{ s 0 0 0 1 }}"
    );
    let scene = read(&[("scene.aff", &text)], &AffOptions::default()).expect("valid");
    let found: Vec<_> = scene
        .warnings
        .iter()
        .map(|it| (it.code, it.place.clone(), it.count))
        .collect();
    let line = |line| Some(Place::Line(line));
    let expected = [
        (BadElement, line(1), 1),
        (BadMaterial, line(2), 1),
        (BadPolygon, line(3), 1),
        (BadAnimation, line(4), 3),
    ];
    assert_eq!(found, expected);
    assert_eq!(
        scene.materials[0].diffuse,
        Vec3::X,
        "a fill of three numbers"
    );
    // The segment from 1 to 5 counts until 5, then the one from 3 to 8.
    let x = |time: f64| scene.placed_nodes(time)[0].translation.x;
    assert!(
        (x(5.0) - 50.0).abs() < 1.0 && x(4.0) > 30.0,
        "{} {}",
        x(5.0),
        x(4.0)
    );
    let seen = [5.0, 6.0].map(|time| scene.nodes[0].keys.as_ref().expect("keys").is_visible(time));
    assert_eq!(seen, [true, true], "the key at 4 comes after the one at 6");
}

/// Vertices without triangles take memory too.
#[test]
fn loose_vertices_count_towards_the_maximum() {
    let vertices = "0 0 0 ".repeat(2000);
    let block = format!("m vertices 2000 {vertices} triangles 0\n");
    let options = AffOptions {
        max_triangles: 1000,
        ..AffOptions::default()
    };
    assert!(
        read(&[("scene.aff", &block)], &options).is_ok(),
        "666 of 1000"
    );
    let error = read(&[("scene.aff", &block.repeat(2))], &options).expect_err("1332 of 1000");
    assert!(
        error
            .to_string()
            .ends_with("more than 1000 triangles, the maximum"),
        "{error}"
    );
}

#[test]
fn a_view_needs_no_near_plane() {
    let text = "v from 0 0 5 at 0 0 0 up 0 1 0 angle 30\ns 0 0 0 1";
    let scene = read(&[("scene.aff", text)], &AffOptions::default()).expect("valid");
    assert_eq!(scene.camera.map(|camera| camera.fov_degrees), Some(30.0));
    assert_eq!(scene.resolution, None);
}

#[test]
fn lenient_reading_skips_unknown_commands() {
    let options = AffOptions {
        lenient: true,
        ..AffOptions::default()
    };
    let scene = read(&[("scene.aff", "g 1 2 3 { }\ns 0 0 0 1")], &options).expect("lenient");
    assert_eq!(scene.parts[0].mesh.len(), 192);
    assert_eq!(
        scene
            .warnings
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>(),
        ["scene.aff: line 1: skipped unknown command `g`"]
    );
}

#[test]
fn detail_resolution_and_limits_are_obeyed() {
    let files = [
        ("scene.aff", "i 0 one.aff i 2 one.aff d 2 i 2 one.aff"),
        ("one.aff", "s 0 0 0 1"),
    ];
    let triangles =
        |options: &AffOptions| read(&files, options).map(|scene| scene.parts[0].mesh.len());
    let usual = AffOptions::default();
    assert_eq!(triangles(&usual).expect("valid"), 2 * 192);
    let detailed = AffOptions {
        detail: 5,
        resolution: 1,
        ..usual.clone()
    };
    assert_eq!(
        triangles(&detailed).expect("valid"),
        36,
        "`d 2` in the file allows the last include"
    );
    let few = AffOptions {
        max_triangles: 200,
        ..usual
    };
    let error = triangles(&few).expect_err("too many").to_string();
    assert_eq!(
        error,
        "one.aff: line 1: more than 200 triangles, the maximum"
    );
}

/// The folder of a BART scene, if `KD_SCENES` is set.
fn bart(name: &str) -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("KD_SCENES") else {
        eprintln!("skipped: KD_SCENES names no folder with {name}");
        return None;
    };
    Some(Path::new(&folder).join(name))
}

/// Compares frames made from the key frames with known frames.
#[test]
fn bart_scenes_match_known_frames() {
    for (name, entry, frames, parts) in [
        ("bart_kitchen", "kitchen.aff", [0, 400, 799], 6),
        ("bart_museum5", "museum5.aff", [0, 150, 299], 2),
    ] {
        let Some(folder) = bart(name) else { return };
        let options = AffOptions {
            resolution: 1,
            ..AffOptions::default()
        };
        let scene = load_aff(folder.join("aff").join(entry), &options).expect("valid");
        assert_eq!(scene.parts.len(), parts, "{name}");
        let span = scene.span.expect("an animation");
        for frame in frames {
            let known = load_mesh(folder.join(format!("frame_{frame:04}.ply"))).expect("valid");
            let ours = scene.mesh_at(span.time_of(frame)).expect("finite");
            let tolerance = 1e-4 * known.bounds().diagonal();
            let corners = |mesh: &kd_core::Mesh, i: u32| mesh.corners(i).map(|p| p.to_array());
            // Triangles are compared without regard to order: a grid maps first corners to triangles.
            let mut cells: HashMap<[i64; 3], Vec<[Vec3; 3]>> = HashMap::new();
            let cell = |p: Vec3, by: i64| {
                (p / (4.0 * tolerance))
                    .floor()
                    .as_i64vec3()
                    .to_array()
                    .map(|x| x + by)
            };
            for i in 0..u32::try_from(ours.len()).expect("fits in 32 bits") {
                cells
                    .entry(cell(ours.corners(i)[0], 0))
                    .or_default()
                    .push(ours.corners(i));
            }
            let mut missing = 0;
            for i in 0..u32::try_from(known.len()).expect("fits in 32 bits") {
                let wanted = known.corners(i);
                let is_same = |found: &[Vec3; 3]| {
                    found
                        .iter()
                        .zip(&wanted)
                        .all(|(a, b)| a.distance(*b) <= tolerance)
                };
                let [x, y, z] = cell(wanted[0], 0);
                let around = (0..27).map(|k| [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1]);
                let found = around
                    .filter_map(|cell| cells.get(&cell))
                    .flatten()
                    .any(is_same);
                missing += usize::from(!found);
                if !found && missing < 5 {
                    eprintln!("{name}, frame {frame}: {:?}", corners(&known, i));
                }
            }
            assert_eq!(missing, 0, "{name}, frame {frame}: of {}", known.len());
            // The known frames lack the cones.
            let cones = if name == "bart_museum5" { 8 * 8 } else { 0 };
            assert_eq!(ours.len(), known.len() + cones, "{name}, frame {frame}");
        }
        check_cameras(&folder, &scene, name);
    }
}

#[track_caller]
fn check_cameras(folder: &Path, scene: &SceneDescription, name: &str) {
    let bytes = std::fs::read(folder.join("camera.f32")).expect("camera.f32");
    let numbers: Vec<f32> = bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect();
    let span = scene.span.expect("an animation");
    assert_eq!(numbers.len(), 9 * span.frames, "{name}");
    for (frame, known) in numbers.as_chunks::<9>().0.iter().enumerate() {
        let camera = scene.camera_at(span.time_of(frame)).expect("present");
        let forward = (camera.target - camera.eye).normalize();
        let ours = [camera.eye, forward, camera.up.normalize()];
        for (i, ours) in ours.into_iter().enumerate() {
            let known = Vec3::from_slice(&known[3 * i..]);
            assert!(
                ours.distance(known) < 1e-3,
                "{name}, frame {frame}: {ours} for {known}"
            );
        }
    }
}
