//! Commands that measure: builds `kd-bench`, in release unless nothing is measured, and passes the arguments on.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::{Outcome, cargo, workspace_root};

/// Rivals written in Rust are faster in a build for this processor, which their users can choose, so they are measured in both
/// builds.
const RUST_RIVALS: [&str; 4] = ["obvhs", "bvh", "parry3d", TINYBVH];

/// The rival that needs a C++ compiler: compiled in only if it is named.
const TINYBVH: &str = "tinybvh";

/// Runs `kd-bench SUBCOMMAND ARGUMENTS` in the user's folder, so that relative paths stay valid, and passes its exit code on.
/// With `--peers`, rival libraries are compiled in.
pub(crate) fn run(subcommand: &str, arguments: &[String]) -> Outcome {
    let has_rivals = arguments.iter().any(|argument| argument == "--peers");
    if has_rivals {
        return with_rivals(subcommand, arguments);
    }
    start(subcommand, &[], arguments)
}

/// [`run`] for the one subcommand that measures rivals written in Rust in a second build, too, and takes its path.
pub(crate) fn run_with_native_build(subcommand: &str, arguments: &[String]) -> Outcome {
    let mut arguments = arguments.to_vec();
    if needs_native_build(&arguments) {
        let program = native_build(features(&arguments))?;
        arguments.extend(["--native-build".into(), program.display().to_string()]);
    }
    run(subcommand, &arguments)
}

/// Runs a build with rival libraries.
pub(crate) fn with_rivals(subcommand: &str, arguments: &[String]) -> Outcome {
    start(subcommand, &["--features", features(arguments)], arguments)
}

fn start(subcommand: &str, flags: &[&str], arguments: &[String]) -> Outcome {
    let status = cargo()
        .arg("run")
        .args(profile(subcommand, arguments))
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

/// Release for measurements. Subcommands that read records, and runs with `--smoke`, which only check that the command works, use
/// the build of the tests.
fn profile(subcommand: &str, arguments: &[String]) -> Option<&'static str> {
    let reads_records = ["report", "compare", "results"].contains(&subcommand);
    let is_smoke = arguments.iter().any(|argument| argument == "--smoke");
    (!reads_records && !is_smoke).then_some("--release")
}

/// Whether a run measures one of [`RUST_RIVALS`]: with `--peers`, all of them unless `--structure` names others. Neither help nor a
/// check that the command works needs the second build.
fn needs_native_build(arguments: &[String]) -> bool {
    let has = |flags: &[&str]| {
        arguments
            .iter()
            .any(|argument| flags.contains(&argument.as_str()))
    };
    if !has(&["--peers"]) || has(&["--help", "-h", "--native-build", "--smoke"]) {
        return false;
    }
    let names = structures(arguments);
    names.is_empty() || names.iter().any(|name| RUST_RIVALS.contains(name))
}

/// The features of a build with rivals.
fn features(arguments: &[String]) -> &'static str {
    if structures(arguments).contains(&TINYBVH) {
        "tinybvh"
    } else {
        "peers"
    }
}

/// The names after `--structure`.
fn structures(arguments: &[String]) -> Vec<&str> {
    let mut lists = Vec::new();
    for (place, argument) in arguments.iter().enumerate() {
        if let Some(list) = argument.strip_prefix("--structure=") {
            lists.push(list);
        } else if argument == "--structure" {
            lists.extend(arguments.get(place + 1).map(String::as_str));
        }
    }
    lists.iter().flat_map(|list| list.split(',')).collect()
}

/// Builds `kd-bench` with rivals for this processor, in a separate folder so that the default build stays, and returns its
/// path.
fn native_build(features: &str) -> Result<PathBuf, String> {
    let folder = workspace_root().join("target").join("native");
    let status = cargo()
        .args(["build", "--release", "--package", "kd-bench"])
        .args(["--features", features, "--manifest-path"])
        .arg(workspace_root().join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&folder)
        // The other variable would override this one.
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

    fn needs_second_build(arguments: &str) -> bool {
        let arguments: Vec<String> = arguments.split(' ').map(String::from).collect();
        needs_native_build(&arguments)
    }

    #[test]
    fn a_rival_that_needs_a_cpp_compiler_is_compiled_only_if_named() {
        let features = |call: &str| {
            let call: Vec<String> = call.split(' ').map(String::from).collect();
            features(&call)
        };
        assert_eq!(features("--peers"), "peers");
        assert_eq!(features("--peers --structure kd,tinybvh"), "tinybvh");
        assert!(needs_second_build("--peers --structure=tinybvh"));
    }

    #[test]
    fn measurements_run_in_release() {
        let profile = |call: &str| {
            let call: Vec<String> = call.split(' ').map(String::from).collect();
            profile(&call[0], &call[1..])
        };
        assert_eq!(profile("bench --samples 5"), Some("--release"));
        assert_eq!(profile("bench --samples 1 --smoke"), None);
        assert_eq!(profile("results --check"), None);
    }

    #[test]
    fn only_rivals_written_in_rust_need_a_second_build() {
        assert!(needs_second_build("--peers"), "all of them");
        assert!(
            needs_second_build("--peers --structure kd,bvh"),
            "one in a list"
        );
        assert!(
            needs_second_build("--structure=kd --structure=obvhs --peers"),
            "one of two flags"
        );
        for arguments in [
            "--peers --structure kd,embree --scene bvh",
            "--structure bvh",
            "--peers --help",
            "--peers --smoke",
        ] {
            assert!(!needs_second_build(arguments), "{arguments}");
        }
    }
}
