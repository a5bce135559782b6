//! How fast our default tree answers rays: a table over rivals, over other ways to ask it and over its size, with the
//! goal of each row beside it.

mod figures;
mod first_hits;
mod table;

use clap::Args;

use crate::scene_table::SceneTableArgs;
use crate::{peers, terminal};

use figures::{Figures, Settings};

/// What to trace.
#[derive(Args, Debug)]
pub(crate) struct RaysArgs {
    #[command(flatten)]
    table: SceneTableArgs,

    /// Of each kind but primary, keep about this many rays, in whole runs of 64 neighbours; 0 keeps all
    /// [default: 65536; 1024 with --smoke]
    #[arg(long, value_name = "N")]
    ray_limit: Option<usize>,
}

/// Measures, prints and writes; false if an answer of ours depends on how it is asked for. A goal that is not met is
/// said, and is no failure.
pub(crate) fn run(arguments: &RaysArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let sources = arguments.table.sources(None)?;
    let (samples, smoke) = (arguments.table.samples, arguments.table.smoke);
    let settings = Settings::new(samples, arguments.ray_limit, smoke);
    let (folder, measured) = arguments
        .table
        .measure(&sources, |source| Figures::measure(source, &settings))?;
    let table = table::of(&measured);
    println!("{table}");
    println!(
        "medians of {} pairs for each scene, of rays in the same time; ours and what it is compared with run in turn",
        samples
    );
    println!("{}", table::disagreements(&measured));
    arguments
        .table
        .keep(folder.ray_table(), &table.to_lines()?)?;
    let problems = measured.iter().flat_map(|scene| &scene.problems);
    Ok(terminal::tell_problems(problems))
}
