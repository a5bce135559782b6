//! The choice of a reader by content and extension.

use std::fs;
use std::path::PathBuf;

use kd_scene::{LoadError, load_mesh};

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
    property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A temporary folder, removed on drop.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let name = format!("kd-scene-load-{test}-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        fs::create_dir_all(&folder).expect("a temporary folder");
        Self(folder)
    }

    fn file(&self, name: &str, content: &str) -> PathBuf {
        let path = self.0.join(name);
        fs::write(&path, content).expect("a temporary file");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that cannot be removed is harmless.
        drop(fs::remove_dir_all(&self.0));
    }
}

#[test]
fn content_decides_then_the_extension() {
    let folder = Folder::new("formats");
    for (name, content) in [
        ("a.ply", PLY),
        ("a.PLY", PLY),
        ("a.obj", OBJ),
        ("a.Obj", OBJ),
        ("really-ply.obj", PLY),
        ("really-obj.ply", OBJ),
        ("ply", PLY),
        ("obj", OBJ),
    ] {
        let mesh = load_mesh(folder.file(name, content));
        let mesh = mesh.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(mesh.triangles(), [[0, 1, 2]], "{name}");
    }
    for name in ["a.txt", "none"] {
        let path = folder.file(name, "solid");
        let error = load_mesh(&path).expect_err(name).to_string();
        let expected =
            "unknown format, expected .obj, .ply, .stl, .off, .gltf, .glb, .3mf, .aff or .nff";
        assert_eq!(error, format!("{}: {expected}", path.display()), "{name}");
    }
    let missing = folder.0.join("missing.obj");
    let error = load_mesh(&missing).expect_err("no such file");
    assert!(matches!(error, LoadError::Open { .. }), "{error}");
    assert!(
        error
            .to_string()
            .starts_with(&format!("{}: cannot open", missing.display())),
        "{error}"
    );
    let error = load_mesh(&folder.0)
        .expect_err("a folder is not a file")
        .to_string();
    assert!(
        error.starts_with(&folder.0.display().to_string()),
        "{error}"
    );
}

#[test]
fn odd_files_are_meshes_or_errors_with_their_name() {
    let folder = Folder::new("odd");
    for (name, is_mesh) in [
        ("empty.obj", true),
        ("empty.ply", false),
        ("empty.stl", false),
        ("empty.off", false),
        ("a name with blanks é 三.obj", true),
    ] {
        let path = folder.file(name, "");
        match load_mesh(&path) {
            Ok(mesh) => assert!(is_mesh && mesh.is_empty(), "{name}"),
            Err(error) => {
                let text = error.to_string();
                assert!(
                    !is_mesh && text.starts_with(&path.display().to_string()),
                    "{text}"
                );
            }
        }
    }
    for marked in [&b"\xff\xfev\0"[..], b"\xfe\xff\0v"] {
        let path = folder.file("wide.obj", "");
        fs::write(&path, marked).expect("a temporary file");
        let error = load_mesh(&path).expect_err("UTF-16").to_string();
        assert!(error.contains("the text is UTF-16"), "{error}");
    }
    for name in ["folder.obj", "folder"] {
        let path = folder.0.join(name);
        fs::create_dir(&path).expect("a folder in the folder");
        let error = load_mesh(&path).expect_err("a folder");
        assert!(matches!(error, LoadError::Open { .. }), "{error}");
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;

        let path = folder.file("secret.obj", OBJ);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o000)).expect("own file");
        // The user `root` may read it all the same.
        if fs::read(&path).is_err() {
            let error = load_mesh(&path).expect_err("no permission");
            assert!(matches!(error, LoadError::Open { .. }), "{error}");
        }
    }
}

/// Files with holes, which take no room on the disk.
#[test]
#[cfg(target_os = "linux")]
fn files_larger_than_memory_are_errors() {
    const LENGTH: u64 = 1 << 42;
    let folder = Folder::new("large");
    let huge = |name: &str, start: &[u8]| {
        let path = folder.file(name, "");
        fs::write(&path, start).expect("a temporary file");
        let file = fs::OpenOptions::new()
            .write(true)
            .open(&path)
            .expect("own file");
        file.set_len(LENGTH).is_ok().then_some(path)
    };
    let header = PLY
        .replace("ascii", "binary_little_endian")
        .replace("vertex 3", "vertex 300000000000");
    let header = header
        .split_inclusive("end_header\n")
        .next()
        .expect("a header");
    let mut stl = vec![b' '; 80];
    stl.extend(u32::MAX.to_le_bytes());
    for (name, start) in [("a.ply", header.as_bytes()), ("a.stl", &stl)] {
        let Some(path) = huge(name, start) else {
            continue;
        };
        let error = load_mesh(&path).expect_err(name).to_string();
        assert!(error.contains("of memory"), "{error}");
    }
    #[cfg(feature = "scenes")]
    {
        if huge("a.bin", b"").is_none() {
            return;
        }
        let text = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "a.bin"}]}"#;
        let device = folder.file("device.gltf", &text.replace("a.bin", "/dev/zero"));
        let error = load_mesh(&device)
            .expect_err("a device has no end")
            .to_string();
        assert!(error.ends_with("`/dev/zero`: not a file"), "{error}");
        let path = folder.file("a.gltf", text);
        let error = load_mesh(&path).expect_err("a buffer of 4 TB").to_string();
        assert!(
            error.contains("/buffers/0: `a.bin`: needs 4398046511104 bytes of memory"),
            "{error}"
        );
        for name in ["a.glb", "a.3mf", "a.aff"] {
            let path = huge(name, b"").expect("as before");
            let error = load_mesh(&path).expect_err(name).to_string();
            assert!(error.contains("of memory"), "{error}");
        }
    }
}

#[cfg(feature = "scenes")]
mod scenes {
    use glam::Vec3;
    use kd_scene::{AffOptions, load_scene, toy_room_aff};

    use super::*;

    /// The triangle (0, 0, 0), (1, 0, 0), (0, 1, 0), moved by (0, 0, 2).
    const AFF: &str = "v\nfrom 0 0 9\nat 0 0 0\nup 0 1 0\nangle 40\nhither 1\nresolution 8 8\n\
        f 1 1 1 1 0 0 0 1\np 3\n0 0 2\n1 0 2\n0 1 2\n";
    /// Its positions are the three corners; the node moves them.
    const GLTF: &str = r#"{
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": [0, 0, 2] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{
            "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
            "min": [0, 0, 0], "max": [1, 1, 0]
        }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36URI }]
    }"#;

    fn corners() -> Vec<u8> {
        let corners = [[0.0_f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        corners
            .into_iter()
            .flatten()
            .flat_map(f32::to_le_bytes)
            .collect()
    }

    fn gltf() -> String {
        GLTF.replace("URI", r#", "uri": "corners.bin""#)
    }

    fn glb() -> Vec<u8> {
        let mut json = GLTF.replace("URI", "").into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let chunk = |kind: &[u8; 4], bytes: &[u8]| {
            let length = u32::try_from(bytes.len()).expect("small");
            [&length.to_le_bytes()[..], kind, bytes].concat()
        };
        let chunks = [chunk(b"JSON", &json), chunk(b"BIN\0", &corners())].concat();
        let length = u32::try_from(12 + chunks.len()).expect("small");
        [
            &b"glTF"[..],
            &2_u32.to_le_bytes(),
            &length.to_le_bytes(),
            &chunks,
        ]
        .concat()
    }

    #[test]
    fn files_of_scenes_are_meshes_too() {
        let folder = Folder::new("scenes");
        fs::write(folder.0.join("corners.bin"), corners()).expect("a temporary file");
        let (gltf, glb) = (gltf(), glb());
        for (name, content) in [
            ("a.aff", AFF.as_bytes()),
            ("a.NFF", AFF.as_bytes()),
            ("really-aff.obj", AFF.as_bytes()),
            ("a.gltf", gltf.as_bytes()),
            ("really-gltf.ply", gltf.as_bytes()),
            ("a.glb", &glb),
            ("really-glb.gltf", &glb),
            ("glb", &glb),
        ] {
            let path = folder.0.join(name);
            fs::write(&path, content).expect("a temporary file");
            let mesh = load_mesh(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(mesh.len(), 1, "{name}");
            let expected = [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0]].map(Vec3::from);
            assert_eq!(mesh.corners(0), expected, "{name}");
            let scene = load_scene(&path, &AffOptions::default()).expect(name);
            assert_eq!(scene.mesh_at(0.0).expect(name), mesh, "{name}, as a scene");
        }
    }

    /// What is wrong in a file of a scene is reported as by its own reader.
    #[test]
    fn broken_files_of_scenes_are_refused() {
        let folder = Folder::new("broken");
        for (name, content, expected) in [
            ("a.gltf", "{}", "header: "),
            ("a.glb", "", "header: "),
            (
                "b.bin",
                "glTF\u{2}",
                "header: binary glTF ends in its header",
            ),
            ("a.aff", "nonsense", "line 1: "),
            ("a.nff", "v\nfrom 0 0\n", "line "),
        ] {
            let path = folder.file(name, content);
            let error = load_mesh(&path).expect_err(name).to_string();
            let expected = format!("{}: {expected}", path.display());
            assert!(error.starts_with(&expected), "{name}: {error}");
        }
        let path = folder.file("c.gltf", &gltf());
        let error = load_mesh(&path).expect_err("no buffer").to_string();
        assert!(
            error.contains("corners.bin"),
            "the file that is missing: {error}"
        );
    }

    /// The first frame is where the animation begins, wherever the part rests.
    #[test]
    fn a_scene_that_moves_is_read_in_its_first_frame() {
        let folder = Folder::new("frames");
        let text = toy_room_aff().replacen("a 0 ", "a 1 ", 1);
        let path = folder.file("moving.aff", &text);
        let scene = load_scene(&path, &AffOptions::default()).expect("our own");
        let span = scene.span.expect("it moves");
        assert_eq!(span.start, 1.0, "as the file says");
        let mesh = load_mesh(&path).expect("our own");
        let at = |time| scene.mesh_at(time).expect("finite");
        assert!(mesh == at(span.start), "the first frame");
        assert!(mesh != at(0.0), "not the time 0");
    }
}
