//! The scenes of the table: generated ones in several levels of detail, and the meshes of a folder.

use kd_scene::Spd;

use super::PaperArgs;
use crate::arguments::UsageError;
use crate::scenes::{self, SceneSource};

/// The paper has 28 scenes, too.
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

/// For a check that the command works.
const SMOKE: [(Spd, &[u32]); 4] = [
    (Spd::Balls, &[1]),
    (Spd::Gears, &[1, 2]),
    (Spd::Mount, &[4]),
    (Spd::Teapot, &[3]),
];

/// The generated scenes and those of the folder, or the ones that are named.
pub(super) fn choose(arguments: &PaperArgs) -> anyhow::Result<Vec<SceneSource>> {
    let generated = if arguments.smoke {
        SMOKE.as_slice()
    } else {
        &GENERATED
    };
    let sized = generated.iter().flat_map(|(spd, sizes)| {
        let sized = |size: &u32| SceneSource::generated(*spd, *size);
        sizes.iter().map(sized)
    });
    let mut scenes: Vec<SceneSource> = sized.collect();
    match &arguments.scenes {
        Some(folder) if !arguments.smoke => scenes.extend(scenes::in_folder(folder)?),
        Some(_) => {}
        None => eprintln!("without --scenes or KD_SCENES: only generated scenes"),
    }
    let scenes = scenes::named(scenes, &arguments.scene)?;
    // One scene to calibrate on, and one to decide about.
    if scenes.len() < 2 {
        let message = "at least two scenes are needed, by the names that the table prints";
        return Err(UsageError(message.into()).into());
    }
    Ok(scenes)
}
