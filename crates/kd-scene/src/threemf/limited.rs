//! A reader for the text of archives, which may inflate to a thousand times their size.

use std::io::{self, Read};

/// Reads XML up to a number of bytes, of which no element and no text has more than [`LONGEST`](Self::LONGEST).
pub(super) struct Limited<R> {
    reader: R,
    left: u64,
    /// Bytes since the last bracket.
    since_bracket: usize,
}

impl<R> Limited<R> {
    /// A parser of XML holds an element, or the text between two, in memory.
    const LONGEST: usize = 1 << 24;

    pub(super) fn new(reader: R, most: u64) -> Self {
        Self {
            reader,
            left: most,
            since_bracket: 0,
        }
    }
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let count = self.reader.read(to)?;
        let too_long = |what: &str| Err(io::Error::new(io::ErrorKind::InvalidData, what));
        match self.left.checked_sub(count as u64) {
            Some(left) => self.left = left,
            None => {
                return too_long("the text of the model is too long for the size of the archive");
            }
        }
        let read = &to[..count];
        self.since_bracket = match memchr::memrchr2(b'<', b'>', read) {
            Some(last) => count - last,
            None => self.since_bracket + count,
        };
        if self.since_bracket > Self::LONGEST {
            return too_long("an element or a text is longer than 16 MB");
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_errors() {
        let read = |text: &[u8], most| {
            let mut to = Vec::new();
            Limited::new(text, most)
                .read_to_end(&mut to)
                .map(|_| to.len())
        };
        assert_eq!(read(b"<a>text</a>", 11).ok(), Some(11));
        assert!(read(b"<a>text</a>", 10).is_err(), "more than the limit");
        let long = vec![b' '; (1 << 24) + 1];
        assert!(read(&long, u64::MAX).is_err(), "without a bracket");
        let elements = b"<a/>    ".repeat(1 << 22);
        assert!(read(&elements, u64::MAX).is_ok(), "many short ones");
    }
}
