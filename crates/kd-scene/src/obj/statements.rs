//! The statements of OBJ and MTL files.

/// The byte order mark that some editors write before UTF-8 text.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The statements of a file: lines without comments, with continued lines joined.
pub(super) struct Statements<'a> {
    rest: &'a [u8],
    /// Number of lines taken: the line number of the end of the current statement.
    lines: usize,
}

impl<'a> Statements<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes),
            lines: 0,
        }
    }

    /// Writes the next statement to `into`, and returns the number of its first line, from 1.
    pub(super) fn next_into(&mut self, into: &mut Vec<u8>) -> Option<usize> {
        into.clear();
        let first = self.lines + 1;
        while !self.rest.is_empty() {
            self.lines += 1;
            let end = self.rest.iter().position(|&byte| byte == b'\n');
            let line;
            (line, self.rest) = match end {
                Some(end) => (&self.rest[..end], &self.rest[end + 1..]),
                None => (self.rest, &[][..]),
            };
            let text = line.split(|&byte| byte == b'#').next().unwrap_or(line);
            let text = text.trim_ascii_end();
            let Some(broken) = text.strip_suffix(b"\\") else {
                into.extend_from_slice(text);
                return Some(first);
            };
            into.extend_from_slice(broken);
            into.push(b' ');
        }
        (self.lines >= first).then_some(first)
    }
}

/// The words of a statement.
pub(super) fn words(statement: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    statement
        .split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
}

/// The text of a statement after its first word.
#[cfg(feature = "scenes")]
pub(super) fn rest(statement: &[u8], word: &str) -> String {
    let text = statement.trim_ascii();
    let text = text.strip_prefix(word.as_bytes()).unwrap_or(text);
    String::from_utf8_lossy(text.trim_ascii()).into_owned()
}

/// A number; `None` for any other word.
pub(super) fn number(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}
