//! Tasks of the workspace: `cargo xtask <command>`.
//!
//! It depends on no kd crate, so it starts at once and still runs when one of them does not compile. Everything that measures is
//! in `kd-bench`, which it builds and starts.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command line program prints there"
)]

mod bench;
mod tidy;

use std::path::Path;
use std::process::ExitCode;

/// The result of a task: an exit code to pass on, or the reason of a failure.
type Outcome = Result<ExitCode, String>;

struct Command {
    name: &'static str,
    arguments: &'static str,
    help: &'static str,
    run: fn(&[String]) -> Outcome,
}

const COMMANDS: &[Command] = &[
    Command {
        name: "bench",
        arguments: "[OPTIONS]",
        help: "measure builds and rays over the scenes (`bench --help` lists the options)",
        run: |arguments| bench::run_with_native_build("bench", arguments),
    },
    Command {
        name: "builds",
        arguments: "[OPTIONS]",
        help: "measure build times of kd-trees by the presets, over Embree and each other (`builds --help`)",
        run: |arguments| bench::with_rivals("builds", arguments),
    },
    Command {
        name: "files",
        arguments: "[OPTIONS]",
        help: "measure how long files of each format take to read (`files --help` lists the options)",
        run: |arguments| bench::run("files", arguments),
    },
    Command {
        name: "first-ray",
        arguments: "[OPTIONS]",
        help: "measure the time until the first ray, hostile meshes and many parts, over Embree (`first-ray --help`)",
        run: |arguments| bench::with_rivals("first-ray", arguments),
    },
    Command {
        name: "saved",
        arguments: "[OPTIONS]",
        help: "measure how long trees take to save, to load and to open, and their memory (`saved --help`)",
        run: |arguments| bench::run("saved", arguments),
    },
    Command {
        name: "rays",
        arguments: "[OPTIONS]",
        help: "measure rays through the default tree, over rivals (`rays --help` lists the options)",
        run: |arguments| bench::with_rivals("rays", arguments),
    },
    Command {
        name: "queries",
        arguments: "[OPTIONS]",
        help: "measure every query of rays in every structure, over the closest hit and Embree (`queries --help`)",
        run: |arguments| bench::with_rivals("queries", arguments),
    },
    Command {
        name: "merges",
        arguments: "[OPTIONS]",
        help: "measure merges of trees and rays through the result, over rebuilding (`merges --help` lists the options)",
        run: |arguments| bench::run("merges", arguments),
    },
    Command {
        name: "points",
        arguments: "[OPTIONS]",
        help: "measure closest points, inside tests and winding numbers, with --peers over rivals (`points --help`)",
        run: |arguments| bench::run("points", arguments),
    },
    Command {
        name: "structures",
        arguments: "[OPTIONS]",
        help: "measure grids and hierarchies, over rivals and the default tree (`structures --help`)",
        run: |arguments| bench::with_rivals("structures", arguments),
    },
    Command {
        name: "spheres",
        arguments: "[OPTIONS]",
        help: "measure rays through primitives of a program's own, over Embree's user geometry (`spheres --help`)",
        run: |arguments| bench::with_rivals("spheres", arguments),
    },
    Command {
        name: "paper",
        arguments: "TABLE [OPTIONS]",
        help: "reproduce a table of one of the papers (`paper --help` lists them)",
        run: |arguments| bench::run("paper", arguments),
    },
    Command {
        name: "instructions",
        arguments: "[--json FILE]",
        help: "count instructions per ray with valgrind; every run gives the same counts",
        run: |arguments| bench::run("instructions", arguments),
    },
    Command {
        name: "report",
        arguments: "RUN",
        help: "write the HTML report of a recorded run",
        run: |arguments| bench::run("report", arguments),
    },
    Command {
        name: "calibrate",
        arguments: "[OPTIONS]",
        help: "fit the cost model to measured rays (`calibrate --help` lists the options)",
        run: |arguments| bench::run("calibrate", arguments),
    },
    Command {
        name: "compare",
        arguments: "RUN RUN",
        help: "list the differences between two runs; fails on any that is not a time",
        run: |arguments| bench::run("compare", arguments),
    },
    Command {
        name: "results",
        arguments: "[--check]",
        help: "write docs/results.md from the recorded runs; with --check, fail if it differs",
        run: |arguments| bench::run("results", arguments),
    },
    Command {
        name: "tidy",
        arguments: "[--quick] [--run-commands]",
        help: "check crate edges, links, snippets, facts, invariants and commands in the documents",
        run: |arguments| tidy::run(arguments, &calls()),
    },
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((name, rest)) = arguments.split_first() else {
        return usage("no command given");
    };
    let Some(command) = COMMANDS.iter().find(|command| command.name == *name) else {
        return usage(&format!("unknown command `{name}`"));
    };
    (command.run)(rest).unwrap_or_else(|why| {
        eprintln!("xtask {name}: {why}");
        ExitCode::FAILURE
    })
}

/// The command lines that the help prints.
fn calls() -> Vec<String> {
    let call = |command: &Command| format!("cargo xtask {} {}", command.name, command.arguments);
    COMMANDS.iter().map(call).collect()
}

fn usage(complaint: &str) -> ExitCode {
    eprintln!("xtask: {complaint}\n\nusage: cargo xtask COMMAND\n");
    for command in COMMANDS {
        let call = format!("{} {}", command.name, command.arguments);
        eprintln!("  {call:<31} {}", command.help);
    }
    ExitCode::from(2)
}

/// The folder of the workspace's `Cargo.toml`.
fn workspace_root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("xtask is a folder of the workspace")
}

/// The cargo that runs this program.
fn cargo() -> std::process::Command {
    std::process::Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}
