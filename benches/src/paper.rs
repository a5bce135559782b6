//! The tables of the papers, reproduced beside ours.

mod batches;
mod frame;
mod grid_table;
mod growth;
mod merge_table;
mod mirrors;
mod rendered;

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::arguments::at_least_one;

/// Which table, and over what.
#[derive(Args, Debug)]
pub(crate) struct PaperArgs {
    /// The table
    #[arg(value_enum)]
    table: PaperTable,

    /// Measures the animations in this folder, each a folder of baked frames, or for grid-table its meshes; without it,
    /// generated ones
    #[arg(long, value_name = "DIR", env = "KD_SCENES")]
    scenes: Option<PathBuf>,

    /// Only these animations [default with --scenes: BART kitchen], or these scenes [default for grid-table: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    scene: Vec<String>,

    /// Only these rows, by their numbers from 1 on [default: all]
    #[arg(long, value_name = "N", value_delimiter = ',')]
    rows: Vec<usize>,

    /// Timed repeats of each measurement, each after one of the baseline
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = at_least_one)]
    samples: usize,

    /// Trace about N rays of the picture, in whole runs of 64 neighbors, and the rays that follow from them; 0 traces all
    #[arg(long, value_name = "N", default_value_t = 120_000)]
    ray_limit: usize,

    /// Instead, generate static rooms of up to ten million triangles and print the time of an update apart from them
    #[arg(long)]
    growth: bool,

    /// Instead, render the pictures too: on all threads, with textures
    #[arg(long, conflicts_with = "growth")]
    rendered: bool,

    /// With --rendered: print for every Nth frame whether merging finishes its picture earlier
    #[arg(long, value_name = "N", requires = "rendered")]
    share: Option<usize>,

    /// With --rendered: also write the picture of the frame in the middle, with six lights
    #[arg(long, value_name = "FILE", requires = "rendered")]
    picture: Option<PathBuf>,

    /// Also measure Embree's ways to follow moving parts; `KD_EMBREE` may name the file of the library
    #[arg(long)]
    peers: bool,

    /// A small generated scene and few rays: a check that the command works
    #[arg(long)]
    smoke: bool,

    /// Also write one JSON object for each row and strategy
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Also write a plot, as SVG: of update times and traces by row; of errors of the estimate
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,

    /// For grid-table: also write the measurements as a calibration of this machine
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum PaperTable {
    /// Table 4.1 of *kd-tree merging* (Eleftheriades 2010): frames by merging and by rebuilding
    MergeTable,
    /// Table 1 and Figures 1 and 2 of *When It Makes Sense to Use Uniform Grids for Ray Tracing* (Hapala, Karlík and Havran
    /// 2011): grids and kd-trees over many scenes, and the choice between them
    GridTable,
}

/// Measures, prints and writes; false if an answer is wrong. A missed goal is printed and is no failure.
pub(crate) fn run(arguments: &PaperArgs) -> anyhow::Result<bool> {
    match arguments.table {
        PaperTable::MergeTable if arguments.growth => growth::run(arguments),
        PaperTable::MergeTable if arguments.rendered => rendered::run(arguments),
        PaperTable::MergeTable => merge_table::run(arguments),
        PaperTable::GridTable => grid_table::run(arguments),
    }
}
