//! Everything that measures: builds `kd-bench`, in release unless nothing is measured, and hands it the arguments.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::{Outcome, cargo, workspace_root};

/// Rivals written in Rust are faster for some users than in a default build, so they are measured in both.
const RUST_RIVALS: [&str; 3] = ["obvhs", "bvh", "parry3d"];

/// Runs `kd-bench SUBCOMMAND ARGUMENTS` in the user's folder, so that relative paths mean what they say, and passes its
/// exit code on.
pub(crate) fn run(subcommand: &str, arguments: &[String]) -> Outcome {
    let has_rivals = arguments.iter().any(|argument| argument == "--peers");
    if !has_rivals {
        return start(subcommand, &[], arguments);
    }
    let mut arguments = arguments.to_vec();
    if names_rust_rival(&arguments) {
        let program = native_build()?;
        arguments.extend(["--native-build".into(), program.display().to_string()]);
    }
    with_rivals(subcommand, &arguments)
}

/// The same in a build with rival libraries.
pub(crate) fn with_rivals(subcommand: &str, arguments: &[String]) -> Outcome {
    start(subcommand, &["--features", "peers"], arguments)
}

fn start(subcommand: &str, flags: &[&str], arguments: &[String]) -> Outcome {
    let status = cargo()
        .arg("run")
        .args(profile(arguments))
        .args(["--package", "kd-bench", "--manifest-path"])
        .arg(workspace_root().join("Cargo.toml"))
        .args(flags)
        .args(["--", subcommand])
        .args(arguments)
        .status()
        .map_err(|why| format!("cannot start cargo: {why}"))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    code.map(ExitCode::from)
        .ok_or_else(|| format!("kd-bench was stopped: {status}"))
}

/// A smoke only checks that everything works: the build that tests have made is good enough.
fn profile(arguments: &[String]) -> Option<&'static str> {
    let is_smoke = arguments.iter().any(|argument| argument == "--smoke");
    (!is_smoke).then_some("--release")
}

/// Whether a run measures one of [`RUST_RIVALS`]: all rivals, unless `--structure` says which.
fn names_rust_rival(arguments: &[String]) -> bool {
    let mut lists = Vec::new();
    for (place, argument) in arguments.iter().enumerate() {
        if let Some(list) = argument.strip_prefix("--structure=") {
            lists.push(list);
        } else if argument == "--structure" {
            lists.extend(arguments.get(place + 1).map(String::as_str));
        }
    }
    let mut names = lists.iter().flat_map(|list| list.split(','));
    lists.is_empty() || names.any(|name| RUST_RIVALS.contains(&name))
}

/// Builds `kd-bench` with rivals for this very processor, in a folder of its own so that the default build stays, and
/// tells where it is.
fn native_build() -> Result<PathBuf, String> {
    let folder = workspace_root().join("target").join("native");
    let status = cargo()
        .args(["build", "--release", "--package", "kd-bench"])
        .args(["--features", "peers", "--manifest-path"])
        .arg(workspace_root().join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&folder)
        // The other variable would take the place of this one.
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env("RUSTFLAGS", "-C target-cpu=native")
        .status()
        .map_err(|why| format!("cannot start cargo: {why}"))?;
    if !status.success() {
        return Err("kd-bench does not compile with target-cpu=native".into());
    }
    let name = format!("kd-bench{}", std::env::consts::EXE_SUFFIX);
    Ok(folder.join("release").join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measures_rust_rival(arguments: &str) -> bool {
        let arguments: Vec<String> = arguments.split(' ').map(String::from).collect();
        names_rust_rival(&arguments)
    }

    #[test]
    fn what_is_measured_is_built_in_release() {
        let profile = |arguments: &str| {
            let arguments: Vec<String> = arguments.split(' ').map(String::from).collect();
            profile(&arguments)
        };
        assert_eq!(profile("--samples 5"), Some("--release"));
        assert_eq!(profile("--samples 1 --smoke"), None);
    }

    #[test]
    fn a_second_build_is_made_only_for_rivals_written_in_rust() {
        assert!(measures_rust_rival("--peers"), "all of them");
        assert!(measures_rust_rival("--structure kd,bvh"), "one in a list");
        assert!(
            measures_rust_rival("--structure=kd --structure=obvhs"),
            "one of two flags"
        );
        assert!(
            !measures_rust_rival("--structure kd,embree --scene bvh"),
            "none of them"
        );
    }
}
