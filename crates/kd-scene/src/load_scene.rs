//! One call from a path to a scene.

use std::path::Path;

use crate::{
    AffOptions, LoadError, SceneDescription, load_aff, load_mesh, read_gltf, read_obj_scene,
};

/// Reads a file as a scene: `.aff` and `.nff` with [`load_aff`], `.gltf` and `.glb` with
/// [`read_gltf`], `.obj` with its materials, anything else as a mesh with
/// [`load_mesh`], in one light grey material.
///
/// # Errors
///
/// [`LoadError`], as those two.
pub fn load_scene(
    path: impl AsRef<Path>,
    options: &AffOptions,
) -> Result<SceneDescription, LoadError> {
    let path = path.as_ref();
    let extension = path.extension().and_then(|extension| extension.to_str());
    let extension = extension.unwrap_or_default().to_ascii_lowercase();
    if extension == "aff" || extension == "nff" {
        return load_aff(path, options);
    }
    if extension == "gltf" || extension == "glb" {
        return read_gltf(path, &mut |path| std::fs::read(path));
    }
    if extension == "obj" {
        return read_obj_scene(path, &mut |path| std::fs::read(path));
    }
    Ok(SceneDescription::of_mesh(load_mesh(path)?))
}
