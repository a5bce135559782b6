//! Everything that measures: builds `kd-bench` in release and hands it the arguments.

use std::process::ExitCode;

use crate::{Outcome, cargo, workspace_root};

/// Runs `kd-bench SUBCOMMAND ARGUMENTS` in the user's folder, so that relative paths mean what they say, and passes its
/// exit code on.
pub(crate) fn run(subcommand: &str, arguments: &[String]) -> Outcome {
    let status = cargo()
        .args([
            "run",
            "--release",
            "--package",
            "kd-bench",
            "--manifest-path",
        ])
        .arg(workspace_root().join("Cargo.toml"))
        .args(["--", subcommand])
        .args(arguments)
        .status()
        .map_err(|why| format!("cannot start cargo: {why}"))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    code.map(ExitCode::from)
        .ok_or_else(|| format!("kd-bench was stopped: {status}"))
}
