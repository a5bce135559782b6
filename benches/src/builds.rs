//! What builds cost and what they are worth: a table against Embree and against our own best preset, with the goal of
//! each row beside it.

mod figures;
mod growth;
mod table;

use clap::Args;

use crate::scene_table::SceneTableArgs;
use crate::{peers, run_folder, terminal};

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

/// What to build.
#[derive(Args, Debug)]
pub(crate) struct BuildsArgs {
    #[command(flatten)]
    table: SceneTableArgs,

    /// Time our builds until rays can be traced, not only until the tree is there
    #[arg(long)]
    whole: bool,

    /// Also build generated meshes from 10 000 triangles to so many, and plot how our times over Embree's change
    #[arg(long, value_name = "TRIANGLES", num_args = 0..=1, require_equals = true, default_missing_value = "4200000")]
    growth: Option<u64>,
}

/// Measures, prints and writes; false if an answer was wrong or the number of threads showed in a tree. A goal that is
/// not met is said, and is no failure.
pub(crate) fn run(arguments: &BuildsArgs) -> anyhow::Result<bool> {
    peers::check_available()?;
    let sources = arguments.table.sources(Some(&SCENES))?;
    let (samples, smoke) = (arguments.table.samples, arguments.table.smoke);
    let settings = Settings::new(samples, arguments.whole, smoke);
    let (folder, measured) = arguments
        .table
        .measure(&sources, |source| Figures::measure(source, &settings))?;
    let table = table::of(&measured);
    println!("{table}");
    println!(
        "medians of {} pairs for each scene, and their geometric mean; ours and what it is compared with run in turn",
        samples
    );
    let mut lines = table.to_lines()?;
    if let Some(most) = arguments.growth {
        let growth = growth::measure(most, &settings)?;
        println!("\n{growth}");
        run_folder::write(&folder.growth_plot(), growth.to_svg()?)?;
        println!("wrote {}", folder.growth_plot().display());
        lines += &growth.to_lines()?;
    }
    arguments.table.keep(folder.build_table(), &lines)?;
    let problems = measured.iter().flat_map(|scene| &scene.problems);
    Ok(terminal::tell_problems(problems))
}
