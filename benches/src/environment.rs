//! The machine, the compiler and the commit of a measurement.

use std::fs;
use std::process::Command;

use crate::run_folder::workspace_root;

/// The fields of a record that are equal in a whole run.
#[derive(Clone, Debug)]
pub(crate) struct Environment {
    /// Commit of the workspace, with `-dirty` if it has changes, or `unknown`.
    pub(crate) rev: String,
    pub(crate) cpu: String,
    /// Version of the compiler that built this program.
    pub(crate) rustc: String,
    /// The flags of the compiler.
    pub(crate) rustflags: String,
    /// The widest vector instructions that trace rays.
    pub(crate) simd: String,
}

impl Environment {
    pub(crate) fn detect() -> Self {
        Self {
            rev: revision().unwrap_or_else(|| "unknown".into()),
            cpu: cpu().unwrap_or_else(|| std::env::consts::ARCH.into()),
            rustc: env!("KD_BENCH_RUSTC").into(),
            rustflags: env!("KD_BENCH_RUSTFLAGS").into(),
            simd: simd().into(),
        }
    }
}

fn revision() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .arg("-C")
            .arg(workspace_root())
            .args(arguments)
            .output()
            .ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    let commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    let changes = git(&["status", "--porcelain", "--untracked-files=no"])?;
    Some(if changes.is_empty() {
        commit
    } else {
        format!("{commit}-dirty")
    })
}

fn cpu() -> Option<String> {
    if cfg!(target_os = "macos") {
        let output = Command::new("sysctl")
            .args(["-n", "machdep.cpu.brand_string"])
            .output()
            .ok()?;
        return Some(String::from_utf8(output.stdout).ok()?.trim().to_owned());
    }
    if cfg!(windows) {
        return std::env::var("PROCESSOR_IDENTIFIER").ok();
    }
    let info = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// The level that a tree detects, or the target of the whole program.
fn simd() -> &'static str {
    let level = kd::layout::Level::detect();
    if level == kd::layout::Level::portable() {
        compiled_simd()
    } else {
        level.name()
    }
}

fn compiled_simd() -> &'static str {
    if cfg!(target_feature = "avx512f") {
        "avx512"
    } else if cfg!(target_feature = "avx2") {
        "avx2"
    } else if cfg!(target_feature = "sse2") {
        "sse2"
    } else if cfg!(target_feature = "neon") {
        "neon"
    } else {
        "none"
    }
}
