//! One call from a path to a mesh.

use std::path::Path;

use kd_core::Mesh;

use crate::{LoadError, read_obj, read_ply};

/// Reads a mesh file.
///
/// The first bytes decide (a PLY file is recognised under any name), then the extension: `.obj` or
/// `.ply`, in any case. Only geometry is read; every face becomes a fan of triangles, in file
/// order. A file without faces is an empty mesh.
///
/// The whole file is held in memory while it is read; no allocation follows a count that the file
/// only claims.
///
/// # Errors
/// [`LoadError`] names the file and the line or element. `.gltf`, `.glb`, `.aff` and `.nff`
/// are scenes, for `load_scene`: [`LoadError::UnsupportedFormat`].
///
/// ```no_run
/// let mesh = kd_scene::load_mesh("bunny.ply")?;
/// println!("{} triangles", mesh.len());
/// # Ok::<(), kd_scene::LoadError>(())
/// ```
pub fn load_mesh(path: impl AsRef<Path>) -> Result<Mesh, LoadError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let open = std::fs::File::open(path);
    let mut reader = match open {
        Ok(reader) => reader,
        Err(source) => return Err(LoadError::Open { file, source }),
    };
    let mut bytes = Vec::new();
    if let Err(source) = std::io::Read::read_to_end(&mut reader, &mut bytes) {
        return Err(LoadError::Read { file, source });
    }
    let extension = path.extension().and_then(|extension| extension.to_str());
    let extension = extension.unwrap_or_default().to_ascii_lowercase();
    let unsupported = |format| {
        let file = file.clone();
        Err(LoadError::UnsupportedFormat { file, format })
    };
    if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") {
        return read_ply(&bytes, &file);
    }
    if bytes.starts_with(b"glTF") {
        return unsupported("binary glTF");
    }
    match extension.as_str() {
        "obj" => read_obj(bytes.as_slice(), &file),
        "ply" => read_ply(&bytes, &file),
        "gltf" => unsupported("glTF"),
        "glb" => unsupported("binary glTF"),
        "aff" => unsupported("AFF"),
        "nff" => unsupported("NFF"),
        _ => Err(LoadError::UnknownFormat { file }),
    }
}
