//! Checks that the documents name the oldest Rust that compiles the workspace, and no other.

use serde_json::Value;

use super::Document;
use super::markdown::prose;

/// Compares every version in the documents with the `rust-version` of the packages. Two kinds are left out: the changelog, which is
/// history, and `rustc 1.x`, which names the compiler of a measurement.
pub(super) fn check(documents: &[Document], metadata: &Value) -> Vec<String> {
    let none = Vec::new();
    let packages = metadata["packages"].as_array().unwrap_or(&none);
    let Some(wanted) = packages.first().and_then(|p| p["rust_version"].as_str()) else {
        return vec!["the workspace names no rust-version".into()];
    };
    let mut complaints = Vec::new();
    for package in packages {
        if package["rust_version"].as_str() != Some(wanted) {
            complaints.push(format!(
                "{} differs from the workspace in its rust-version",
                package["name"]
            ));
        }
    }
    for document in documents.iter().filter(|d| d.path != "CHANGELOG.md") {
        for line in prose(&document.text) {
            for found in versions(line.text)
                .into_iter()
                .filter(|found| *found != wanted)
            {
                let place = format!("{}:{}", document.path, line.number);
                complaints.push(format!(
                    "{place}: names Rust {found}, the workspace {wanted}"
                ));
            }
        }
    }
    complaints
}

/// Rust versions in a line: each after `Rust `, and every `1.x` of a line about the required version.
fn versions(line: &str) -> Vec<&str> {
    let everywhere = ["MSRV", "rust-version", "Rust version"]
        .iter()
        .any(|words| line.contains(words));
    let mut found = Vec::new();
    for (start, _) in line.match_indices("1.") {
        let before = &line[..start];
        if before.ends_with(|c: char| c.is_ascii_digit() || c == '.') {
            continue;
        }
        let end = line[start + 2..]
            .find(|c: char| !c.is_ascii_digit())
            .map_or(line.len(), |length| start + 2 + length);
        if end > start + 2 && (everywhere || before.ends_with("Rust ")) {
            found.push(&line[start..end]);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::tidy::document;

    #[test]
    fn versions_must_be_that_of_the_workspace() {
        let metadata = json!({"packages": [{"name": "kd", "rust_version": "1.89"}]});
        let documents = [
            document(
                "README.md",
                "Needs Rust 1.89 or later.\nMeasured with rustc 1.95, 21.5 ms.\n",
            ),
            document(
                "docs/a.md",
                "MSRV: **1.88**\nRust 1.90 is fine\nThe oldest Rust version is 1.87.\n",
            ),
            document("CHANGELOG.md", "- MSRV is now 1.80\n"),
        ];
        assert_eq!(
            check(&documents, &metadata),
            [
                "docs/a.md:1: names Rust 1.88, the workspace 1.89",
                "docs/a.md:2: names Rust 1.90, the workspace 1.89",
                "docs/a.md:3: names Rust 1.87, the workspace 1.89",
            ],
            "the README is right, the compiler of a measurement and history do not count"
        );
    }

    #[test]
    fn packages_agree_on_one_version() {
        let packages = json!([
            {"name": "kd", "rust_version": "1.89"},
            {"name": "kd-core", "rust_version": "1.90"},
        ]);
        let complaints = check(&[], &json!({ "packages": packages }));
        assert_eq!(
            complaints,
            ["\"kd-core\" differs from the workspace in its rust-version"],
            "{complaints:?}"
        );
        assert_eq!(
            check(&[], &json!({"packages": []})).len(),
            1,
            "no version is a complaint"
        );
    }
}
