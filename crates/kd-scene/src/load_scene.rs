//! From the path of a file to a scene.

use std::path::Path;

use crate::aff::read_aff_with;
use crate::files::files_with;
use crate::format::Format;
use crate::gltf::read_gltf_with;
use crate::load::{LoadOptions, read};
use crate::obj::read_obj_scene_with;
use crate::ply::read_ply_with;
use crate::report::{Loaded, Report};
use crate::{AffOptions, LoadError, SceneDescription};

/// Reads a file as a scene, its format detected as by [`load_mesh`](crate::load_mesh): AFF and NFF with [`read_aff`](crate::read_aff), glTF with
/// [`read_gltf`](crate::read_gltf), OBJ with its materials by [`read_obj_scene`](crate::read_obj_scene), PLY as a mesh in one light gray material.
///
/// # Errors
///
/// [`LoadError`], as from these readers.
pub fn load_scene(
    path: impl AsRef<Path>,
    options: &AffOptions,
) -> Result<SceneDescription, LoadError> {
    let options = LoadOptions::new().with_aff(options.clone());
    load_scene_with(path, &options).map(|loaded| loaded.value)
}

/// [`load_scene`] with options. The warnings are those of the [scene](SceneDescription::warnings).
///
/// # Errors
///
/// Those of [`load_scene`]; [`LoadError::Warned`] for a file with warnings, if the options are strict.
pub fn load_scene_with(
    path: impl AsRef<Path>,
    options: &LoadOptions,
) -> Result<Loaded<SceneDescription>, LoadError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let bytes = read(path, &file)?;
    let mut report = Report::new(options.strictness);
    let mut scene = match Format::of(&bytes, path) {
        Some(Format::Aff) => read_aff_with(
            path,
            &mut files_with(path, bytes),
            &options.aff,
            &mut report,
        )?,
        Some(Format::Gltf | Format::Glb) => {
            read_gltf_with(path, &mut files_with(path, bytes), &mut report)?
        }
        Some(Format::Obj) => read_obj_scene_with(path, &mut files_with(path, bytes), &mut report)?,
        Some(Format::Ply) => SceneDescription::of_mesh(read_ply_with(&bytes, &file, &mut report)?),
        None => return Err(LoadError::UnknownFormat { file }),
    };
    scene.warnings.extend(report.finish());
    let warnings = scene.warnings.clone();
    options.finish(scene, warnings)
}
