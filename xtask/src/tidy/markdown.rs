//! As much of Markdown as the rules need: fenced code, code spans, links and headings.

/// One line outside fenced code, with its number from 1.
pub(super) struct Line<'a> {
    pub(super) number: usize,
    pub(super) text: &'a str,
}

/// The lines that are prose: everything but fenced code.
pub(super) fn prose(text: &str) -> Vec<Line<'_>> {
    let mut fence = None;
    let mut lines = Vec::new();
    for (index, text) in text.lines().enumerate() {
        match (fence, opening_fence(text)) {
            (None, Some(marker)) => fence = Some(marker),
            (None, None) => lines.push(Line {
                number: index + 1,
                text,
            }),
            (Some(open), _) if closes(text, open) => fence = None,
            _ => {}
        }
    }
    lines
}

/// The language tags of all fenced blocks.
pub(super) fn fence_languages(text: &str) -> Vec<&str> {
    let mut fence = None;
    let mut languages = Vec::new();
    for line in text.lines() {
        match (fence, opening_fence(line)) {
            (None, Some(marker)) => {
                fence = Some(marker);
                languages.push(line.trim_start().trim_start_matches(['`', '~']).trim());
            }
            (Some(open), _) if closes(line, open) => fence = None,
            _ => {}
        }
    }
    languages
}

/// The run of backticks or tildes that opens fenced code.
fn opening_fence(line: &str) -> Option<&str> {
    let line = line.trim_start();
    ['`', '~'].into_iter().find_map(|mark| {
        let length = line.len() - line.trim_start_matches(mark).len();
        (length >= 3 && !line[length..].contains('`')).then(|| &line[..length])
    })
}

fn closes(line: &str, open: &str) -> bool {
    let line = line.trim();
    line.starts_with(open)
        && line
            .trim_matches(open.chars().next().unwrap_or('`'))
            .is_empty()
}

/// The contents of the code spans of a line.
pub(super) fn code_spans(line: &str) -> Vec<&str> {
    line.split('`').skip(1).step_by(2).collect()
}

/// The targets of the links and images of a line, `[text](target)`, outside code spans.
pub(super) fn link_targets(line: &str) -> Vec<String> {
    let without_code: String = line.split('`').step_by(2).collect();
    let mut targets = Vec::new();
    for after in without_code.split("](").skip(1) {
        if let Some(end) = after.find([')', ' ']) {
            targets.push(after[..end].to_owned());
        }
    }
    targets
}

/// The anchors that the headings of a document get, as GitHub makes them.
pub(super) fn anchors(text: &str) -> Vec<String> {
    let mut anchors: Vec<String> = Vec::new();
    for line in prose(text) {
        let title = line.text.trim_start_matches('#');
        if title.len() == line.text.len() || !title.starts_with(' ') {
            continue;
        }
        let plain: String = title
            .trim()
            .to_lowercase()
            .chars()
            .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
            .map(|c| if c == ' ' { '-' } else { c })
            .collect();
        let earlier = anchors.iter().filter(|a| **a == plain).count();
        anchors.push(if earlier == 0 {
            plain
        } else {
            format!("{plain}-{earlier}")
        });
    }
    anchors
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fenced_code_is_not_prose() {
        let text = "one\n```rust\n# not a heading\n```\ntwo\n~~~~text\n~~~\n~~~~\nthree";
        let lines: Vec<(usize, &str)> = prose(text).iter().map(|l| (l.number, l.text)).collect();
        assert_eq!(
            lines,
            [(1, "one"), (5, "two"), (9, "three")],
            "line numbers are those of the file"
        );
        assert_eq!(
            fence_languages(text),
            ["rust", "text"],
            "both kinds of fences"
        );
    }

    #[test]
    fn links_and_code_spans_are_told_apart() {
        let line = "see [a](b.md#c), `[x](y)` and ![i](p.png \"title\")";
        assert_eq!(
            link_targets(line),
            ["b.md#c", "p.png"],
            "code is not a link"
        );
        assert_eq!(code_spans(line), ["[x](y)"], "one span");
    }

    #[test]
    fn headings_become_anchors() {
        let text = "# The `kd` tree, in 8 bytes\n## Why?\n## Why?\n#not-a-heading\n";
        assert_eq!(
            anchors(text),
            ["the-kd-tree-in-8-bytes", "why", "why-1"],
            "lower case, punctuation dropped, repeats numbered"
        );
    }
}
