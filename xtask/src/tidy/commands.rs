//! Every command line in the documents and in the comments and texts of the sources is one that runs.
//!
//! `cargo xtask tidy` maps each to a small form; `cargo xtask tidy --run-commands` runs the small forms, each once.

mod collect;
mod inputs;
mod run;
mod small_form;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::Duration;

use self::collect::{Documented, collect};
use self::small_form::{Form, SmallForm, form_of};
use super::Document;

/// All small forms together must end within this time, compilation included.
const BUDGET: Duration = Duration::from_secs(25 * 60);

/// A step of `.ci/run` may take the place of a small form.
const CHECKS: &str = ".ci/run";

/// A small form with the command lines that it stands for.
#[derive(Debug)]
struct Planned {
    form: SmallForm,
    documented: Vec<Documented>,
}

/// Complains of command lines that have no small form. `help` holds the commands of `cargo xtask` as its help prints them, and
/// `checks` the text of `.ci/run`.
pub(super) fn check(
    documents: &[Document],
    sources: &[Document],
    help: &[String],
    checks: &str,
) -> Vec<String> {
    plan(documents, sources, help, checks).1
}

/// The small forms, and complaints of command lines that have none.
fn plan(
    documents: &[Document],
    sources: &[Document],
    help: &[String],
    checks: &str,
) -> (Vec<Planned>, Vec<String>) {
    let mut forms: BTreeMap<SmallForm, Vec<Documented>> = BTreeMap::new();
    let mut complaints = Vec::new();
    for documented in collect(documents, sources, help) {
        match form_of(&documented.line) {
            Ok(Form::Small(form)) => forms.entry(form).or_default().push(documented),
            Ok(Form::NotRun(_)) => {}
            Ok(Form::StepOfChecks(step)) if checks.contains(step) => {}
            Ok(Form::StepOfChecks(step)) => {
                complaints.push(format!("{documented}: {CHECKS} has no step `{step}`"));
            }
            Err(why) => complaints.push(format!("{documented}: {why}")),
        }
    }
    let planned = forms
        .into_iter()
        .map(|(form, documented)| Planned { form, documented });
    (planned.collect(), complaints)
}

/// Runs every small form in a folder of generated scenes and complains of each that fails. Forms that need a tool that is not
/// installed do not run, and the output names them.
pub(super) fn run(
    root: &Path,
    documents: &[Document],
    sources: &[Document],
    help: &[String],
    checks: &str,
) -> Result<Vec<String>, String> {
    let (planned, _) = plan(documents, sources, help, checks);
    // Inside the workspace, so that cargo finds it.
    let folder = root.join("target").join("documented");
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(|why| format!("{}: {why}", folder.display()))?;
    }
    inputs::write(&folder, planned.iter().map(|planned| &planned.form))?;
    let mut start = |form: &SmallForm, limit| run::start(form, &folder, limit);
    Ok(run::run_all(
        planned,
        &run::is_installed,
        BUDGET,
        &mut start,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tidy::document;

    #[test]
    fn a_command_line_without_a_small_form_is_named_with_its_file_and_line() {
        let documents = [document(
            "docs/a.md",
            "Run `cargo xtask bench`.\n```text\ncargo xtask benhc --smoke\n```\n`cargo test --workspace`\n",
        )];
        let complaints = check(&documents, &[], &[], "cargo test --workspace");
        assert_eq!(
            complaints,
            ["docs/a.md:3: `cargo xtask benhc --smoke`: `cargo xtask` has no command `benhc`"]
        );
        let complaints = check(&documents[..], &[], &[], "cargo fmt");
        assert_eq!(
            complaints.last().map(String::as_str),
            Some(
                "docs/a.md:5: `cargo test --workspace`: .ci/run has no step `cargo test --workspace`"
            ),
        );
    }

    #[test]
    fn a_command_that_fails_is_named_with_its_file_and_line() {
        let documents = [document(
            "docs/a.md",
            "See\n`cargo doc -p kd-no-such-crate`\nand `cargo xtask bench`.\n\n`cargo doc -p kd-no-such-crate --open`\n",
        )];
        let (planned, complaints) = plan(&documents, &[], &[], "");
        assert_eq!(complaints, [""; 0], "both have small forms");
        let folder = std::env::temp_dir();
        let mut start = |form: &SmallForm, limit| {
            if form.arguments[0] == "xtask" {
                return Ok(());
            }
            run::start(form, &folder, limit)
        };
        let complaints = run::run_all(planned, &|_| true, BUDGET, &mut start);
        let [complaint] = complaints.as_slice() else {
            panic!("one form fails: {complaints:?}");
        };
        assert!(
            complaint.starts_with(
                "docs/a.md:2: `cargo doc -p kd-no-such-crate` (and docs/a.md:5) fails as \
                 `cargo doc -p kd-no-such-crate --no-deps`: exit status: 101\n"
            ),
            "{complaint}"
        );
        // The text between may have colors.
        assert!(
            complaint.contains("error") && complaint.contains("could not find"),
            "ends with the output: {complaint}"
        );
    }
}
