//! Finds command lines in documents, comments and texts.

use std::fmt;

use crate::tidy::Document;
use crate::tidy::markdown::{fenced_code, spans};

/// Fenced code in these languages may hold command lines.
const SHELL: [&str; 5] = ["", "bash", "console", "sh", "text"];

/// A command line and where it is documented.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Documented {
    /// File and line: `docs/frames.md:12`.
    pub(super) place: String,
    /// The line without a prompt, variables before it and a comment behind it: `cargo xtask rays --scenes DIR`.
    pub(super) line: String,
}

impl fmt::Display for Documented {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: `{}`", self.place, self.line)
    }
}

/// All command lines: of documents, of sources before their unit tests, and of the help of `cargo xtask`. The changelog is
/// history and left out.
pub(super) fn collect(
    documents: &[Document],
    sources: &[Document],
    help: &[String],
) -> Vec<Documented> {
    let mut found = Vec::new();
    let mut add = |path: &str, candidates: Vec<(usize, String)>| {
        for (number, text) in candidates {
            if let Some(line) = command_line(&text).or_else(|| short_line(&text, help)) {
                let place = format!("{path}:{number}");
                found.push(Documented { place, line });
            }
        }
    };
    for document in documents.iter().filter(|d| d.path != "CHANGELOG.md") {
        add(&document.path, in_markdown(&document.text));
    }
    for source in sources {
        let code = before_tests(&source.text);
        add(&source.path, in_markdown(&comments(code)));
        add(&source.path, in_texts(code));
    }
    let calls = help.iter().filter_map(|line| command_line(line));
    found.extend(calls.map(|line| Documented {
        place: "help of xtask".into(),
        line,
    }));
    found
}

/// Texts that may be command lines: lines of fenced code and code spans. A span of two words (`cargo xtask`) names a program.
fn in_markdown(text: &str) -> Vec<(usize, String)> {
    let shell = fenced_code(text)
        .into_iter()
        .filter(|(_, language)| SHELL.contains(language))
        .map(|(line, _)| (line.number, line.text.to_owned()));
    let spans = spans(text).into_iter().filter(|(_, span)| !is_name(span));
    let mut lines: Vec<_> = shell.chain(spans).collect();
    lines.sort();
    lines
}

/// Code spans in the lines of a source that are no comments.
fn in_texts(code: &str) -> Vec<(usize, String)> {
    let is_code = |(_, line): &(usize, &str)| !line.trim_start().starts_with("//");
    let lines = (1..).zip(code.lines()).filter(is_code);
    let spans = lines.flat_map(|(number, line)| {
        let spans = line.split('`').skip(1).step_by(2);
        spans.map(move |span| (number, span.to_owned()))
    });
    spans.filter(|(_, span)| !is_name(span)).collect()
}

fn is_name(span: &str) -> bool {
    span.starts_with("cargo ") && span.split_whitespace().count() <= 2
}

/// `builds --growth` is short for `cargo xtask builds --growth`.
fn short_line(text: &str, help: &[String]) -> Option<String> {
    let (name, options) = text.split_once(' ')?;
    let call = format!("cargo xtask {name} ");
    let is_command = help.iter().any(|line| line.starts_with(&call));
    (is_command && options.starts_with("--")).then(|| format!("cargo xtask {text}"))
}

/// The command line in a text that is one, without brackets around what is optional. Patterns (`cargo xtask <command>`) and
/// programs other than cargo are none.
fn command_line(text: &str) -> Option<String> {
    let text = text.trim().trim_start_matches("$ ");
    let text = text.split(" # ").next().unwrap_or(text);
    let is_pattern = ["<", "...", "…", " | "]
        .iter()
        .any(|part| text.contains(part));
    let words = text.split_whitespace();
    // `INSTA_UPDATE=always cargo test -p kd`
    let is_variable = |word: &&str| {
        word.split_once('=')
            .is_some_and(|(name, _)| name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
    };
    let mut words: Vec<&str> = words.skip_while(is_variable).collect();
    if is_pattern || words.len() < 2 || words[0] != "cargo" {
        return None;
    }
    words.retain(|word| *word != "[OPTIONS]");
    let words = words.iter().map(|word| word.trim_matches(['[', ']']));
    Some(words.collect::<Vec<_>>().join(" "))
}

/// A source up to its unit tests, which have command lines that are wrong on purpose.
fn before_tests(source: &str) -> &str {
    let tests = source.find("#[cfg(test)]\nmod tests");
    tests.map_or(source, |start| &source[..start])
}

/// The comments of a source, line by line where they are in it.
fn comments(source: &str) -> String {
    let comment = |line: &str| {
        let line = line.trim_start().strip_prefix("//").unwrap_or_default();
        line.trim_start_matches(['/', '!']).to_owned()
    };
    source.lines().map(comment).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tidy::document;

    fn found(path: &str, text: &str) -> Vec<String> {
        let files = [document(path, text)];
        let is_source = path.ends_with("rs");
        let (documents, sources) = files.split_at(usize::from(!is_source));
        let found = collect(documents, sources, &[]);
        found
            .iter()
            .map(|d| format!("{}: {}", d.place, d.line))
            .collect()
    }

    #[test]
    fn spans_and_shell_blocks_of_documents_are_read() {
        let text = "# `cargo a --b` by `cargo a`\nin (`cargo c\n--d`, once)\n```text\n$ cargo e -- f     # why\n.ci/run\n```\n\
                    ```rust\ncargo g\n```\n| `V=1 cargo h -i` | `cargo` |\n";
        assert_eq!(
            found("README.md", text),
            [
                "README.md:1: cargo a --b",
                "README.md:2: cargo c --d",
                "README.md:5: cargo e -- f",
                "README.md:11: cargo h -i",
            ]
        );
    }

    #[test]
    fn comments_and_texts_of_sources_are_read_up_to_the_tests() {
        let text = "//! ```text\n//! cargo a [-- b.obj]\n//! ```\n\n/// By `cargo c\n/// d`.\nfn e() {\n    f(\"see `cargo g h`\");\n}\n\n\
                    #[cfg(test)]\nmod tests {\n    // `cargo i j`\n}\n";
        assert_eq!(
            found("xtask/src/a.rs", text),
            [
                "xtask/src/a.rs:2: cargo a -- b.obj",
                "xtask/src/a.rs:5: cargo c d",
                "xtask/src/a.rs:8: cargo g h",
            ]
        );
    }

    #[test]
    fn an_option_of_a_command_is_short_for_its_line() {
        let help = ["cargo xtask builds [OPTIONS]".to_owned()];
        let text = "`builds --growth`, `builds cells` and `trees --growth`";
        let found = collect(&[document("README.md", text)], &[], &help);
        let lines: Vec<&str> = found.iter().map(|found| found.line.as_str()).collect();
        assert_eq!(lines, ["cargo xtask builds --growth", "cargo xtask builds"]);
    }

    #[test]
    fn patterns_and_history_are_no_command_lines() {
        let patterns = "`cargo xtask <command>` `cargo ...` `cargo xtask a | b`";
        assert_eq!(found("README.md", patterns), [""; 0]);
        assert_eq!(found("CHANGELOG.md", "`cargo a b`"), [""; 0]);
    }
}
