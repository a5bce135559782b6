//! The statements of OBJ and MTL files.

use crate::LoadError;
use crate::source::Source;
use crate::words::Words;

/// The statements of a file: lines without comments, with continued lines joined.
pub(super) struct Statements<'s, 'a> {
    source: &'s mut Source<'a>,
    /// Number of lines taken: the line number of the end of the current statement.
    lines: usize,
    /// A statement of several lines.
    joined: Vec<u8>,
}

impl<'s, 'a> Statements<'s, 'a> {
    pub(super) fn new(source: &'s mut Source<'a>) -> Result<Self, LoadError> {
        source.take_byte_order_mark()?;
        Ok(Self {
            source,
            lines: 0,
            joined: Vec::new(),
        })
    }

    /// The next statement, and the number of its first line, from 1.
    #[inline]
    pub(super) fn next(&mut self) -> Result<Option<(usize, &[u8])>, LoadError> {
        let first = self.lines + 1;
        let Some((line, _)) = self.source.line()? else {
            return Ok(None);
        };
        self.lines += 1;
        let (length, is_continued) = statement(self.source.text(line.clone()));
        if is_continued {
            let text = self.source.text(line)[..length].to_vec();
            return self.join(text).map(|text| Some((first, text)));
        }
        Ok(Some((first, &self.source.text(line)[..length])))
    }

    /// A statement that begins with `text` and continues on the next line.
    #[cold]
    fn join(&mut self, text: Vec<u8>) -> Result<&[u8], LoadError> {
        self.joined = text;
        let mut is_continued = true;
        while is_continued && let Some((line, _)) = self.source.line()? {
            self.lines += 1;
            let line = self.source.text(line);
            let length;
            (length, is_continued) = statement(line);
            self.joined.push(b' ');
            self.joined.extend_from_slice(&line[..length]);
        }
        Ok(&self.joined)
    }
}

/// Keywords before a name, which may have a `#` in it, as `Mat #1` of 3ds Max.
const NAMED: [&[u8]; 6] = [b"g", b"map_Kd", b"mtllib", b"newmtl", b"o", b"usemtl"];

/// How many bytes of a line are its statement, and whether it continues on the next line.
#[inline]
fn statement(line: &[u8]) -> (usize, bool) {
    let text = match memchr::memchr(b'#', line) {
        Some(_) if is_in_name(line) => return (line.trim_ascii_end().len(), false),
        Some(comment) => &line[..comment],
        None => line,
    };
    let text = text.trim_ascii_end();
    match text.strip_suffix(b"\\") {
        Some(broken) => (broken.len(), true),
        None => (text.len(), false),
    }
}

/// Whether a `#` of a line may be part of a name.
fn is_in_name(line: &[u8]) -> bool {
    let first = Words::new(line).next();
    first.is_some_and(|first| NAMED.contains(&first))
}

/// The text of a statement after its first word.
#[cfg(feature = "scenes")]
pub(super) fn rest(statement: &[u8], word: &str) -> String {
    let text = statement.trim_ascii();
    let text = text.strip_prefix(word.as_bytes()).unwrap_or(text);
    String::from_utf8_lossy(text.trim_ascii()).into_owned()
}

/// A name without what may be a comment after it.
#[cfg(feature = "scenes")]
pub(super) fn without_comment(name: &str) -> &str {
    let comment = name.find(" #").or_else(|| name.find("\t#"));
    comment.map_or(name, |comment| name[..comment].trim_end())
}

/// The first numbers of a statement after its first word; `None` if one is missing or not finite.
#[cfg(feature = "scenes")]
pub(super) fn numbers<const N: usize>(statement: &[u8]) -> Option<[f32; N]> {
    let mut words = Words::new(statement).skip(1);
    let mut all = [0.0; N];
    for one in &mut all {
        *one = crate::words::number(words.next()?).filter(|number| number.is_finite())?;
    }
    Some(all)
}
