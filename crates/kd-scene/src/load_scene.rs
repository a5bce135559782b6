//! From the path of a file to a scene.

use std::path::Path;

use crate::aff::read_aff_with;
use crate::file_mesh::FileMesh;
use crate::files::{files_with, read_whole};
use crate::format::Format;
use crate::gltf::read_gltf_with;
use crate::load::LoadOptions;
use crate::obj::read_obj_scene_with;
use crate::off::read_off_with;
use crate::ply::read_ply_with;
use crate::report::{Loaded, Report};
use crate::source::Source;
use crate::stl::read_stl_with;
use crate::threemf::read_3mf_with;
use crate::{AffOptions, LoadError, SceneDescription};

/// Reads a file as a scene, its format detected as by [`load_mesh`](crate::load_mesh): AFF and NFF with [`read_aff`](crate::read_aff), glTF with
/// [`read_gltf`](crate::read_gltf), OBJ with its materials by [`read_obj_scene`](crate::read_obj_scene), 3MF with
/// [`read_3mf`](crate::read_3mf), PLY, STL and OFF as a mesh in one light gray material, with the normals and colors of PLY.
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
    let mut source = options.open(path, &file)?;
    let mut report = Report::new(options.strictness);
    let Some(format) = Format::of(&mut source, path)? else {
        return Err(LoadError::UnknownFormat { file: file.clone() });
    };
    let mut scene = read_scene(format, source, path, options, &mut report)?;
    scene.warnings = report.finish();
    let warnings = scene.warnings.clone();
    options.finish(scene, warnings)
}

/// Reads the file `source`, which is at `path`, as a scene; its warnings are in the report.
pub(crate) fn read_scene(
    format: Format,
    mut source: Source<'_>,
    path: &Path,
    options: &LoadOptions,
    report: &mut Report,
) -> Result<SceneDescription, LoadError> {
    let name = source.name;
    let whole = |source: Source<'_>| Ok::<_, LoadError>(files_with(path, source.into_rest()?));
    match format {
        Format::Aff => read_aff_with(path, &mut whole(source)?, &options.aff, report),
        Format::Gltf | Format::Glb => read_gltf_with(path, &mut whole(source)?, report),
        Format::ThreeMf => read_3mf_with(source.into_rest()?, name, report),
        Format::Obj => read_obj_scene_with(&mut source, path, &mut read_whole, report),
        Format::Ply => {
            let mesh = FileMesh::with_looks(name);
            Ok(read_ply_with(&mut source, mesh, report)?.into_scene())
        }
        Format::Stl => Ok(SceneDescription::of_mesh(read_stl_with(
            &mut source,
            report,
        )?)),
        Format::Off => Ok(SceneDescription::of_mesh(read_off_with(
            &mut source,
            report,
        )?)),
    }
}
