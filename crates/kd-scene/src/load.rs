//! From the path of a file to a mesh.

use std::path::Path;

use kd_core::Mesh;

use crate::LoadError;
use crate::format::Format;
use crate::obj::read_obj_with;
use crate::ply::read_ply_with;
use crate::report::{Loaded, Report, Strictness, Warning};
#[cfg(feature = "scenes")]
use crate::{
    AffOptions, SceneDescription, aff::read_aff_with, files::files_with, gltf::read_gltf_with,
};

/// How files are read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    pub(crate) strictness: Strictness,
    #[cfg(feature = "scenes")]
    pub(crate) aff: AffOptions,
}

impl LoadOptions {
    /// The usual strictness.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets what becomes of what cannot be used.
    #[must_use]
    pub fn with_strictness(mut self, strictness: Strictness) -> Self {
        self.strictness = strictness;
        self
    }

    /// Sets how AFF and NFF files are read.
    #[cfg(feature = "scenes")]
    #[must_use]
    pub fn with_aff(mut self, aff: AffOptions) -> Self {
        self.aff = aff;
        self
    }

    /// What was read with its warnings, which are an error if the reader is strict.
    pub(crate) fn finish<T>(
        &self,
        value: T,
        warnings: Vec<Warning>,
    ) -> Result<Loaded<T>, LoadError> {
        match warnings.first() {
            Some(first) if self.strictness == Strictness::Strict => Err(LoadError::Warned {
                warning: first.clone(),
                others: warnings.len() - 1,
            }),
            _ => Ok(Loaded { value, warnings }),
        }
    }
}

/// Reads the triangles of a file: OBJ and PLY, and with the feature `scenes` also glTF 2.0 (`.gltf` and `.glb`), AFF and NFF.
///
/// The content decides on the format where it identifies one, then the extension, in any case. Only geometry is read: of a scene
/// that moves, the triangles of all parts in the first frame. Convex polygons become fans of triangles, concave ones are triangulated by
/// ear clipping, in file order. A file without faces is an empty mesh. [`load_mesh_with`] also returns warnings about what is
/// left out.
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
    load_mesh_with(path, &LoadOptions::default()).map(|loaded| loaded.value)
}

/// [`load_mesh`] with options, and with warnings about what was left out or replaced.
///
/// # Errors
///
/// Those of [`load_mesh`]; [`LoadError::Warned`] for a file with warnings, if the options are strict.
///
/// ```no_run
/// use kd_scene::{LoadOptions, Strictness, load_mesh_with};
///
/// let options = LoadOptions::new().with_strictness(Strictness::Lenient);
/// let loaded = load_mesh_with("scan.ply", &options)?;
/// for warning in &loaded.warnings {
///     eprintln!("{warning}");
/// }
/// println!("{} triangles", loaded.value.len());
/// # Ok::<(), kd_scene::LoadError>(())
/// ```
pub fn load_mesh_with(
    path: impl AsRef<Path>,
    options: &LoadOptions,
) -> Result<Loaded<Mesh>, LoadError> {
    let path = path.as_ref();
    let file = path.display().to_string();
    let bytes = read(path, &file)?;
    let mut report = Report::new(options.strictness);
    let mesh = match Format::of(&bytes, path) {
        Some(Format::Obj) => read_obj_with(&bytes, &file, &mut report)?,
        Some(Format::Ply) => read_ply_with(&bytes, &file, &mut report)?,
        #[cfg(feature = "scenes")]
        Some(Format::Gltf | Format::Glb) => {
            let scene = read_gltf_with(path, &mut files_with(path, bytes), &mut report)?;
            first_frame(&scene, file)?
        }
        #[cfg(feature = "scenes")]
        Some(Format::Aff) => {
            let files = &mut files_with(path, bytes);
            first_frame(
                &read_aff_with(path, files, &options.aff, &mut report)?,
                file,
            )?
        }
        #[cfg(not(feature = "scenes"))]
        Some(format) => {
            return Err(LoadError::UnsupportedFormat {
                file,
                format: format.name(),
            });
        }
        None => return Err(LoadError::UnknownFormat { file }),
    };
    options.finish(mesh, report.finish())
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
