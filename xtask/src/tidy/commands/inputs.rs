//! The scenes that documented commands read, generated: as small as a file of each kind can be and still be of use.
//!
//! ```text
//! bunny.obj, kitchen.aff          scenes that a command names, in the folder in which it runs
//! scenes/bunny.ply                the same as meshes of `--scenes DIR`
//! scenes/bunny/manifest.json      and as animations: the mesh turns
//! scenes/bart_kitchen/aff/kitchen.aff   what `paper merge-table --rendered` renders
//! ```

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::small_form::{SCENES, SmallForm};

/// Writes every file that one of the forms reads into a new folder.
pub(super) fn write<'a>(
    folder: &Path,
    forms: impl Iterator<Item = &'a SmallForm>,
) -> Result<(), String> {
    let scenes = folder.join(SCENES);
    write_file(&scenes.join("bart_kitchen/aff/kitchen.aff"), AFF.as_bytes())?;
    for form in forms {
        for name in form.values("--scene") {
            write_file(&scenes.join(name).with_extension("ply"), ply().as_bytes())?;
            write_animation(&scenes.join(name))?;
        }
        let words = form.arguments.iter();
        let before = [""].into_iter().chain(words.clone().map(String::as_str));
        for (before, word) in before.zip(words) {
            let is_output = before == "-o" || before == "--output";
            let extension = Path::new(word).extension().and_then(|e| e.to_str());
            let content = match extension.unwrap_or_default() {
                "obj" => obj(),
                "ply" => ply(),
                "aff" => AFF.to_owned(),
                "nff" => NFF.to_owned(),
                "gltf" => GLTF.to_owned(),
                _ => continue,
            };
            if !is_output {
                write_file(&folder.join(word), content.as_bytes())?;
            }
        }
    }
    Ok(())
}

fn write_file(path: &Path, content: &[u8]) -> Result<(), String> {
    let parent = path.parent().unwrap_or(path);
    fs::create_dir_all(parent)
        .and_then(|()| fs::write(path, content))
        .map_err(|why| format!("{}: {why}", path.display()))
}

/// Cells along a side of the generated mesh, of two triangles each.
const CELLS: u32 = 12;

/// The height of the generated mesh over the unit square.
fn height(x: f32, y: f32) -> f32 {
    0.2 * (7.0 * x).sin() * (5.0 * y).cos()
}

/// Corners and triangles of a height field.
fn mesh() -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let side = 0..=CELLS;
    let grid = side.clone().flat_map(|y| side.clone().map(move |x| [x, y]));
    let corners = grid.map(|cell| {
        let [x, y] = cell.map(|at| at as f32 / CELLS as f32);
        [x, y, height(x, y)]
    });
    let cells = (0..CELLS).flat_map(|y| (0..CELLS).map(move |x| y * (CELLS + 1) + x));
    let triangles = cells.flat_map(|a| {
        let [b, c, d] = [a + 1, a + CELLS + 1, a + CELLS + 2];
        [[a, b, d], [a, d, c]]
    });
    (corners.collect(), triangles.collect())
}

fn obj() -> String {
    let (corners, triangles) = mesh();
    let mut text = String::new();
    for [x, y, z] in corners {
        writeln!(text, "v {x} {y} {z}").expect("a string grows");
    }
    for [a, b, c] in triangles {
        writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1).expect("a string grows");
    }
    text
}

fn ply() -> String {
    let (corners, triangles) = mesh();
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        corners.len(),
        triangles.len()
    );
    for [x, y, z] in corners {
        writeln!(text, "{x} {y} {z}").expect("a string grows");
    }
    for [a, b, c] in triangles {
        writeln!(text, "3 {a} {b} {c}").expect("a string grows");
    }
    text
}

/// Frames of a generated animation: two for each row of the merge table, and the last.
const FRAMES: u8 = 21;

/// A still mesh and the same mesh, smaller and over it, which turns.
fn write_animation(folder: &Path) -> Result<(), String> {
    let manifest =
        format!("{{\"frames\": {FRAMES}, \"groups\": [{{\"file\": \"group_0.ply\"}}]}}\n");
    write_file(&folder.join("manifest.json"), manifest.as_bytes())?;
    for name in ["static.ply", "group_0.ply"] {
        write_file(&folder.join(name), ply().as_bytes())?;
    }
    let matrices = (0..FRAMES).flat_map(|frame| {
        let (sin, cos) = (f32::from(frame) * 0.1).sin_cos();
        let [sin, cos] = [sin, cos].map(|part| 0.4 * part);
        [
            [cos, -sin, 0.0, 0.5],
            [sin, cos, 0.0, 0.5],
            [0.0, 0.0, 0.4, 0.3],
        ]
    });
    let bytes: Vec<u8> = matrices.flatten().flat_map(f32::to_le_bytes).collect();
    write_file(&folder.join("matrices.f32"), &bytes)
}

/// A floor and a wall, and a triangle that moves before them for 800 frames.
const AFF: &str = "\
v from 0 1 6 at 0 1 0 up 0 1 0 angle 45 hither 0.01 resolution 80 60
l 1 4 3
f 1 0.5 0.25 0.8 0.2 30 0 0
p 4 -4 0 -4 4 0 -4 4 0 4 -4 0 4
p 4 -4 0 -4 4 0 -4 4 4 -4 -4 4 -4
x car {
  p 3 -0.5 0 0 0.5 0 0 0 1.5 0
}
a 0 32 800
k car { transl 4 0 -1 0 0 0 0 0 0 -1 0 0 0 0 0 32 1 0.5 0 0 0 0 32 1 0.5 0 0 0 0 }
";

/// A floor and a ball.
const NFF: &str = "\
v
from 0 1 6
at 0 1 0
up 0 1 0
angle 45
hither 0.01
resolution 80 60
l 1 4 3
f 1 0.5 0.25 0.8 0.2 30 0 0
p 4
-4 0 -4
4 0 -4
4 0 4
-4 0 4
s 0 1 0 1
";

/// A triangle, its corners in the file itself.
const GLTF: &str = r#"{
  "asset": {"version": "2.0"},
  "scene": 0,
  "scenes": [{"nodes": [0]}],
  "nodes": [{"mesh": 0}],
  "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
  "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
  "bufferViews": [{"buffer": 0, "byteLength": 36}],
  "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]
}
"#;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mesh_has_no_index_out_of_range_and_no_repeated_corner() {
        let (corners, triangles) = mesh();
        assert_eq!(corners.len(), 13 * 13);
        assert_eq!(triangles.len(), 2 * 12 * 12);
        for [a, b, c] in triangles {
            assert!(a != b && b != c && c != a, "{a} {b} {c}");
            assert!([a, b, c].iter().all(|at| (*at as usize) < corners.len()));
        }
        assert_eq!(obj().lines().count(), 13 * 13 + 2 * 12 * 12);
    }

    #[test]
    fn scenes_that_a_form_names_are_written_and_outputs_are_not() {
        let folder = std::env::temp_dir().join(format!("xtask-inputs-{}", std::process::id()));
        let words = "run -- convert a.aff --scene b,c -o d.ply";
        let form = SmallForm {
            arguments: words.split(' ').map(String::from).collect(),
            needs: None,
        };
        write(&folder, [form].iter()).expect("a folder to write to");
        let exists = |path: &str| folder.join(path).exists();
        for path in ["a.aff", "scenes/b.ply", "scenes/c/matrices.f32"] {
            assert!(exists(path), "{path}");
        }
        assert!(!exists("d.ply"), "an output");
        fs::remove_dir_all(&folder).expect("just written");
    }
}
