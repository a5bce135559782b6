//! The scenes of the table: generated ones in two or three levels of detail, and the meshes of a folder.

use std::sync::Arc;

use kd::Mesh;
use kd_scene::{Light, SceneDescription, Spd};

use super::PaperArgs;
use crate::cli::UsageError;
use crate::scenes::{SceneSource, in_folder};

/// As many as the paper has.
const GENERATED: [(Spd, &[u32]); 11] = [
    (Spd::Balls, &[1, 2, 3]),
    (Spd::Gears, &[2, 4, 6]),
    (Spd::Mount, &[5, 7, 8]),
    (Spd::Rings, &[1, 2, 3]),
    (Spd::Teapot, &[5, 12, 30]),
    (Spd::Tetra, &[6, 8]),
    (Spd::Tree, &[3, 5, 8]),
    (Spd::Lattice, &[2, 5]),
    (Spd::Shells, &[1]),
    (Spd::Sombrero, &[2, 4]),
    (Spd::Jacks, &[2, 3, 4]),
];

/// For a check that everything works.
const SMOKE: [(Spd, &[u32]); 4] = [
    (Spd::Balls, &[1]),
    (Spd::Gears, &[1, 2]),
    (Spd::Mount, &[4]),
    (Spd::Teapot, &[3]),
];

/// A scene that has not been made or read yet.
pub(super) enum GridScene {
    Generated { spd: Spd, size: u32 },
    File(SceneSource),
}

/// A scene as it is measured.
pub(super) struct Loaded {
    pub(super) name: String,
    /// Scenes that differ in their level of detail alone are of one family.
    pub(super) family: String,
    pub(super) mesh: Arc<Mesh>,
    /// For the path tracer.
    pub(super) description: SceneDescription,
}

/// The generated ones and those of the folder, or those that are named.
pub(super) fn choose(arguments: &PaperArgs) -> anyhow::Result<Vec<GridScene>> {
    let generated = if arguments.smoke {
        SMOKE.as_slice()
    } else {
        &GENERATED
    };
    let sized = generated.iter().flat_map(|(spd, sizes)| {
        sizes.iter().map(|size| GridScene::Generated {
            spd: *spd,
            size: *size,
        })
    });
    let mut scenes: Vec<GridScene> = sized.collect();
    match &arguments.scenes {
        Some(folder) if !arguments.smoke => {
            scenes.extend(in_folder(folder)?.into_iter().map(GridScene::File));
        }
        Some(_) => {}
        None => eprintln!("without --scenes or KD_SCENES: generated scenes alone"),
    }
    if !arguments.scene.is_empty() {
        scenes.retain(|scene| arguments.scene.contains(&scene.name()));
    }
    // One to learn from, and one to decide about.
    if scenes.len() < 2 {
        let message = "at least two scenes are needed, named as this prints them";
        return Err(UsageError(message.into()).into());
    }
    Ok(scenes)
}

impl GridScene {
    pub(super) fn name(&self) -> String {
        match self {
            Self::Generated { spd, size } => format!("{spd}-{size}"),
            Self::File(source) => source.name.clone(),
        }
    }

    pub(super) fn load(&self) -> anyhow::Result<Loaded> {
        let name = self.name();
        match self {
            Self::Generated { spd, size } => {
                let setup = spd.generate(*size)?;
                Ok(Loaded {
                    name,
                    family: spd.to_string(),
                    mesh: Arc::new(setup.mesh.clone()),
                    description: SceneDescription::of_setup(setup),
                })
            }
            Self::File(source) => {
                let scene = source.load()?;
                let light = Light {
                    position: scene.light,
                    color: kd::glam::Vec3::ONE,
                    keys: None,
                };
                let description = SceneDescription {
                    camera: Some(scene.camera),
                    lights: vec![light],
                    ..SceneDescription::of_mesh(Arc::clone(&scene.mesh))
                };
                Ok(Loaded {
                    // Meshes of several levels of detail are told by a number at the end.
                    family: name
                        .trim_end_matches(|c: char| c.is_ascii_digit())
                        .to_owned(),
                    name,
                    mesh: scene.mesh,
                    description,
                })
            }
        }
    }
}
