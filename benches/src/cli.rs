//! The command line.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use crate::builds::BuildsArgs;
use crate::calibrate::CalibrateArgs;
use crate::files::FilesArgs;
use crate::first_ray::FirstRayArgs;
use crate::instructions::InstructionsArgs;
use crate::merges::MergesArgs;
use crate::paper::PaperArgs;
use crate::points::PointsArgs;
use crate::queries::QueriesArgs;
use crate::ray_speeds::RaysArgs;
use crate::results::ResultsArgs;
use crate::saved::SavedArgs;
use crate::scene_table::SceneTableArgs;
use crate::spheres::SpheresArgs;
use crate::sweep::BenchArgs;

/// Measures kd-trees: builds, rays, memory, and the correctness of answers.
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
    /// Print what the kd-trees of our presets cost to build and are worth, over Embree's builds and over each other, with goals
    ///
    /// With --scenes and no --scene: the six meshes of the goals.
    Builds(BuildsArgs),
    /// Print how long files of each format take to read, over their bytes and over `tobj`, and the memory that it takes, with goals
    Files(FilesArgs),
    /// Print the time until the first ray by our presets and the rays that follow, over Embree; on hostile meshes and many parts too
    ///
    /// With --scenes and no --scene: every mesh of the folder.
    FirstRay(FirstRayArgs),
    /// Print how long trees take to save, to load and to open, until the first ray, and the memory that it takes, with goals
    Saved(SavedArgs),
    /// Print the speed of rays through our default tree, over rivals, with goals
    ///
    /// With --scenes and no --scene: every mesh of the folder.
    Rays(RaysArgs),
    /// Print what each query of rays costs in every structure, over the closest hit and over Embree
    ///
    /// With --scenes and no --scene: a scan, a room and a game level.
    Queries(QueriesArgs),
    /// Print what merges of trees cost and are worth, over rebuilds, with goals
    Merges(MergesArgs),
    /// Print what grids, hierarchies and the papers' other structures cost and are worth, over rivals and our default tree, with
    /// goals
    ///
    /// With --scenes and no --scene: the four scans of the goals, two rooms and a city.
    Structures(SceneTableArgs),
    /// Print the speed of rays through spheres of a program's own, over Embree's user geometry, with goals
    Spheres(SpheresArgs),
    /// Print how fast points are answered: closest points near and far, inside or not, winding numbers; with --peers over rivals, with goals
    ///
    /// With --scenes and no --scene: the meshes of the goals, or every mesh of a folder without them.
    Points(PointsArgs),
    /// Reproduce a table of one of the papers, beside our figures
    Paper(Box<PaperArgs>),
    /// Count instructions per ray, which do not depend on the load of the machine
    Instructions(InstructionsArgs),
    /// Write the HTML report of a recorded run again
    Report {
        /// A folder that `bench` wrote, for example target/bench/latest
        run: PathBuf,
    },
    /// Fit the cost of each step of a traversal to measured rays
    Calibrate(CalibrateArgs),
    /// List the differences of two runs; fails on any difference that is not a time
    Compare {
        /// A folder that `bench` wrote, or a file of JSON lines
        before: PathBuf,
        /// The run to compare it with
        after: PathBuf,
    },
    /// Write docs/results.md from the recorded runs in benches/records
    Results(ResultsArgs),
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;
    use crate::names::BuilderName;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn unknown_values_are_refused_with_the_known_ones() {
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
        let no_threads = ["kd-bench", "bench", "--threads", "0"];
        assert!(Cli::try_parse_from(no_threads).is_err(), "no threads");
    }

    #[test]
    fn lists_are_separated_by_commas() {
        let list = ["kd-bench", "bench", "--builder", "median,exact"];
        let parsed = Cli::try_parse_from(list).expect("valid");
        let Command::Bench(arguments) = parsed.command else {
            panic!("bench was called");
        };
        let builders = format!("{:?}", [BuilderName::Median, BuilderName::Exact]);
        assert!(
            format!("{arguments:?}").contains(&builders),
            "in that order"
        );
    }
}
