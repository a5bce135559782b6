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
    fn new() -> Self {
        let folder = std::env::temp_dir().join(format!("kd-scene-load-{}", std::process::id()));
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
fn content_comes_before_extension() {
    let folder = Folder::new();
    for (name, content) in [
        ("a.ply", PLY),
        ("a.PLY", PLY),
        ("a.obj", OBJ),
        ("a.Obj", OBJ),
        ("really-ply.obj", PLY),
        ("none", PLY),
    ] {
        let mesh = load_mesh(folder.file(name, content));
        let mesh = mesh.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(mesh.triangles(), [[0, 1, 2]], "{name}");
    }
    let rows = [
        ("a.gltf", "{}", "glTF files are scenes, not meshes"),
        ("a.glb", "", "binary glTF files are scenes, not meshes"),
        (
            "b.bin",
            "glTF\u{2}",
            "binary glTF files are scenes, not meshes",
        ),
        ("a.aff", "", "AFF files are scenes, not meshes"),
        ("a.nff", "", "NFF files are scenes, not meshes"),
        ("a.stl", "solid", "unknown format, expected .obj or .ply"),
        ("none", OBJ, "unknown format, expected .obj or .ply"),
        ("b.ply", OBJ, "line 1: bad header line: `v 0 0 0`"),
    ];
    for (name, content, expected) in rows {
        let path = folder.file(name, content);
        let error = load_mesh(&path).expect_err(name).to_string();
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
