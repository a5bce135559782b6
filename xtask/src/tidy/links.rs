//! Checks that the targets of relative links, their anchors and the file paths in code spans exist.

use super::Document;
use super::markdown::{anchors, code_spans, link_targets, prose};

/// A code span that starts with one of these is a path in this repository.
const FOLDERS: &[&str] = &[
    ".ci/",
    ".github/",
    "benches/",
    "crates/",
    "docs/",
    "fuzz/",
    "python/",
    "testdata/",
    "xtask/",
];

pub(super) fn check(documents: &[Document], exists: &dyn Fn(&str) -> bool) -> Vec<String> {
    let mut complaints = Vec::new();
    for document in documents {
        for line in prose(&document.text) {
            let place = format!("{}:{}", document.path, line.number);
            for target in link_targets(line.text) {
                if let Some(what) = broken_link(document, &target, documents, exists) {
                    complaints.push(format!("{place}: {what}"));
                }
            }
            for span in code_spans(line.text) {
                let is_path = FOLDERS.iter().any(|folder| span.starts_with(folder))
                    && span
                        .chars()
                        .all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c));
                if is_path && !exists(span) {
                    complaints.push(format!("{place}: `{span}` does not exist"));
                }
            }
        }
    }
    complaints
}

fn broken_link(
    from: &Document,
    target: &str,
    documents: &[Document],
    exists: &dyn Fn(&str) -> bool,
) -> Option<String> {
    if target.contains("://") || target.starts_with("mailto:") {
        return None;
    }
    let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
    let path = if path.is_empty() {
        from.path.clone()
    } else {
        beside(&from.path, path)
    };
    if !exists(&path) {
        return Some(format!(
            "the target of the link to `{target}` does not exist"
        ));
    }
    let known = documents.iter().find(|document| document.path == path)?;
    let found = anchor.is_empty() || anchors(&known.text).iter().any(|a| a == anchor);
    (!found).then(|| format!("`{path}` has no heading `#{anchor}`"))
}

/// The path that a relative link in `file` means.
fn beside(file: &str, link: &str) -> String {
    let mut parts: Vec<&str> = file.split('/').collect();
    parts.pop();
    for part in link.split('/') {
        match part {
            "." | "" => {}
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tidy::document;

    fn complaints(text: &str) -> Vec<String> {
        let documents = [
            document("docs/a.md", text),
            document("README.md", "# Top\n## Where to start\n"),
        ];
        let exists =
            |path: &str| ["docs/a.md", "README.md", "crates/kd/src/lib.rs"].contains(&path);
        check(&documents, &exists)
    }

    #[test]
    fn good_links_pass() {
        let text = "# Here\n[up](../README.md#where-to-start) [here](#here) [web](https://example.org/x#y)\n\
                    `crates/kd/src/lib.rs` `cargo test` `crates/*/src`\n```\n[no](link.md)\n```\n";
        assert_eq!(complaints(text), [""; 0], "all of them exist");
    }

    #[test]
    fn broken_links_paths_and_anchors_are_named() {
        let text = "[a](missing.md)\n\n[b](../README.md#nothing) [c](#gone)\nsee `crates/kd/src/gone.rs`\n";
        assert_eq!(
            complaints(text),
            [
                "docs/a.md:1: the target of the link to `missing.md` does not exist",
                "docs/a.md:3: `README.md` has no heading `#nothing`",
                "docs/a.md:3: `docs/a.md` has no heading `#gone`",
                "docs/a.md:4: `crates/kd/src/gone.rs` does not exist",
            ],
            "with file and line"
        );
    }
}
