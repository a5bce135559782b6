//! Checks that no compiler makes: which crate depends on which, and whether the documents are still true.
//!
//! Each rule is a pure function from texts to complaints, so that its tests can show it failing. Only documented commands are
//! also run, on request.

mod commands;
mod edges;
mod invariants;
mod links;
mod markdown;
mod msrv;
mod snippets;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use crate::{Outcome, cargo, workspace_root};

/// A file and its text. The path is relative to the workspace, with `/` between folders.
struct Document {
    path: String,
    text: String,
}

/// Checks everything, prints every complaint, and fails if there is one. `--quick` leaves out the doc tests; `--run-commands` also
/// runs each documented command in a small form. `help` holds the commands of `cargo xtask` as its help prints them.
pub(crate) fn run(arguments: &[String], help: &[String]) -> Outcome {
    let (mut quick, mut run_commands) = (false, false);
    for argument in arguments {
        match argument.as_str() {
            "--quick" => quick = true,
            "--run-commands" => run_commands = true,
            _ => return Err("the options are --quick and --run-commands".into()),
        }
    }
    let root = workspace_root();
    let metadata = metadata()?;
    let documents = documents(root)?;
    let sources = sources(root)?;
    let exists = |path: &str| root.join(path).exists();
    let checks = root.join(".ci/run");
    let checks =
        fs::read_to_string(&checks).map_err(|why| format!("{}: {why}", checks.display()))?;

    let mut rules = vec![
        ("crate edges", edges::check(&metadata)),
        ("links and paths", links::check(&documents, &exists)),
        ("snippets", snippets::check(&documents, &sources)),
        ("facts", msrv::check(&documents, &metadata)),
        (
            "invariants",
            invariants::check(&documents, &sources, &exists),
        ),
        (
            "documented commands",
            commands::check(&documents, &sources, help, &checks),
        ),
    ];
    if run_commands {
        let failed = commands::run(root, &documents, &sources, help, &checks)?;
        rules.push(("documented commands, run in small forms", failed));
    }
    let mut complaints = 0;
    for (rule, found) in &rules {
        println!(
            "tidy: {rule}: {}",
            if found.is_empty() { "ok" } else { "FAILED" }
        );
        for complaint in found {
            println!("  {complaint}");
        }
        complaints += found.len();
    }
    if !quick {
        println!("tidy: doc tests of the facade and of the documents it includes");
        doc_tests(root)?;
    }
    match complaints {
        0 => Ok(ExitCode::SUCCESS),
        1 => Err("1 complaint".into()),
        n => Err(format!("{n} complaints")),
    }
}

fn metadata() -> Result<serde_json::Value, String> {
    let output = cargo()
        .args([
            "metadata",
            "--no-deps",
            "--format-version",
            "1",
            "--manifest-path",
        ])
        .arg(workspace_root().join("Cargo.toml"))
        .output()
        .map_err(|why| format!("cannot start cargo: {why}"))?;
    if !output.status.success() {
        return Err(format!(
            "cargo metadata: {}",
            String::from_utf8_lossy(&output.stderr).trim()
        ));
    }
    serde_json::from_slice(&output.stdout).map_err(|why| format!("cargo metadata: {why}"))
}

/// The documents that make promises: those in the root that people read first, and everything in `docs`.
fn documents(root: &Path) -> Result<Vec<Document>, String> {
    let mut paths: Vec<PathBuf> = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md"]
        .iter()
        .map(|name| root.join(name))
        .filter(|path| path.exists())
        .collect();
    collect(&root.join("docs"), "md", &mut paths)?;
    read(root, paths)
}

/// Every Rust source of the workspace.
fn sources(root: &Path) -> Result<Vec<Document>, String> {
    let mut paths = Vec::new();
    for folder in ["crates", "benches", "xtask", "fuzz", "python"] {
        collect(&root.join(folder), "rs", &mut paths)?;
    }
    read(root, paths)
}

/// Adds all files under `folder` with that extension, in order of their names. A missing folder holds none.
fn collect(folder: &Path, extension: &str, into: &mut Vec<PathBuf>) -> Result<(), String> {
    if !folder.exists() {
        return Ok(());
    }
    let failed = |why: std::io::Error| format!("{}: {why}", folder.display());
    let mut entries = fs::read_dir(folder)
        .and_then(Iterator::collect::<Result<Vec<_>, _>>)
        .map_err(failed)?;
    entries.sort_by_key(fs::DirEntry::file_name);
    for entry in entries {
        let path = entry.path();
        let is_folder = entry.file_type().map_err(failed)?.is_dir();
        if is_folder && entry.file_name() != "target" {
            collect(&path, extension, into)?;
        } else if !is_folder && path.extension().is_some_and(|e| e == extension) {
            into.push(path);
        }
    }
    Ok(())
}

fn read(root: &Path, paths: Vec<PathBuf>) -> Result<Vec<Document>, String> {
    let read_one = |path: PathBuf| {
        let text = fs::read_to_string(&path).map_err(|why| format!("{}: {why}", path.display()))?;
        let relative = path.strip_prefix(root).unwrap_or(&path);
        let parts: Vec<_> = relative.iter().map(|part| part.to_string_lossy()).collect();
        Ok(Document {
            path: parts.join("/"),
            text,
        })
    };
    paths.into_iter().map(read_one).collect()
}

fn doc_tests(root: &Path) -> Result<(), String> {
    let status = cargo()
        .current_dir(root)
        .args(["test", "--quiet", "--doc", "--package", "kd"])
        .status()
        .map_err(|why| format!("cannot start cargo: {why}"))?;
    if status.success() {
        Ok(())
    } else {
        Err("a snippet does not compile or fails".into())
    }
}

#[cfg(test)]
fn document(path: &str, text: &str) -> Document {
    Document {
        path: path.into(),
        text: text.into(),
    }
}
