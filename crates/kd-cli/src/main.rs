//! `kd`: pictures of scenes, what their trees are like, and other formats.
#![allow(clippy::print_stderr, reason = "a program for the command line")]
#![forbid(unsafe_code)]

mod animation;
mod compare;
mod convert;
mod render;
mod say;
mod scene;
mod stats;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Pictures of scenes by rays, what their trees are like, and other formats.
#[derive(Parser, Debug)]
#[command(name = "kd", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand, Debug)]
enum Command {
    /// Make a picture, or an animation
    Render(render::RenderArgs),
    /// Tell what is in a scene, and what the tree over it is like
    Stats(stats::StatsArgs),
    /// Write what a scene is at one time as a mesh, or with its tree
    Convert(convert::ConvertArgs),
    /// Build by several builders, and compare trees and the pictures they take
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
    fn the_command_line_is_sound() {
        Arguments::command().debug_assert();
    }
}
