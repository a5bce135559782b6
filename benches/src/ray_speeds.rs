//! How fast our default tree answers rays: a table over rivals, over other ways to ask it and over its size, with the
//! goal of each row beside it.

mod figures;
mod first_hits;
mod table;

use std::path::PathBuf;

use clap::Args;

use crate::cli::at_least_one;
use crate::environment::Environment;
use crate::run_folder::{self, RunFolder};
use crate::{peers, scenes};

use figures::{Figures, Settings};

/// What to trace. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct RaysArgs {
    /// Takes the mesh files of this folder; without it, the generated scenes
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these scenes; a generated one may be named without its size [default: all of them]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Timed repeats of everything, each after one of what it is compared with
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    samples: usize,

    /// Of each kind but primary, keep about this many rays, in whole runs of 64 neighbours; 0 keeps all
    /// [default: 65536; 1024 with --smoke]
    #[arg(long, value_name = "N")]
    ray_limit: Option<usize>,

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

/// Measures, prints and writes; false if an answer of ours depends on how it is asked for. A goal that is not met is
/// said, and is no failure.
pub(crate) fn run(arguments: &RaysArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let sources = match (arguments.scenes.as_deref(), arguments.scene.as_slice()) {
        (Some(folder), []) => scenes::in_folder(folder)?,
        (folder, names) => scenes::choose_from(folder, names, arguments.smoke)?,
    };
    let folder = RunFolder::create(arguments.out.as_deref(), &Environment::detect().rev)?;
    let settings = Settings::new(arguments.samples, arguments.ray_limit, arguments.smoke);
    let mut measured: Vec<Figures> = Vec::new();
    for source in &sources {
        eprintln!("{}", source.name);
        measured.push(Figures::measure(source, &settings)?);
    }
    let table = table::of(&measured);
    println!("{table}");
    println!(
        "medians of {} pairs for each scene, of rays in the same time; ours and what it is compared with run in turn",
        arguments.samples
    );
    println!("{}", table::disagreements(&measured));
    let kept = [Some(folder.ray_table()), arguments.json.clone()];
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
