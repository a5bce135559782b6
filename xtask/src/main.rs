//! Tasks of the workspace: `cargo xtask <command>`.
//!
//! Thin on purpose. It depends on no kd crate, so it starts at once and still runs when one of them does not compile;
//! everything that measures lives in `kd-bench`, which it builds and starts.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command line program talks to its user there"
)]

mod bench;
mod tidy;

use std::path::Path;
use std::process::ExitCode;

/// What a task may end with: an exit code to pass on, or the reason why it failed.
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
        help: "print what the presets cost and are worth, over Embree and each other (`builds --help`)",
        run: |arguments| bench::with_rivals("builds", arguments),
    },
    Command {
        name: "rays",
        arguments: "[OPTIONS]",
        help: "print how fast the default tree answers rays, over rivals (`rays --help` lists the options)",
        run: |arguments| bench::with_rivals("rays", arguments),
    },
    Command {
        name: "merges",
        arguments: "[OPTIONS]",
        help: "print what merging trees costs and is worth, over building anew (`merges --help` lists the options)",
        run: |arguments| bench::run("merges", arguments),
    },
    Command {
        name: "structures",
        arguments: "[OPTIONS]",
        help: "print what grids and hierarchies cost and are worth, over rivals and the default tree (`structures --help`)",
        run: |arguments| bench::with_rivals("structures", arguments),
    },
    Command {
        name: "paper",
        arguments: "TABLE [OPTIONS]",
        help: "make a table of one of the papers again (`paper --help` lists them)",
        run: |arguments| bench::run("paper", arguments),
    },
    Command {
        name: "instructions",
        arguments: "[--json FILE]",
        help: "count instructions per ray, with valgrind: the same on every run",
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
        help: "list what differs between two runs; fails on any exact difference",
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
        arguments: "[--quick]",
        help: "check crate edges, links, snippets and facts in the docs, and the invariants table",
        run: tidy::run,
    },
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((name, rest)) = arguments.split_first() else {
        return usage("a command is missing");
    };
    let Some(command) = COMMANDS.iter().find(|command| command.name == *name) else {
        return usage(&format!("there is no command `{name}`"));
    };
    (command.run)(rest).unwrap_or_else(|why| {
        eprintln!("xtask {name}: {why}");
        ExitCode::FAILURE
    })
}

fn usage(complaint: &str) -> ExitCode {
    eprintln!("xtask: {complaint}\n\nusage: cargo xtask COMMAND\n");
    for command in COMMANDS {
        let call = format!("{} {}", command.name, command.arguments);
        eprintln!("  {call:<20} {}", command.help);
    }
    ExitCode::from(2)
}

/// The folder of the workspace's `Cargo.toml`.
fn workspace_root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("xtask lies in the workspace")
}

/// The cargo that runs this program.
fn cargo() -> std::process::Command {
    std::process::Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}
