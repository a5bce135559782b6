//! Checks that Rust in the documents is compiled: the facade includes every document with Rust in it as a doc test.

use super::Document;
use super::markdown::fence_languages;

/// Where the documents are included, under `#[cfg(doctest)]`.
const INCLUDED_BY: &str = "crates/kd/src/lib.rs";

pub(super) fn check(documents: &[Document], sources: &[Document]) -> Vec<String> {
    let facade = sources.iter().find(|source| source.path == INCLUDED_BY);
    let including = facade.map_or("", |source| source.text.as_str());
    let mut complaints = Vec::new();
    for Document { path, text } in documents {
        let is_rust = |language: &&str| *language == "rust" || language.starts_with("rust,");
        let has_rust = fence_languages(text).iter().any(is_rust);
        if has_rust && !including.contains(&format!("include_str!(\"../../../{path}\")")) {
            complaints.push(format!(
                "{path} has Rust in it, but {INCLUDED_BY} does not include it"
            ));
        }
    }
    complaints
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tidy::document;

    #[test]
    fn a_document_with_rust_must_be_included() {
        let documents = [
            document("README.md", "```rust\nlet x = 1;\n```\n"),
            document("docs/a.md", "```rust,no_run\nlet x = 1;\n```\n"),
            document("docs/b.md", "```text\nnothing\n```\n"),
        ];
        let lib =
            "#[cfg(doctest)]\n#[doc = include_str!(\"../../../README.md\")]\nstruct Readme;\n";
        assert_eq!(
            check(&documents, &[document(INCLUDED_BY, lib)]),
            ["docs/a.md has Rust in it, but crates/kd/src/lib.rs does not include it"],
            "the README is included, the text block needs nothing"
        );
    }
}
