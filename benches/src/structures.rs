//! What structures cost and are worth that are no kd-trees: a table over rivals and over our default tree, with the goal of
//! each row beside it.

mod figures;
mod table;

use std::path::PathBuf;

use clap::Args;

use crate::cli::at_least_one;
use crate::environment::Environment;
use crate::run_folder::{self, RunFolder};
use crate::{peers, scenes};

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

/// What to build. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct StructuresArgs {
    /// Takes the mesh files of this folder; without it, the generated scenes
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these scenes [default with --scenes: four scans, two rooms and a city]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Timed repeats of everything, each after one of what it is compared with
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    samples: usize,

    /// Tiny scenes and few rays: a check that everything works
    #[arg(long)]
    smoke: bool,

    /// Also write the rows to this file, as JSON lines
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Where the folder of the run goes [default: target/bench of the workspace]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Measures, prints and writes; false if an answer is wrong. A goal that is not met is said, and is no failure.
pub(crate) fn run(arguments: &StructuresArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let usual = SCENES.map(String::from);
    let wanted = match (&arguments.scenes, arguments.scene.as_slice()) {
        (Some(_), []) => usual.as_slice(),
        (_, chosen) => chosen,
    };
    let sources = scenes::choose_from(arguments.scenes.as_deref(), wanted, arguments.smoke)?;
    let folder = RunFolder::create(arguments.out.as_deref(), &Environment::detect().rev)?;
    let settings = Settings::new(arguments.samples, arguments.smoke);
    let mut measured: Vec<Figures> = Vec::new();
    for source in &sources {
        eprintln!("{}", source.name);
        measured.push(Figures::measure(source, &settings)?);
    }
    let table = table::of(&measured);
    println!("{table}");
    println!(
        "medians of {} pairs for each scene, and their geometric mean; rays are asked one by one, on one thread; speeds are \
         geometric means over primary, shadow, AO, diffuse and random rays",
        arguments.samples
    );
    let kept = [Some(folder.structure_table()), arguments.json.clone()];
    for path in kept.into_iter().flatten() {
        run_folder::write(&path, table.to_lines()?)?;
        println!("wrote {}", path.display());
    }
    let problems: Vec<&String> = measured.iter().flat_map(|scene| &scene.problems).collect();
    for problem in &problems {
        eprintln!("FAILED: {problem}");
    }
    Ok(problems.is_empty())
}
