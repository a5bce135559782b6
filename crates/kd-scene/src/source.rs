//! The bytes of a file, read piece by piece.

use std::fs::File;
use std::io::{self, Read};
use std::ops::Range;
use std::path::Path;

use memchr::memchr2;

use crate::LoadError;
#[cfg(any(test, feature = "scenes"))]
use crate::memory::check_room;

/// The byte order mark that some editors write before UTF-8 text.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// How many bytes are read at once: a piece stays in the cache until it is used.
const PIECE: usize = 1 << 18;

/// Receives how many bytes of a file are read, and how many it has.
pub(crate) type OnProgress<'a> = &'a dyn Fn(u64, u64);

/// A file from its start on. Only the bytes that are not taken yet are in memory.
pub(crate) struct Source<'a> {
    /// The name for errors.
    pub(crate) name: &'a str,
    reader: Box<dyn Read + 'a>,
    /// The number of bytes of the file, if it is known.
    length: Option<u64>,
    on_progress: Option<OnProgress<'a>>,
    /// The bytes from `start` to `end` are read, but not taken.
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    is_at_end: bool,
    /// The number of bytes read.
    read: u64,
}

/// How a line ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LineEnd {
    LineFeed,
    CarriageReturn,
    Both,
    /// The end of the file.
    None,
}

impl<'a> Source<'a> {
    pub(crate) fn new(reader: impl Read + 'a, length: Option<u64>, name: &'a str) -> Self {
        Self {
            name,
            reader: Box::new(reader),
            length,
            on_progress: None,
            buffer: Vec::new(),
            start: 0,
            end: 0,
            is_at_end: false,
            read: 0,
        }
    }

    #[cfg(any(test, feature = "scenes"))]
    pub(crate) fn of_bytes(bytes: &'a [u8], name: &'a str) -> Self {
        Self::new(bytes, Some(bytes.len() as u64), name)
    }

    pub(crate) fn open(
        path: &Path,
        name: &'a str,
        on_progress: Option<OnProgress<'a>>,
    ) -> Result<Self, LoadError> {
        let opened = File::open(path).and_then(|file| {
            let data = file.metadata()?;
            if data.is_dir() {
                return Err(io::ErrorKind::IsADirectory.into());
            }
            // The length of a pipe is not known.
            Ok((file, data.is_file().then_some(data.len())))
        });
        let (file, length) = opened.map_err(|source| LoadError::Open {
            file: name.to_owned(),
            source,
        })?;
        Ok(Self {
            on_progress,
            ..Self::new(file, length, name)
        })
    }

    /// The number of bytes of the file, if it is known.
    pub(crate) fn length(&self) -> Option<u64> {
        self.length
    }

    /// The most elements of `size` bytes that the rest of the file can have; 0 if its length is not known.
    pub(crate) fn room_for(&self, size: usize) -> usize {
        let taken = self.read - (self.end - self.start) as u64;
        let rest = self.length.unwrap_or(0).saturating_sub(taken);
        usize::try_from(rest / size.max(1) as u64).unwrap_or(usize::MAX)
    }

    /// The bytes that come next, without taking them: at least `count`, unless the file ends before.
    pub(crate) fn at_least(&mut self, count: usize) -> Result<&[u8], LoadError> {
        while self.end - self.start < count && !self.is_at_end {
            self.fill(count)?;
        }
        Ok(&self.buffer[self.start..self.end])
    }

    /// Reads one piece. `count` bytes are needed in all.
    fn fill(&mut self, count: usize) -> Result<(), LoadError> {
        if self.buffer.len() - self.end < PIECE / 2 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
            if self.buffer.len() - self.end < PIECE / 2 {
                // The claim of a file reserves nothing: the buffer grows with what is there.
                let needed = (2 * self.end).min(count.saturating_add(PIECE));
                self.buffer.resize(needed.max(self.end + PIECE), 0);
            }
        }
        let read = loop {
            match self.reader.read(&mut self.buffer[self.end..]) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                other => break other,
            }
        };
        let read = read.map_err(|source| LoadError::Read {
            file: self.name.to_owned(),
            source,
        })?;
        self.end += read;
        self.is_at_end = read == 0;
        self.read += read as u64;
        if let (Some(on_progress), Some(length)) = (self.on_progress, self.length) {
            on_progress(self.read, length);
        }
        Ok(())
    }

    /// Takes bytes that [`at_least`](Self::at_least) has returned.
    pub(crate) fn take(&mut self, count: usize) {
        self.start += count;
        debug_assert!(self.start <= self.end, "no more than there are");
    }

    /// Takes a byte order mark.
    pub(crate) fn take_byte_order_mark(&mut self) -> Result<(), LoadError> {
        if self
            .at_least(BYTE_ORDER_MARK.len())?
            .starts_with(BYTE_ORDER_MARK)
        {
            self.take(BYTE_ORDER_MARK.len());
        }
        Ok(())
    }

    /// Takes the next line; `None` at the end of the file. [`text`](Self::text) returns it, until the next one is taken.
    pub(crate) fn line(&mut self) -> Result<Option<(Range<usize>, LineEnd)>, LoadError> {
        let mut searched = 0;
        let length = loop {
            let bytes = &self.buffer[self.start + searched..self.end];
            match memchr2(b'\n', b'\r', bytes) {
                // The byte after a carriage return may be its line feed.
                Some(found)
                    if bytes[found] == b'\r' && found + 1 == bytes.len() && !self.is_at_end =>
                {
                    searched += found;
                    self.at_least(searched + 2)?;
                }
                Some(found) => break searched + found,
                None if self.is_at_end => {
                    let line = self.start..self.end;
                    self.start = self.end;
                    return Ok((!line.is_empty()).then_some((line, LineEnd::None)));
                }
                None => {
                    searched += bytes.len();
                    self.at_least(searched + 1)?;
                }
            }
        };
        let line = self.start..self.start + length;
        let end = match &self.buffer[line.end..self.end] {
            [b'\r', b'\n', ..] => LineEnd::Both,
            [b'\r', ..] => LineEnd::CarriageReturn,
            _ => LineEnd::LineFeed,
        };
        self.start = line.end + if end == LineEnd::Both { 2 } else { 1 };
        Ok(Some((line, end)))
    }

    /// The text of the line that was taken last.
    pub(crate) fn text(&self, line: Range<usize>) -> &[u8] {
        &self.buffer[line]
    }

    /// Gives back the line feed of a line that ended with [`LineEnd::Both`].
    pub(crate) fn give_back_line_feed(&mut self) {
        self.start -= 1;
    }

    /// The whole rest.
    #[cfg(any(test, feature = "scenes"))]
    pub(crate) fn into_rest(mut self) -> Result<Vec<u8>, LoadError> {
        check_room(self.room_for(1) as u64).map_err(|source| LoadError::Read {
            file: self.name.to_owned(),
            source,
        })?;
        while !self.is_at_end {
            let count = self.end - self.start + self.room_for(1).min(16 * PIECE);
            self.at_least(count.max(self.end - self.start + 1))?;
        }
        self.buffer.truncate(self.end);
        self.buffer.drain(..self.start);
        Ok(self.buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that returns few bytes at a time.
    struct Drops<'a>(&'a [u8]);

    impl Read for Drops<'_> {
        fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
            let count = self.0.len().min(to.len()).min(3);
            to[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    #[test]
    fn lines_end_in_any_way() {
        use LineEnd::{Both, CarriageReturn, LineFeed};

        let text = b"one\ntwo\r\n\rthree and more\r\r\n\nfour";
        let mut source = Source::new(Drops(text), None, "a");
        let mut lines = Vec::new();
        while let Some((line, end)) = source.line().expect("no error") {
            lines.push((String::from_utf8_lossy(source.text(line)).into_owned(), end));
        }
        let expected = [
            ("one", LineFeed),
            ("two", Both),
            ("", CarriageReturn),
            ("three and more", CarriageReturn),
            ("", Both),
            ("", LineFeed),
            ("four", LineEnd::None),
        ];
        assert_eq!(lines, expected.map(|(line, end)| (line.to_owned(), end)));
    }

    #[test]
    fn bytes_come_in_order_whatever_is_asked_for() {
        let all: Vec<u8> = (0..=250).cycle().take(3 * PIECE).collect();
        let mut source = Source::of_bytes(&all, "a");
        let mut at = 0;
        for step in [1, 7, PIECE - 3, PIECE + 9, 5].into_iter().cycle() {
            let found = source.at_least(step).expect("no error");
            let count = found.len().min(step);
            assert_eq!(found[..count], all[at..at + count], "at {at}");
            source.take(count);
            at += count;
            assert_eq!(source.room_for(1), all.len() - at);
            if count < step {
                break;
            }
        }
        assert_eq!(at, all.len());
        let mut source = Source::of_bytes(&all, "a");
        source.at_least(2).expect("no error");
        source.take(2);
        assert_eq!(source.into_rest().expect("no error"), all[2..]);
    }
}
