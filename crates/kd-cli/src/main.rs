//! The command-line program `kd`: renders scenes, prints statistics of their trees, converts formats.
#![allow(
    clippy::print_stderr,
    reason = "a command-line program reports on stderr"
)]
#![forbid(unsafe_code)]

mod animation;
mod compare;
mod convert;
mod print;
mod render;
mod scene;
mod stats;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Render scenes, print statistics of their trees, and convert formats.
#[derive(Parser, Debug)]
#[command(name = "kd", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Render a picture or an animation
    Render(render::RenderArgs),
    /// Print the contents of a scene and the statistics of its tree
    Stats(stats::StatsArgs),
    /// Write a scene at one time as a mesh, or as a tree file
    Convert(convert::ConvertArgs),
    /// Compare the trees of several builders and the time of a picture with each
    Compare(compare::CompareArgs),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Stats(arguments) => stats::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("kd: {error:#}");
            ExitCode::FAILURE
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Arguments::command().debug_assert();
    }
}
