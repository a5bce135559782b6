//! From the path of a file to a mesh.

use std::path::Path;

use kd_core::Mesh;

use crate::format::Format;
#[cfg(feature = "scenes")]
use crate::{AffOptions, SceneDescription, files::files_with, read_aff, read_gltf};
use crate::{LoadError, read_obj, read_ply};

/// Reads the triangles of a file: OBJ and PLY, and with the feature `scenes` also glTF 2.0 (`.gltf` and `.glb`), AFF and NFF.
///
/// The content decides on the format where it identifies one, then the extension, in any case. Only geometry is read: of a scene
/// that moves, the triangles of all parts in the first frame. Polygons of OBJ and PLY files become fans of triangles, in file order.
/// A file without faces is an empty mesh.
///
/// The whole file is held in memory while it is read; no allocation relies on a count that the file only claims.
///
/// # Errors
///
/// [`LoadError`] names the file and the line or element. Without the feature `scenes`, files of its formats are
/// [`LoadError::UnsupportedFormat`].
///
/// ```no_run
/// let mesh = kd_scene::load_mesh("bunny.ply")?;
/// println!("{} triangles", mesh.len());
/// # Ok::<(), kd_scene::LoadError>(())
/// ```
pub fn load_mesh(path: impl AsRef<Path>) -> Result<Mesh, LoadError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let bytes = read(path, &file)?;
    match Format::of(&bytes, path) {
        Some(Format::Obj) => read_obj(bytes.as_slice(), &file),
        Some(Format::Ply) => read_ply(&bytes, &file),
        #[cfg(feature = "scenes")]
        Some(Format::Gltf | Format::Glb) => {
            first_frame(&read_gltf(path, &mut files_with(path, bytes))?, file)
        }
        #[cfg(feature = "scenes")]
        Some(Format::Aff) => {
            let scene = read_aff(path, &mut files_with(path, bytes), &AffOptions::default())?;
            first_frame(&scene, file)
        }
        #[cfg(not(feature = "scenes"))]
        Some(format) => Err(LoadError::UnsupportedFormat {
            file,
            format: format.name(),
        }),
        None => Err(LoadError::UnknownFormat { file }),
    }
}

pub(crate) fn read(path: &Path, file: &str) -> Result<Vec<u8>, LoadError> {
    let mut reader = std::fs::File::open(path).map_err(|source| LoadError::Open {
        file: file.to_owned(),
        source,
    })?;
    let mut bytes = Vec::new();
    let read = std::io::Read::read_to_end(&mut reader, &mut bytes);
    read.map_err(|source| LoadError::Read {
        file: file.to_owned(),
        source,
    })?;
    Ok(bytes)
}

#[cfg(feature = "scenes")]
fn first_frame(scene: &SceneDescription, file: String) -> Result<Mesh, LoadError> {
    let start = scene.span.map_or(0.0, |span| span.start);
    let mesh = scene.mesh_at(start);
    mesh.map_err(|source| LoadError::Mesh { file, source })
}
