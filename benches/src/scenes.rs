//! The scenes of a run: generated ones, and mesh files in a folder.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context as _;
use kd::Mesh;
use kd::glam::Vec3;
use kd_scene::{Camera, Light, Room, SceneDescription, SceneSetup, Spd, SpdError};

use crate::arguments::UsageError;
use crate::scene_views::{self, SceneView};

/// Sizes of the generated scenes: for a run of minutes on two cores, and for a check in seconds, without the scene that has
/// too many triangles at any size.
const GENERATED: [(Spd, u32, Option<u32>); 11] = [
    (Spd::Balls, 2, Some(1)),
    (Spd::Gears, 3, Some(1)),
    (Spd::Mount, 7, Some(3)),
    (Spd::Rings, 1, Some(1)),
    (Spd::Teapot, 12, Some(3)),
    (Spd::Tetra, 7, Some(4)),
    (Spd::Tree, 6, Some(1)),
    (Spd::Lattice, 3, Some(1)),
    (Spd::Shells, 1, None),
    (Spd::Sombrero, 3, Some(1)),
    (Spd::Jacks, 2, Some(1)),
];

/// Extensions of mesh files, including formats that the loader refuses by name.
const MESH_EXTENSIONS: &[&str] = &[
    "obj", "ply", "stl", "off", "gltf", "glb", "3mf", "aff", "nff",
];

/// A mesh, its camera and its light.
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) mesh: Arc<Mesh>,
    pub(crate) camera: Camera,
    pub(crate) light: Vec3,
}

/// A scene that is not generated or read yet.
#[derive(Debug)]
pub(crate) struct SceneSource {
    pub(crate) name: String,
    origin: Origin,
}

#[derive(Debug)]
enum Origin {
    Generated { by: Generator, size: u32 },
    File { path: PathBuf, view: SceneView },
}

/// A family of generated scenes.
#[derive(Clone, Copy, Debug)]
enum Generator {
    Spd(Spd),
    Room(Room),
}

impl Generator {
    fn name(self) -> &'static str {
        match self {
            Self::Spd(spd) => spd.name(),
            Self::Room(room) => room.name(),
        }
    }

    fn generate(self, size: u32) -> Result<SceneSetup, SpdError> {
        match self {
            Self::Spd(spd) => spd.generate(size),
            Self::Room(room) => room.generate(size),
        }
    }
}

impl SceneSource {
    pub(crate) fn generated(spd: Spd, size: u32) -> Self {
        Self::generated_by(Generator::Spd(spd), size)
    }

    fn generated_by(by: Generator, size: u32) -> Self {
        Self {
            name: format!("{}-{size}", by.name()),
            origin: Origin::Generated { by, size },
        }
    }

    pub(crate) fn load(&self) -> anyhow::Result<Scene> {
        Ok(self.load_described()?.0)
    }

    /// The scene, and its description for a renderer.
    pub(crate) fn load_described(&self) -> anyhow::Result<(Scene, SceneDescription)> {
        match &self.origin {
            Origin::Generated { by, size } => {
                let setup = by.generate(*size)?;
                let scene = Scene {
                    mesh: Arc::new(setup.mesh.clone()),
                    camera: setup.camera,
                    light: *setup.lights.first().context("the scene has no light")?,
                };
                Ok((scene, SceneDescription::of_setup(setup)))
            }
            Origin::File { path, view } => {
                let mesh = Arc::new(kd::load_mesh(path)?);
                let (camera, light) = view.resolve(mesh.bounds());
                let lamp = Light::point(light, Vec3::ONE);
                let description = SceneDescription {
                    camera: Some(camera),
                    lights: vec![lamp],
                    ..SceneDescription::of_mesh(Arc::clone(&mesh))
                };
                let scene = Scene {
                    mesh,
                    camera,
                    light,
                };
                Ok((scene, description))
            }
        }
    }

    /// The name without the size of generated scenes.
    fn bare_name(&self) -> &str {
        match &self.origin {
            Origin::Generated { by, .. } => by.name(),
            Origin::File { .. } => &self.name,
        }
    }

    /// The common name of scenes that differ only in their detail, which is a number at the end of a file's name.
    pub(crate) fn family(&self) -> &str {
        self.bare_name()
            .trim_end_matches(|c: char| c.is_ascii_digit())
    }
}

/// The generated scenes and those in a folder, or the ones of them that are named.
pub(crate) fn choose_from(
    folder: Option<&Path>,
    names: &[String],
    smoke: bool,
) -> anyhow::Result<Vec<SceneSource>> {
    let mut sources = generated(smoke);
    if !names.is_empty() {
        sources.extend(rooms(smoke));
    }
    if let Some(folder) = folder {
        sources.extend(in_folder(folder)?);
    }
    named(sources, names)
}

/// The scenes that are named, in their own order; all of them without names.
pub(crate) fn named(
    mut sources: Vec<SceneSource>,
    names: &[String],
) -> anyhow::Result<Vec<SceneSource>> {
    for (index, source) in sources.iter().enumerate() {
        if sources[..index]
            .iter()
            .any(|other| other.name == source.name)
        {
            return Err(UsageError(format!("two scenes are called `{}`", source.name)).into());
        }
    }
    if names.is_empty() {
        return Ok(sources);
    }
    let mut chosen = Vec::new();
    for wanted in names {
        // A mesh file with the name of a family of generated scenes has priority.
        let exact = sources.iter().position(|source| source.name == *wanted);
        let found = exact.or_else(|| {
            let mut all = sources.iter();
            all.position(|source| source.bare_name() == wanted)
        });
        let Some(found) = found else {
            let names: Vec<&str> = sources.iter().map(|s| s.name.as_str()).collect();
            let message = format!(
                "no scene is called `{wanted}`; known scenes: {}",
                names.join(", ")
            );
            return Err(UsageError(message).into());
        };
        chosen.push(found);
    }
    let mut index = 0..;
    sources.retain(|_| index.next().is_some_and(|index| chosen.contains(&index)));
    Ok(sources)
}

fn generated(smoke: bool) -> Vec<SceneSource> {
    let sized = GENERATED.iter().filter_map(|(spd, size, smoke_size)| {
        let size = if smoke { (*smoke_size)? } else { *size };
        Some(SceneSource::generated(*spd, size))
    });
    sized.collect()
}

/// The generated rooms, which are measured where they are named or belong to the goals.
pub(crate) fn rooms(smoke: bool) -> Vec<SceneSource> {
    let size = if smoke { 2 } else { 300 };
    Room::ALL
        .map(|room| SceneSource::generated_by(Generator::Room(room), size))
        .into()
}

/// The mesh files directly in a folder, by name.
pub(crate) fn in_folder(folder: &Path) -> anyhow::Result<Vec<SceneSource>> {
    let mut views = views_of(folder)?;
    let entries = fs::read_dir(folder)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(|why| UsageError(format!("--scenes {}: {why}", folder.display())))?;
    let mut paths: Vec<PathBuf> = entries.iter().map(fs::DirEntry::path).collect();
    paths.retain(|path| {
        let extension = path
            .extension()
            .and_then(|e| e.to_str())
            .unwrap_or_default();
        path.is_file() && MESH_EXTENSIONS.contains(&extension.to_ascii_lowercase().as_str())
    });
    paths.sort();
    if paths.is_empty() {
        let known = MESH_EXTENSIONS.join(", ");
        let message = format!(
            "--scenes {}: holds no mesh files ({known})",
            folder.display()
        );
        return Err(UsageError(message).into());
    }
    let mut sources = Vec::new();
    for path in paths {
        let stem = path.file_stem().unwrap_or_default();
        let name = stem.to_string_lossy().into_owned();
        let view = views.remove(&name).unwrap_or_default();
        sources.push(SceneSource {
            name,
            origin: Origin::File { path, view },
        });
    }
    for name in views.keys() {
        eprintln!("note: scenes.toml describes `{name}`, which is not a mesh of the folder");
    }
    Ok(sources)
}

fn views_of(folder: &Path) -> anyhow::Result<BTreeMap<String, SceneView>> {
    let path = folder.join("scenes.toml");
    if !path.exists() {
        return Ok(BTreeMap::new());
    }
    let refuse = |why: anyhow::Error| UsageError(format!("{}: {why:#}", path.display()));
    let text = fs::read_to_string(&path).map_err(|why| refuse(why.into()))?;
    Ok(scene_views::parse(&text).map_err(refuse)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of `--scenes FOLDER`, `--scene NAMES` and `--smoke`.
    fn chosen(arguments: &[&str]) -> Result<Vec<String>, String> {
        let after = |flag: &str| {
            let place = arguments.iter().position(|argument| *argument == flag);
            place.map(|place| arguments[place + 1])
        };
        let names =
            after("--scene").map_or(vec![], |names| names.split(',').map(String::from).collect());
        let folder = after("--scenes").map(Path::new);
        let sources = choose_from(folder, &names, arguments.contains(&"--smoke"));
        let sources = sources.map_err(|why| why.to_string())?;
        Ok(sources.into_iter().map(|source| source.name).collect())
    }

    #[test]
    fn generated_scenes_go_by_name_with_or_without_size() {
        assert_eq!(
            chosen(&["--smoke", "--scene", "tetra,balls-1"]).expect("both"),
            ["balls-1", "tetra-4"],
            "in order"
        );
        assert_eq!(
            chosen(&["--scene", "library,hall-300"]).expect("both"),
            ["hall-300", "library-300"],
            "rooms"
        );
        let refused = chosen(&["--scene", "cellar"]).expect_err("no such scene");
        assert!(
            refused.contains("no scene is called `cellar`") && refused.contains("tetra-7"),
            "{refused}"
        );
    }

    #[test]
    fn a_folder_adds_its_meshes() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().to_str().expect("plain name");
        let empty = chosen(&["--scenes", path]).expect_err("no mesh");
        assert!(empty.contains("holds no mesh files"), "{empty}");

        let write =
            |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
        write("quad.OBJ", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
        write("notes.txt", "not a mesh");
        write("scenes.toml", "[quad]\nlight = [0, 0, 7]\n");
        let names = chosen(&["--smoke", "--scenes", path]).expect("one mesh");
        assert_eq!(
            (names.len(), names[10..].join(",")),
            (11, "quad".into()),
            "added to the generated ones"
        );
        let quad = in_folder(folder.path())
            .expect("readable")
            .remove(0)
            .load()
            .expect("a mesh");
        assert_eq!(
            (quad.mesh.len(), quad.light),
            (1, Vec3::new(0.0, 0.0, 7.0)),
            "with its light"
        );

        write("tetra.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n");
        let named = ["--scenes", path, "--scene", "tetra"];
        assert_eq!(
            chosen(&named).expect("there"),
            ["tetra"],
            "the file, not the generated one"
        );

        write("scenes.toml", "[quad]\nlamp = 1\n");
        let refused = chosen(&["--scenes", path]).expect_err("a key nobody knows");
        assert!(
            refused.contains("scenes.toml") && refused.contains("lamp"),
            "{refused}"
        );
    }
}
