//! As much of Markdown as the rules need: fenced code, code spans, links and headings.

/// One line outside fenced code, with its number from 1.
pub(super) struct Line<'a> {
    pub(super) number: usize,
    pub(super) text: &'a str,
}

/// What a line of a document belongs to.
enum Part<'a> {
    Prose,
    /// The line that opens fenced code, with the language tag.
    Fence(&'a str),
    /// A line of fenced code in that language.
    Code(&'a str),
    /// The line that closes fenced code.
    End,
}

/// Every line with what it belongs to.
fn parts(text: &str) -> impl Iterator<Item = (Line<'_>, Part<'_>)> {
    let mut open: Option<(&str, &str)> = None;
    text.lines().enumerate().map(move |(index, text)| {
        let line = Line {
            number: index + 1,
            text,
        };
        let part = match (open, opening_fence(text)) {
            (None, Some(marker)) => {
                let language = text.trim_start().trim_start_matches(['`', '~']).trim();
                open = Some((marker, language));
                Part::Fence(language)
            }
            (None, None) => Part::Prose,
            (Some((marker, _)), _) if closes(text, marker) => {
                open = None;
                Part::End
            }
            (Some((_, language)), _) => Part::Code(language),
        };
        (line, part)
    })
}

/// The lines that are prose: everything but fenced code.
pub(super) fn prose(text: &str) -> Vec<Line<'_>> {
    let of_prose = |(line, part)| matches!(part, Part::Prose).then_some(line);
    parts(text).filter_map(of_prose).collect()
}

/// The lines of fenced code, each with the language tag of its block.
pub(super) fn fenced_code(text: &str) -> Vec<(Line<'_>, &str)> {
    let of_code = |(line, part)| match part {
        Part::Code(language) => Some((line, language)),
        _ => None,
    };
    parts(text).filter_map(of_code).collect()
}

/// The language tags of all fenced blocks.
pub(super) fn fence_languages(text: &str) -> Vec<&str> {
    let of_fence = |(_, part)| match part {
        Part::Fence(language) => Some(language),
        _ => None,
    };
    parts(text).filter_map(of_fence).collect()
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

/// The code spans of the prose, each with the number of the line on which it starts and with spaces for line ends. A span may
/// continue on the next line of its paragraph.
pub(super) fn spans(text: &str) -> Vec<(usize, String)> {
    let mut paragraphs: Vec<Vec<Line<'_>>> = vec![Vec::new()];
    let mut last = 0;
    for line in prose(text) {
        if line.number != last + 1 || line.text.trim().is_empty() {
            paragraphs.push(Vec::new());
        }
        last = line.number;
        paragraphs.last_mut().expect("never empty").push(line);
    }
    paragraphs
        .iter()
        .flat_map(|lines| spans_of_paragraph(lines))
        .collect()
}

fn spans_of_paragraph(lines: &[Line<'_>]) -> Vec<(usize, String)> {
    let mut spans: Vec<(usize, String)> = Vec::new();
    let mut is_open = false;
    for line in lines {
        for (index, piece) in line.text.split('`').enumerate() {
            let is_continued = index == 0;
            if !is_continued {
                is_open = !is_open;
            }
            if is_open && is_continued {
                let (_, span) = spans.last_mut().expect("opened on a line before");
                *span = format!("{} {}", span.trim_end(), piece.trim());
            } else if is_open {
                spans.push((line.number, piece.to_owned()));
            }
        }
    }
    spans
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

/// The anchors of the headings of a document, by the rules of GitHub.
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
    fn lines_of_fenced_code_know_their_language() {
        let text = "one\n```sh\nls\n```\n```\nplain\n```\n";
        let lines: Vec<(usize, &str, &str)> = fenced_code(text)
            .iter()
            .map(|(line, language)| (line.number, line.text, *language))
            .collect();
        assert_eq!(lines, [(3, "ls", "sh"), (6, "plain", "")]);
    }

    #[test]
    fn spans_end_with_their_paragraph_and_not_with_their_line() {
        let text = "run `cargo a\n  --b` and `c`\n\na ` alone\n\n`d`\n```\n`e`\n```\n";
        let expected = [(1, "cargo a --b"), (2, "c"), (4, " alone"), (6, "d")];
        assert_eq!(
            spans(text),
            expected.map(|(line, span)| (line, span.to_owned()))
        );
    }

    #[test]
    fn links_are_not_code_spans() {
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
