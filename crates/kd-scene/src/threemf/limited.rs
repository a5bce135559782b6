//! A reader for the text of archives, which may inflate to a thousand times their size.

use std::io::{self, Read};

/// Reads up to a number of bytes. A parser of XML may hold all of them in memory, as one comment.
pub(super) struct Limited<R> {
    reader: R,
    left: u64,
}

impl<R> Limited<R> {
    pub(super) fn new(reader: R, most: u64) -> Self {
        Self { reader, left: most }
    }
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let count = self.reader.read(to)?;
        let left = self.left.checked_sub(count as u64);
        let too_long = "the text of the model is too long for the size of the archive";
        self.left = left.ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, too_long))?;
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
    }
}
