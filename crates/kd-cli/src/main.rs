//! The command-line program `kd`: renders scenes, traces rays of files, prints statistics of trees, converts formats.
#![allow(
    clippy::print_stderr,
    reason = "a command-line program reports on stderr"
)]
#![deny(unsafe_code)]

mod animation;
mod cast;
mod compare;
mod convert;
mod print;
mod render;
mod scene;
mod stats;
mod tree;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// The formats of each command.
const FORMATS: &str = "\
Scenes: OBJ with MTL, PLY, STL, OFF, glTF 2.0 (.gltf, .glb), 3MF, AFF and NFF, by their content, then their extension; and generated ones.
Rays: CSV, NPY, a camera, a LiDAR. Hits: CSV, NPY, LAS.
Pictures: PNG, JPEG, PPM, animated GIF. Meshes and trees: PLY, OBJ, .kd.";

/// Render scenes, trace rays, print statistics of trees, and convert formats.
#[derive(Parser, Debug)]
#[command(name = "kd", version, about, after_help = FORMATS)]
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
    /// Trace rays from a file, a camera or a LiDAR, and write their hits
    Cast(Box<cast::CastArgs>),
    /// Write a scene at one time as a mesh, or as a tree file
    Convert(convert::ConvertArgs),
    /// Compare the trees of several builders and the time of a picture with each
    Compare(compare::CompareArgs),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Stats(arguments) => stats::run(&arguments),
        Command::Cast(arguments) => cast::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("kd: {}", text(&error));
            ExitCode::FAILURE
        }
    }
}

/// The text of an error and of its causes, unless an error has that of its cause already.
fn text(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1) {
        let cause = cause.to_string();
        if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn each_cause_appears_once() {
        let missing = anyhow::Error::new(std::io::Error::other("gone"));
        assert_eq!(text(&missing.context("a.obj")), "a.obj: gone");
        let loaded = kd_scene::load_mesh("no-such.obj").expect_err("missing");
        let with_context = anyhow::Error::new(loaded).context("scene");
        let message = text(&with_context);
        assert_eq!(message.matches("os error 2").count(), 1, "{message}");
    }

    #[test]
    fn the_command_line_is_well_formed() {
        Arguments::command().debug_assert();
    }
}
