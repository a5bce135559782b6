//! The measuring program of kd: builds trees over scenes, traces rays through them, checks every answer, and writes
//! what it saw as a table, as records (one JSON line per cell) and as an HTML report.
//!
//! Started by `cargo xtask bench | builds | rays | merges | structures | paper | instructions | report | calibrate | compare`.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command line program talks to its user there"
)]

mod animation;
mod builds;
mod calibrate;
mod check;
mod cli;
mod compare;
mod environment;
mod goals;
mod instructions;
mod measure;
mod memory;
mod merges;
mod native;
mod ours;
mod paper;
mod peers;
mod picture;
mod plots;
mod ray_speeds;
mod rays;
mod record;
mod report;
mod run_folder;
mod sampling;
mod scene_table;
mod scene_views;
mod scenes;
mod structure;
mod structures;
mod sweep;
mod terminal;
mod variants;
mod workload;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser as _};

use cli::{Cli, Command, UsageError};

fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Bench(arguments) => sweep::run(&arguments),
        Command::Builds(arguments) => builds::run(&arguments),
        Command::Rays(arguments) => ray_speeds::run(&arguments),
        Command::Merges(arguments) => merges::run(&arguments),
        Command::Structures(arguments) => structures::run(&arguments),
        Command::Paper(arguments) => paper::run(&arguments),
        Command::Instructions(arguments) => instructions::run(&arguments),
        Command::Report { run } => report::rewrite(&run),
        Command::Calibrate(arguments) => calibrate::run(&arguments),
        Command::Compare { before, after } => compare::run(&before, &after),
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
