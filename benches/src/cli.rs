//! The command line.

use std::fmt;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::builds::BuildsArgs;
use crate::calibrate::CalibrateArgs;
use crate::instructions::InstructionsArgs;
use crate::merges::MergesArgs;
use crate::paper::PaperArgs;
use crate::ray_speeds::RaysArgs;
use crate::rays::RayKind;
use crate::scene_table::SceneTableArgs;
use crate::structure::{BuilderName, LayoutName, StructureName};

/// Measures kd-trees: builds, rays, memory, and whether the answers are right.
#[derive(Debug, Parser)]
#[command(name = "kd-bench", bin_name = "cargo xtask")]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Measure every chosen builder on every chosen scene with every chosen kind of ray
    Bench(Box<BenchArgs>),
    /// Print what our presets cost to build and are worth, over Embree's builds and over each other, with the goals
    ///
    /// With --scenes and no --scene: the six meshes that the goals are set for.
    Builds(BuildsArgs),
    /// Print how fast our default tree answers rays, over rivals, with the goals
    ///
    /// With --scenes and no --scene: every mesh of the folder.
    Rays(RaysArgs),
    /// Print what merging trees costs and is worth, over building anew, with the goals
    Merges(MergesArgs),
    /// Print what grids, hierarchies and the papers' other structures cost and are worth, over rivals and our default tree, with
    /// the goals
    ///
    /// With --scenes and no --scene: four scans, for which the goals are set, two rooms and a city.
    Structures(SceneTableArgs),
    /// Make a table of one of the papers again, ours beside it
    Paper(Box<PaperArgs>),
    /// Count instructions per ray, which do not depend on how busy the machine is
    Instructions(InstructionsArgs),
    /// Write the HTML report of a recorded run again
    Report {
        /// A folder that `bench` wrote, for example target/bench/latest
        run: PathBuf,
    },
    /// Fit the cost of each step of a traversal to measured rays
    Calibrate(CalibrateArgs),
    /// List what differs between two runs; fails on any difference that is not a time
    Compare {
        /// A folder that `bench` wrote, or a file of JSON lines
        before: PathBuf,
        /// The one to compare it with
        after: PathBuf,
    },
}

/// What to measure. Lists are separated by commas.
#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// Adds the mesh files in this folder to the generated scenes; it may hold scenes.toml with cameras and lights
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    pub(crate) scenes: Option<PathBuf>,

    /// Only these scenes; a generated one may be named without its size [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(crate) scene: Vec<String>,

    /// What to build [default: kd; all with --peers; all of ours with --smoke]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(crate) structure: Vec<StructureName>,

    /// How to build it, where a structure has that way [default for kd: median,exact,balanced; fast,balanced,best with
    /// --peers; all with --smoke; all of any other structure's]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(crate) builder: Vec<BuilderName>,

    /// How nodes of kd lie in memory
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_values = ["wide"])]
    pub(crate) layout: Vec<LayoutName>,

    /// Which rays to trace [default: all]
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    pub(crate) rays: Vec<RayKind>,

    /// Threads that build and trace
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = at_least_one)]
    pub(crate) threads: usize,

    /// Timed repeats, each after one of the baseline [default: 3, fewer of what takes seconds; 1 with --smoke]
    #[arg(long, value_name = "N", value_parser = at_least_one)]
    pub(crate) samples: Option<usize>,

    /// Of each kind but primary, keep about this many rays, in whole runs of 64 neighbours; 0 keeps all
    /// [default: 65536; 4096 with --smoke]
    #[arg(long, value_name = "N")]
    pub(crate) ray_limit: Option<usize>,

    /// Of each kind, compare at least so many answers with a test of every triangle; 20000 make 10⁵ for a scene
    #[arg(long, value_name = "N", default_value_t = 16)]
    pub(crate) check: usize,

    /// Measure rival libraries too, and compare everything with Embree's medium build instead of our balanced one
    #[arg(long)]
    pub(crate) peers: bool,

    /// This program built for this very processor: rivals in Rust run there too, and the better is kept
    /// [`cargo xtask bench --peers` makes one]
    #[arg(long, value_name = "PROGRAM", requires = "peers")]
    pub(crate) native_build: Option<PathBuf>,

    /// Tiny scenes, few rays, one repeat, every builder: a check that everything works, in seconds
    #[arg(long)]
    pub(crate) smoke: bool,

    /// Also write the records to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,

    /// Where the folder of the run goes [default: target/bench of the workspace]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// A count that makes no sense as 0.
pub(crate) fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".into()),
        Ok(n) => Ok(n),
        Err(why) => Err(format!("{why}")),
    }
}

/// The name of a value as the command line and the record write it.
pub(crate) fn name_of<T: ValueEnum>(value: &T) -> String {
    value
        .to_possible_value()
        .map_or_else(String::new, |v| v.get_name().to_owned())
}

/// Something is asked for that there is not: the program ends with exit code 2.
#[derive(Debug)]
pub(crate) struct UsageError(pub(crate) String);

impl fmt::Display for UsageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UsageError {}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn what_does_not_exist_is_refused_with_what_does() {
        for (flag, value, offered) in [
            ("--builder", "grown", "balanced"),
            ("--structure", "ropes", "kd"),
            ("--layout", "narrow", "binary"),
            ("--rays", "primary-batch", "primary"),
        ] {
            let refused = Cli::try_parse_from(["kd-bench", "bench", flag, value])
                .expect_err("a later version may know it");
            let message = refused.to_string();
            assert_eq!(refused.exit_code(), 2, "{message}");
            assert!(
                message.contains(value) && message.contains(offered),
                "{message}"
            );
        }
    }

    #[test]
    fn lists_are_separated_by_commas() {
        let parsed =
            Cli::try_parse_from(["kd-bench", "bench", "--builder", "median,exact"]).expect("valid");
        let Command::Bench(arguments) = parsed.command else {
            panic!("asked for bench");
        };
        assert_eq!(
            arguments.builder,
            [BuilderName::Median, BuilderName::Exact],
            "in that order"
        );
        assert!(
            Cli::try_parse_from(["kd-bench", "bench", "--threads", "0"]).is_err(),
            "no threads"
        );
    }
}
