//! From the path of a file to a scene.

use std::path::Path;

use crate::files::files_with;
use crate::format::Format;
use crate::load::read;
use crate::{
    AffOptions, LoadError, SceneDescription, read_aff, read_gltf, read_obj_scene, read_ply,
};

/// Reads a file as a scene, its format detected as by [`load_mesh`](crate::load_mesh): AFF and NFF with [`read_aff`], glTF with
/// [`read_gltf`], OBJ with its materials by [`read_obj_scene`], PLY as a mesh in one light gray material.
///
/// # Errors
///
/// [`LoadError`], as from these readers.
pub fn load_scene(
    path: impl AsRef<Path>,
    options: &AffOptions,
) -> Result<SceneDescription, LoadError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let bytes = read(path, &file)?;
    match Format::of(&bytes, path) {
        Some(Format::Aff) => read_aff(path, &mut files_with(path, bytes), options),
        Some(Format::Gltf | Format::Glb) => read_gltf(path, &mut files_with(path, bytes)),
        Some(Format::Obj) => read_obj_scene(path, &mut files_with(path, bytes)),
        Some(Format::Ply) => Ok(SceneDescription::of_mesh(read_ply(&bytes, &file)?)),
        None => Err(LoadError::UnknownFormat { file }),
    }
}
