//! Runs of the program `kd`.

use std::path::Path;
use std::process::{Command, Output};

pub(crate) fn kd(folder: &Path, arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_kd");
    let run = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .output();
    run.expect("the program starts")
}

/// Runs the program, which must succeed, and returns its stdout.
#[track_caller]
pub(crate) fn stdout_of(folder: &Path, arguments: &[&str]) -> String {
    let output = kd(folder, arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs the program, which must fail, and returns its stderr.
#[track_caller]
pub(crate) fn error_of(folder: &Path, arguments: &[&str]) -> String {
    let output = kd(folder, arguments);
    assert!(!output.status.success(), "{arguments:?} should fail");
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!errors.contains("panicked"), "{arguments:?}: {errors}");
    errors
}
