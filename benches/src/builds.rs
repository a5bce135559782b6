//! What builds cost and what they are worth: a table against Embree and against our own best preset, with the goal of
//! each row beside it.

mod figures;
mod growth;
mod table;

use std::path::PathBuf;

use clap::Args;

use crate::cli::at_least_one;
use crate::environment::Environment;
use crate::run_folder::{self, RunFolder};
use crate::{peers, scenes};

use figures::{Figures, Settings};

/// The scenes that the goals are set for, in a folder of meshes.
const SCENES: [&str; 6] = [
    "bunny",
    "sponza_dabrovic",
    "sibenik",
    "monastery",
    "dragon_res2",
    "munich",
];

/// What to build. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct BuildsArgs {
    /// Takes the mesh files of this folder; without it, the generated scenes
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these scenes [default with --scenes: the six that the goals are set for]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Timed repeats of everything, each after one of what it is compared with
    #[arg(long, value_name = "N", default_value_t = 9, value_parser = at_least_one)]
    samples: usize,

    /// Time our builds until rays can be traced, not only until the tree is there
    #[arg(long)]
    whole: bool,

    /// Also build generated meshes from 10 000 triangles to so many, and plot how our times over Embree's change
    #[arg(long, value_name = "TRIANGLES", num_args = 0..=1, require_equals = true, default_missing_value = "4200000")]
    growth: Option<u64>,

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

/// Measures, prints and writes; false if an answer was wrong or the number of threads showed in a tree. A goal that is
/// not met is said, and is no failure.
pub(crate) fn run(arguments: &BuildsArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let usual = SCENES.map(String::from);
    let wanted = match (&arguments.scenes, arguments.scene.as_slice()) {
        (Some(_), []) => usual.as_slice(),
        (_, chosen) => chosen,
    };
    let sources = scenes::choose_from(arguments.scenes.as_deref(), wanted, arguments.smoke)?;
    let folder = RunFolder::create(arguments.out.as_deref(), &Environment::detect().rev)?;
    let settings = Settings::new(arguments.samples, arguments.whole, arguments.smoke);
    let mut measured: Vec<Figures> = Vec::new();
    for source in &sources {
        eprintln!("{}", source.name);
        measured.push(Figures::measure(source, &settings)?);
    }
    let table = table::of(&measured);
    println!("{table}");
    println!(
        "medians of {} pairs for each scene, and their geometric mean; ours and what it is compared with run in turn",
        arguments.samples
    );
    let mut lines = table.to_lines()?;
    if let Some(most) = arguments.growth {
        let growth = growth::measure(most, &settings)?;
        println!("\n{growth}");
        run_folder::write(&folder.growth_plot(), growth.to_svg()?)?;
        println!("wrote {}", folder.growth_plot().display());
        lines += &growth.to_lines()?;
    }
    let kept = [Some(folder.build_table()), arguments.json.clone()];
    for path in kept.into_iter().flatten() {
        run_folder::write(&path, &lines)?;
        println!("wrote {}", path.display());
    }
    let problems: Vec<&String> = measured.iter().flat_map(|scene| &scene.problems).collect();
    for problem in &problems {
        eprintln!("FAILED: {problem}");
    }
    Ok(problems.is_empty())
}
