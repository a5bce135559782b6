//! The measuring program of kd: builds trees over scenes, traces rays through them, checks every answer, and writes tables,
//! records (one JSON line per cell) and an HTML report.
//!
//! Every command measures cells ([`record`]) of a scene ([`session`]) and prints views of them ([`view`], [`summary`]). Modules
//! import from those below: commands, then session, workload and structures, then record, names and helpers.
//!
//! Started by `cargo xtask bench | builds | files | first-ray | rays | queries | merges | points | structures | spheres | paper |
//! instructions | report | calibrate | compare | results`.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "the output of a command line program"
)]

mod animation;
mod arguments;
mod builds;
mod calibrate;
mod check;
mod cli;
mod compare;
mod environment;
mod files;
mod first_ray;
mod instructions;
mod measure;
mod memory;
mod merges;
mod names;
mod ours;
mod paper;
mod peers;
mod picture;
mod plots;
mod points;
mod queries;
mod ray_speeds;
mod rays;
mod record;
mod report;
mod results;
mod run_folder;
mod sampling;
mod saved;
mod scene_table;
mod scene_views;
mod scenes;
mod session;
mod spheres;
mod structure;
mod structures;
mod summary;
mod sweep;
mod text;
mod variant;
mod view;
mod workload;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser as _};

use arguments::UsageError;
use cli::{Cli, Command};

fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Bench(arguments) => sweep::run(&arguments),
        Command::Builds(arguments) => builds::run(&arguments),
        Command::Files(arguments) => files::run(&arguments),
        Command::Saved(arguments) => saved::run(&arguments),
        Command::FirstRay(arguments) => first_ray::run(&arguments),
        Command::Rays(arguments) => ray_speeds::run(&arguments),
        Command::Queries(arguments) => queries::run(&arguments),
        Command::Merges(arguments) => merges::run(&arguments),
        Command::Structures(arguments) => structures::run(&arguments),
        Command::Spheres(arguments) => spheres::run(&arguments),
        Command::Points(arguments) => points::run(&arguments),
        Command::Paper(arguments) => paper::run(&arguments),
        Command::Instructions(arguments) => instructions::run(&arguments),
        Command::Report { run } => report::rewrite(&run),
        Command::Calibrate(arguments) => calibrate::run(&arguments),
        Command::Compare { before, after } => compare::run(&before, &after),
        Command::Results(arguments) => results::run(&arguments),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(why) => match why.downcast::<UsageError>() {
            Ok(UsageError(what)) => Cli::command()
                .error(clap::error::ErrorKind::InvalidValue, what)
                .exit(),
            Err(why) => {
                eprintln!("kd-bench: {why:#}");
                ExitCode::FAILURE
            }
        },
    }
}
