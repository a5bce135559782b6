//! The header of a PLY file, in the one form that the parser of headers reads.

/// The byte order mark that some editors write before UTF-8 text.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();
const END: &[u8] = b"end_header";

/// A header without comments, blank lines and blanks around lines.
pub(super) struct PlainHeader<'a> {
    /// Lines that end in `\n`.
    pub(super) text: Vec<u8>,
    /// The number of each line of `text` in the file, from 1, and how the file has it.
    originals: Vec<(usize, &'a [u8])>,
    /// The number of lines up to `end_header`.
    pub(super) lines: usize,
    /// Whether `end_header` is there.
    pub(super) has_end: bool,
    /// What follows the header.
    pub(super) data: &'a [u8],
}

impl<'a> PlainHeader<'a> {
    pub(super) fn of(bytes: &'a [u8]) -> Self {
        let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        let mut plain = Self {
            text: Vec::new(),
            originals: Vec::new(),
            lines: 0,
            has_end: false,
            data: bytes,
        };
        let mut ends_in_cr = false;
        while !plain.data.is_empty() && !plain.has_end {
            let (line, rest) = first_line(plain.data);
            let end = plain.data.len() - line.len() - rest.len();
            // Where lines end in `\r`, the `\n` after the last one is data.
            let is_data = end == 2 && plain.lines > 0 && ends_in_cr;
            ends_in_cr = end == 1 && plain.data[line.len()] == b'\r';
            plain.data = if is_data {
                &plain.data[line.len() + 1..]
            } else {
                rest
            };
            plain.lines += 1;
            let line = line.trim_ascii();
            let is_comment = [&b"comment"[..], b"obj_info"].iter().any(|word| {
                let after = line.strip_prefix(*word);
                after.is_some_and(|after| after.first().is_none_or(u8::is_ascii_whitespace))
            });
            if line.is_empty() || is_comment {
                continue;
            }
            plain.originals.push((plain.lines, line));
            plain.text.extend_from_slice(line);
            plain.text.push(b'\n');
            plain.has_end = line == END;
            // A file of another kind has no header; it may be long.
            if plain.lines == 1 && line != b"ply" {
                break;
            }
        }
        plain
    }

    /// The number of a line of `text` in the file, and how the file has it.
    pub(super) fn original(&self, line: usize) -> Option<(usize, &'a [u8])> {
        self.originals.get(line.checked_sub(1)?).copied()
    }
}

/// The first line of a text without its end, which is `\n`, `\r\n` or `\r`, and what follows.
pub(super) fn first_line(text: &[u8]) -> (&[u8], &[u8]) {
    let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
    let Some(end) = text.iter().position(is_end) else {
        return (text, &[]);
    };
    let after = if text[end..].starts_with(b"\r\n") {
        end + 2
    } else {
        end + 1
    };
    (&text[..end], &text[after..])
}
