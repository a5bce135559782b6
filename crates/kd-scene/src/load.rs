//! From the path of a file to a mesh.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use kd_core::Mesh;

use crate::LoadError;
use crate::file_mesh::FileMesh;
use crate::format::Format;
use crate::obj::read_obj_with;
use crate::off::read_off_with;
use crate::ply::read_ply_with;
use crate::report::{Loaded, Report, Strictness, Warning};
use crate::source::Source;
use crate::stl::read_stl_with;
#[cfg(feature = "scenes")]
use crate::{AffOptions, SceneDescription, WholeMeshError, load_scene::read_scene};

/// How files are read.
#[derive(Clone, Default)]
pub struct LoadOptions {
    pub(crate) strictness: Strictness,
    on_progress: Option<Arc<OnProgress>>,
    #[cfg(feature = "scenes")]
    pub(crate) aff: AffOptions,
}

/// Receives how many bytes of a file are read, and how many it has.
type OnProgress = dyn Fn(u64, u64) + Send + Sync;

impl fmt::Debug for LoadOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut fields = f.debug_struct("LoadOptions");
        fields.field("strictness", &self.strictness);
        fields.finish_non_exhaustive()
    }
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

    /// Calls `on_progress` while a file is read, with the number of bytes that are read and that the file has. Files that a file names
    /// do not count.
    #[must_use]
    pub fn with_progress(mut self, on_progress: impl Fn(u64, u64) + Send + Sync + 'static) -> Self {
        self.on_progress = Some(Arc::new(on_progress));
        self
    }

    /// Opens a file; errors name it `name`.
    pub(crate) fn open<'a>(&'a self, path: &Path, name: &'a str) -> Result<Source<'a>, LoadError> {
        let on_progress = self.on_progress.as_deref();
        Source::open(path, name, on_progress.map(|it| it as &dyn Fn(u64, u64)))
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

/// Reads the triangles of a file: OBJ, PLY, STL and OFF, and with the feature `scenes` also glTF 2.0 (`.gltf` and `.glb`), 3MF, AFF and
/// NFF.
///
/// The content decides on the format where it identifies one, then the extension, in any case. Only geometry is read: of a scene
/// that moves, the triangles of all parts in the first frame. Convex polygons become fans of triangles, concave ones are triangulated by
/// ear clipping, in file order. A file without faces is an empty mesh. [`load_mesh_with`] also returns warnings about what is
/// left out.
///
/// OBJ, PLY, STL and OFF are read piece by piece, the others in memory; memory is bounded by the size of
/// the file, and where it repeats its content, by 2^26 vertices and triangles more.
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
    let mut source = options.open(path, &file)?;
    let mut report = Report::new(options.strictness);
    let mesh = match Format::of(&mut source, path)? {
        Some(Format::Obj) => read_obj_with(&mut source, &mut report)?,
        Some(Format::Ply) => read_ply_with(&mut source, FileMesh::new(&file), &mut report)?.mesh,
        Some(Format::Stl) => read_stl_with(&mut source, &mut report)?,
        Some(Format::Off) => read_off_with(&mut source, &mut report)?,
        #[cfg(feature = "scenes")]
        Some(format) => {
            let scene = read_scene(format, source, path, options, &mut report)?;
            first_frame(&scene, file.clone())?
        }
        #[cfg(not(feature = "scenes"))]
        Some(format) => {
            return Err(LoadError::UnsupportedFormat {
                file: file.clone(),
                format: format.name(),
            });
        }
        None => return Err(LoadError::UnknownFormat { file: file.clone() }),
    };
    options.finish(mesh, report.finish())
}

#[cfg(feature = "scenes")]
fn first_frame(scene: &SceneDescription, file: String) -> Result<Mesh, LoadError> {
    let start = scene.span.map_or(0.0, |span| span.start);
    scene.mesh_at(start).map_err(|error| match error {
        WholeMeshError::Mesh(source) => LoadError::Mesh { file, source },
        WholeMeshError::TooManyCopies { .. } => LoadError::TooManyCopies {
            file,
            problem: error.to_string(),
        },
    })
}
