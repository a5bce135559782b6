//! What structures cost and are worth that are no kd-trees: a table over rivals and over our default tree, with the goal of
//! each row beside it.

mod figures;
mod table;

use crate::scene_table::SceneTableArgs;
use crate::{peers, terminal};

use figures::{Figures, Settings};

/// Scanned meshes, for which the goals are set, and others to compare with, in a folder of meshes.
const SCENES: [&str; 7] = [
    "bunny",
    "dragon_res2",
    "dragon_res4",
    "ogre",
    "sponza_dabrovic",
    "sibenik",
    "munich",
];

/// Measures, prints and writes; false if an answer is wrong. A goal that is not met is said, and is no failure.
pub(crate) fn run(arguments: &SceneTableArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let sources = arguments.sources(Some(&SCENES))?;
    let settings = Settings::new(arguments.samples, arguments.smoke);
    let (folder, measured) =
        arguments.measure(&sources, |source| Figures::measure(source, &settings))?;
    let table = table::of(&measured);
    println!("{table}");
    println!(
        "medians of {} pairs for each scene, and their geometric mean; rays are asked one by one, on one thread; speeds are \
         geometric means over primary, shadow, AO, diffuse and random rays",
        arguments.samples
    );
    arguments.keep(folder.structure_table(), &table.to_lines()?)?;
    let problems = measured.iter().flat_map(|scene| &scene.problems);
    Ok(terminal::tell_problems(problems))
}
