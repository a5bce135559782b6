//! Runs small forms, and complains of those that fail.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use super::Planned;
use super::collect::Documented;
use super::small_form::{SmallForm, Tool, recorded_run};
use crate::cargo;

/// How many lines of the output of a command that fails are shown.
const SHOWN_LINES: usize = 12;

/// Whether a tool is in a place where programs look for it.
pub(super) fn is_installed(tool: Tool) -> bool {
    match tool {
        Tool::Embree => has_embree(),
        Tool::Valgrind => {
            let folders = std::env::var_os("PATH").unwrap_or_default();
            std::env::split_paths(&folders).any(|folder| folder.join("valgrind").is_file())
        }
    }
}

/// Whether the user names the file of Embree, or a folder in which dynamic linkers look has Embree 3 or 4.
fn has_embree() -> bool {
    if let Some(named) = std::env::var_os("KD_EMBREE") {
        return !named.is_empty();
    }
    let listed = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let mut folders: Vec<PathBuf> = std::env::split_paths(&listed).collect();
    for folder in [
        "/lib",
        "/lib64",
        "/usr/lib",
        "/usr/lib64",
        "/usr/local/lib",
        "/opt/homebrew/lib",
    ] {
        folders.push(folder.into());
        // `/usr/lib/x86_64-linux-gnu` and its like.
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        folders.extend(entries.map(|entry| entry.path()).filter(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.ends_with("-linux-gnu")
        }));
    }
    let files = folders
        .iter()
        .filter_map(|folder| fs::read_dir(folder).ok());
    files.flatten().flatten().any(|file| {
        let name = file.file_name();
        let name = name.to_string_lossy();
        name.starts_with("libembree3.") || name.starts_with("libembree4.")
    })
}

/// Runs all forms within a budget of time, first the one whose record others read. Complains of each that fails and of each that
/// the budget leaves out.
pub(super) fn run_all(
    planned: Vec<Planned>,
    is_installed: &dyn Fn(Tool) -> bool,
    budget: Duration,
    start: &mut dyn FnMut(&SmallForm, Duration) -> Result<(), String>,
) -> Vec<String> {
    let begin = Instant::now();
    let mut complaints = Vec::new();
    for Planned { form, documented } in in_order(planned, is_installed) {
        let title = titled(&documented);
        let Some(left) = budget.checked_sub(begin.elapsed()) else {
            let minutes = budget.as_secs() / 60;
            complaints.push(format!("{title} did not run: {minutes} minutes are spent"));
            continue;
        };
        let line = format!("cargo {}", form.arguments.join(" "));
        let started = Instant::now();
        let outcome = start(&form, left);
        println!("tidy: {:.0} s: {line}", started.elapsed().as_secs_f64());
        if let Err(why) = outcome {
            complaints.push(format!("{title} fails as `{line}`: {why}"));
        }
    }
    complaints
}

/// The forms that run on this machine, the record that others read first. Forms that are equal without `--peers` are one.
fn in_order(planned: Vec<Planned>, is_installed: &dyn Fn(Tool) -> bool) -> Vec<Planned> {
    let mut forms: Vec<Planned> = Vec::new();
    let mut add = |form: SmallForm, documented: Vec<Documented>| match forms
        .iter_mut()
        .find(|planned| planned.form == form)
    {
        Some(planned) => planned.documented.extend(documented),
        None => forms.push(Planned { form, documented }),
    };
    let mut readers = planned
        .iter()
        .filter(|planned| planned.form.needs_recorded_run());
    if let Some(reader) = readers.next() {
        add(recorded_run(), reader.documented.clone());
    }
    for Planned { form, documented } in planned {
        if let Some(form) = form.with_tools(is_installed) {
            add(form, documented);
        } else if let Some(tool) = form.needs {
            let title = titled(&documented);
            println!("tidy: {title} does not run: {tool:?} is not installed");
        }
    }
    forms
}

/// The first documented line, and where else it is.
fn titled(documented: &[Documented]) -> String {
    let Some((first, others)) = documented.split_first() else {
        return String::new();
    };
    let others: Vec<&str> = others.iter().map(|other| other.place.as_str()).collect();
    if others.is_empty() {
        first.to_string()
    } else {
        format!("{first} (and {})", others.join(", "))
    }
}

/// Runs a form in a folder and waits for its end, at most for the time given.
pub(super) fn start(form: &SmallForm, folder: &Path, limit: Duration) -> Result<(), String> {
    let path = folder.join(format!("output-{}.txt", std::process::id()));
    let output = File::create(&path).map_err(|why| format!("{}: {why}", path.display()))?;
    let errors = output.try_clone().map_err(|why| why.to_string())?;
    let mut child = cargo()
        .args(&form.arguments)
        .current_dir(folder)
        // Small forms need no speed: release builds without optimization compile faster.
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "1")
        .env("CARGO_PROFILE_RELEASE_LTO", "off")
        .env("CARGO_PROFILE_RELEASE_CODEGEN_UNITS", "16")
        .env("CARGO_PROFILE_RELEASE_DEBUG", "false")
        .env("INSTA_UPDATE", "no")
        .env_remove("KD_SCENES")
        .stdin(Stdio::null())
        .stdout(output)
        .stderr(errors)
        .spawn()
        .map_err(|why| format!("cannot start cargo: {why}"))?;
    let outcome = wait(&mut child, limit);
    let printed = fs::read(&path).unwrap_or_default();
    // The output of a command that failed is in the complaint.
    let _ = fs::remove_file(&path);
    outcome.map_err(|why| format!("{why}\n{}", last_lines(&String::from_utf8_lossy(&printed))))
}

/// Waits until a process ends, and stops it after the time given. Fails unless it ends with success.
fn wait(child: &mut Child, limit: Duration) -> Result<(), String> {
    let begin = Instant::now();
    loop {
        match child.try_wait().map_err(|why| why.to_string())? {
            Some(status) if status.success() => return Ok(()),
            Some(status) => return Err(status.to_string()),
            None if begin.elapsed() > limit => {
                let stopped = child.kill().and_then(|()| child.wait());
                stopped.map_err(|why| why.to_string())?;
                return Err(format!("stopped after {:.0} s", limit.as_secs_f64()));
            }
            None => thread::sleep(Duration::from_millis(20)),
        }
    }
}

fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let shown = lines.len().saturating_sub(SHOWN_LINES);
    let indented = lines[shown..].iter().map(|line| format!("    {line}"));
    indented.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tidy::commands::small_form::{Form, form_of};

    fn planned(line: &str, place: &str) -> Planned {
        let Ok(Form::Small(form)) = form_of(line) else {
            panic!("`{line}` has a small form");
        };
        let documented = vec![Documented {
            place: place.into(),
            line: line.into(),
        }];
        Planned { form, documented }
    }

    fn started(planned: Vec<Planned>, has_tools: bool) -> Vec<String> {
        let mut started = Vec::new();
        let mut start = |form: &SmallForm, _| {
            started.push(form.arguments.join(" "));
            Ok(())
        };
        let complaints = run_all(planned, &|_| has_tools, Duration::from_secs(60), &mut start);
        assert_eq!(complaints, [""; 0], "nothing fails");
        started
    }

    #[test]
    fn a_record_comes_before_what_reads_it() {
        let all = vec![
            planned("cargo xtask compare A B", "a.md:1"),
            planned("cargo xtask bench", "a.md:2"),
        ];
        let expected = [
            "xtask bench --samples 1 --smoke --out runs",
            "xtask compare runs/latest runs/latest",
        ];
        assert_eq!(started(all, true), expected);
    }

    #[test]
    fn without_embree_equal_forms_run_once() {
        let all = || {
            vec![
                planned("cargo xtask bench --peers", "a.md:1"),
                planned("cargo xtask bench", "a.md:2"),
                planned("cargo xtask rays", "a.md:3"),
            ]
        };
        assert_eq!(started(all(), true).len(), 3);
        let expected = ["xtask bench --samples 1 --smoke --out runs"];
        assert_eq!(started(all(), false), expected);
    }

    #[test]
    fn what_the_budget_leaves_out_is_named() {
        let all = vec![planned("cargo xtask bench", "a.md:2")];
        let mut start = |_: &SmallForm, _| panic!("no time is left");
        let complaints = run_all(all, &|_| true, Duration::ZERO, &mut start);
        assert_eq!(
            complaints,
            ["a.md:2: `cargo xtask bench` did not run: 0 minutes are spent"]
        );
    }

    #[cfg(unix)]
    #[test]
    fn a_command_that_does_not_end_is_stopped() {
        let mut endless = std::process::Command::new("sleep");
        let mut child = endless.arg("600").spawn().expect("every Unix has it");
        let stopped = wait(&mut child, Duration::ZERO);
        assert_eq!(stopped, Err("stopped after 0 s".into()));
    }
}
