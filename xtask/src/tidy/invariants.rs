//! Checks that each invariant has a checker: every row of the table under the heading "Invariants" in `docs/architecture.md` names in
//! its last column a test (`crate::module::name`), a file (`crates/kd/tests/oracle.rs`, or one like `clippy.toml` in the
//! root) or a command (`cargo ...`), and what it names exists. Other code in that column is part of the wording.

use super::Document;
use super::markdown::{Line, code_spans, prose};

const WHERE: &str = "docs/architecture.md";

/// Steps of `.ci/run` that may check an invariant.
const COMMANDS: [&str; 3] = ["clippy", "xtask tidy", "test --workspace"];

pub(super) fn check(
    documents: &[Document],
    sources: &[Document],
    exists: &dyn Fn(&str) -> bool,
) -> Vec<String> {
    let Some(document) = documents.iter().find(|document| document.path == WHERE) else {
        return vec![format!("{WHERE} does not exist")];
    };
    let rows = rows(&document.text);
    if rows.is_empty() {
        return vec![format!(
            "{WHERE} has no table under a heading \"Invariants\""
        )];
    }
    let mut complaints = Vec::new();
    for row in rows {
        let place = format!("{WHERE}:{}", row.number);
        let last_column = row.text.trim().trim_end_matches('|').rsplit('|').next();
        let mut checkers = 0;
        for span in code_spans(last_column.unwrap_or_default()) {
            let found = if let Some(command) = span.strip_prefix("cargo ") {
                COMMANDS.contains(&command)
            } else if span.contains("::") {
                test_exists(span, sources)
            } else if span.contains('/') || span.ends_with(".toml") {
                exists(span)
            } else {
                continue;
            };
            checkers += 1;
            if !found {
                complaints.push(format!("{place}: `{span}` does not exist"));
            }
        }
        if checkers == 0 {
            complaints.push(format!(
                "{place}: names no test, file or command that checks it"
            ));
        }
    }
    complaints
}

/// The rows of the table, without its head.
fn rows(text: &str) -> Vec<Line<'_>> {
    let is_heading = |line: &Line<'_>| line.text.starts_with('#');
    let is_row = |line: &Line<'_>| line.text.trim_start().starts_with('|');
    prose(text)
        .into_iter()
        .skip_while(|line| !(is_heading(line) && line.text.to_lowercase().contains("invariants")))
        .skip(1)
        .take_while(|line| !is_heading(line))
        .filter(is_row)
        .skip(2)
        .collect()
}

/// Whether `crate::module::name` is a test in that crate and in a file of that module (its first part).
fn test_exists(path: &str, sources: &[Document]) -> bool {
    let parts: Vec<&str> = path.split("::").collect();
    let [crate_name, modules @ .., name] = parts.as_slice() else {
        return false;
    };
    let crate_name = crate_name.replace('_', "-");
    let folder = match crate_name.as_str() {
        "kd-bench" => "benches/".to_owned(),
        "xtask" => "xtask/".to_owned(),
        _ => format!("crates/{crate_name}/"),
    };
    let module = modules.first().filter(|module| **module != "tests");
    sources.iter().any(|source| {
        let in_module = module.is_none_or(|module| {
            source.path.ends_with(&format!("/{module}.rs"))
                || source.path.contains(&format!("/{module}/"))
        });
        source.path.starts_with(&folder) && in_module && has_test(&source.text, name)
    })
}

/// Whether a function of that name has `#[test]` among its attributes.
fn has_test(source: &str, name: &str) -> bool {
    let Some((before, _)) = source.split_once(&format!("fn {name}(")) else {
        return false;
    };
    let attributes = before.rsplit("\n\n").next().unwrap_or(before);
    attributes.contains("#[test]")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tidy::document;

    fn complaints(table: &str) -> Vec<String> {
        let text = format!(
            "# Architecture\n## Invariants\n\n| rule | check |\n|---|---|\n{table}\n## Next\n| a | b |\n"
        );
        let sources = [
            document("crates/kd-core/src/node.rs", "#[test]\nfn packs() {}\n"),
            document(
                "crates/kd/tests/oracle.rs",
                "#[test]\nfn agrees() {}\n\nfn helps() {}\n",
            ),
        ];
        check(&[document(WHERE, &text)], &sources, &|path| {
            path == "crates/kd/tests/oracle.rs"
        })
    }

    #[test]
    fn rows_with_a_checker_pass() {
        let table = "| one | `kd_core::node::tests::packs` |\n| two | `crates/kd/tests/oracle.rs` |\n\
                     | three | `kd::oracle::agrees` and more |\n| four | `cargo xtask tidy`, `EDGES` |";
        assert_eq!(complaints(table), [""; 0], "each of them exists");
    }

    #[test]
    fn rows_without_one_are_named() {
        let table = "| one | `kd_core::node::tests::gone` |\n| two | `kd_core::tree::packs` |\n\
                     | three | trust me |\n| four | `crates/kd/tests/gone.rs` |\n\
                     | five | `kd::oracle::helps` |\n| six | `cargo hope` |";
        assert_eq!(
            complaints(table),
            [
                "docs/architecture.md:6: `kd_core::node::tests::gone` does not exist",
                "docs/architecture.md:7: `kd_core::tree::packs` does not exist",
                "docs/architecture.md:8: names no test, file or command that checks it",
                "docs/architecture.md:9: `crates/kd/tests/gone.rs` does not exist",
                "docs/architecture.md:10: `kd::oracle::helps` does not exist",
                "docs/architecture.md:11: `cargo hope` does not exist",
            ],
            "a missing test, one in another module, none at all, a missing file, no test, no such command"
        );
    }

    #[test]
    fn the_table_itself_must_be_there() {
        assert_eq!(
            check(&[], &[], &|_| true),
            ["docs/architecture.md does not exist"],
            "no file"
        );
        let without = [document(WHERE, "# Architecture\n")];
        assert_eq!(check(&without, &[], &|_| true).len(), 1, "no table");
    }
}
