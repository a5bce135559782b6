//! The lines of a text that are neither blank nor comments, and their words one after the other.

use std::ops::Range;

use crate::LoadError;
use crate::source::Source;
use crate::words::first_word;

/// The line of a text that was taken last.
#[derive(Debug)]
pub(crate) struct TextLines {
    /// Its number, from 1.
    pub(crate) number: usize,
    /// Its text, without blanks at its ends and without its comment.
    pub(crate) text: Vec<u8>,
    /// How much of it is read.
    at: usize,
    /// What begins a comment.
    comment: Option<u8>,
}

impl TextLines {
    /// The lines after the first `lines`.
    pub(crate) fn new(lines: usize, comment: Option<u8>) -> Self {
        Self {
            number: lines,
            text: Vec::new(),
            at: 0,
            comment,
        }
    }

    /// Takes the next line. Returns whether there is one.
    pub(crate) fn next(&mut self, source: &mut Source<'_>) -> Result<bool, LoadError> {
        while let Some((line, _)) = source.line()? {
            self.number += 1;
            let line = source.text(line);
            let comment = self
                .comment
                .and_then(|comment| memchr::memchr(comment, line));
            let line = line[..comment.unwrap_or(line.len())].trim_ascii();
            if !line.is_empty() {
                self.text.clear();
                self.text.extend_from_slice(line);
                self.at = 0;
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Skips the first `count` bytes of the line.
    pub(crate) fn skip(&mut self, count: usize) {
        self.at = count.min(self.text.len());
    }

    /// The place in the text of the next word of the line.
    #[inline]
    pub(crate) fn word(&mut self) -> Option<Range<usize>> {
        let word = first_word(&self.text[self.at..])?;
        let word = self.at + word.start..self.at + word.end;
        self.at = word.end;
        Some(word)
    }
}
