//! Reader of OFF, the object file format of Geomview.

use std::io::Read;
use std::ops::Range;

use kd_core::Mesh;

use crate::LoadError;
use crate::error::quoted;
use crate::file_mesh::{Corner, FacePlace, FileMesh};
use crate::report::{Place, Report, Strictness, WarningCode};
use crate::source::Source;
use crate::text_lines::TextLines;
use crate::words::{Words, integer, number};

/// Reads an OFF file as a mesh. Errors name the file `name`.
///
/// The header may be `OFF` with any of the prefixes `ST`, `C` and `N`; texture coordinates, colors and normals are not used, with a
/// warning. Vertices keep their order. Convex polygons become fans of triangles, concave ones are triangulated by ear clipping.
///
/// # Errors
///
/// [`LoadError`] with the line: another header (binary, or of four dimensions), missing data, an invalid number, a coordinate that is not
/// finite, a face of fewer than three corners, an index out of range.
pub fn read_off(reader: impl Read, name: &str) -> Result<Mesh, LoadError> {
    let mut source = Source::new(reader, None, name);
    read_off_with(&mut source, &mut Report::new(Strictness::Usual))
}

/// The letters before `OFF` that are read.
const PREFIXES: [&[u8]; 8] = [b"ST", b"C", b"N", b"STC", b"STN", b"CN", b"STCN", b""];

/// Whether a first line is that of an OFF file, which may be of a kind that cannot be read.
pub(crate) fn is_header(line: &[u8]) -> bool {
    let header = Words::new(line).next().and_then(header_of);
    header.is_some_and(|(prefix, _)| {
        PREFIXES.contains(&prefix) || matches!(prefix, b"4" | b"n" | b"4n")
    })
}

/// The letters before `OFF` in a word, and the length of both. The number of vertices may follow without a blank.
fn header_of(word: &[u8]) -> Option<(&[u8], usize)> {
    let place = word.windows(3).position(|letters| letters == b"OFF")?;
    let after = &word[place + 3..];
    after
        .iter()
        .all(u8::is_ascii_digit)
        .then_some((&word[..place], place + 3))
}

/// [`read_off`], with its warnings. A lenient reader leaves out damaged faces, and vertices that are not finite with the faces that use
/// them.
pub(crate) fn read_off_with(
    source: &mut Source<'_>,
    report: &mut Report,
) -> Result<Mesh, LoadError> {
    let name = source.name;
    source.take_byte_order_mark()?;
    let mut reader = Reader {
        source,
        lines: TextLines::new(0, Some(b'#')),
    };
    let [vertices, faces] = reader.counts()?;
    let mut mesh = FileMesh::new(name);
    for vertex in 0..vertices {
        reader.expect("vertex", vertex, vertices)?;
        let line = reader.lines.number;
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            let word = reader.word("bad vertex")?;
            let value = number(&reader.lines.text[word]);
            *coordinate = value.ok_or_else(|| reader.bad("bad vertex"))?;
        }
        if reader.lines.word().is_some() {
            let what = "normals, colors and texture coordinates of vertices are not used";
            report.warn(name, Some(Place::Line(line)), WarningCode::Unused, what);
        }
        mesh.vertex(position, Some(line), report)?;
    }
    let mut corners = Vec::new();
    for face in 0..faces {
        reader.expect("face", face, faces)?;
        let line = reader.lines.number;
        let count = reader.integer()?;
        corners.clear();
        for _ in 0..count {
            corners.push(Corner::from_zero(reader.integer()?));
        }
        if reader.lines.word().is_some() {
            let what = "colors of faces are not used";
            report.warn(name, Some(Place::Line(line)), WarningCode::Unused, what);
        }
        let place = FacePlace {
            number: face,
            line: Some(line),
        };
        mesh.face(&corners, place, report)?;
    }
    if reader.lines.next(reader.source)? {
        let what = "a line is left over after the last face the header declares";
        let place = Some(Place::Line(reader.lines.number));
        report.warn(name, place, WarningCode::LeftOver, what);
    }
    Ok(mesh.finish(report, |_, _, _| {})?.mesh)
}

struct Reader<'s, 'a> {
    source: &'s mut Source<'a>,
    lines: TextLines,
}

impl Reader<'_, '_> {
    /// Takes the line of an element.
    fn expect(&mut self, element: &str, index: usize, count: usize) -> Result<(), LoadError> {
        if self.lines.next(self.source)? {
            return Ok(());
        }
        Err(LoadError::Truncated {
            file: self.source.name.to_owned(),
            element: element.to_owned(),
            index,
            count,
        })
    }

    /// The place of the next word, which may be on another line.
    fn word(&mut self, problem: &str) -> Result<Range<usize>, LoadError> {
        loop {
            if let Some(word) = self.lines.word() {
                return Ok(word);
            }
            if !self.lines.next(self.source)? {
                return Err(self.bad(problem));
            }
        }
    }

    /// The next word, as an integer of a face.
    fn integer(&mut self) -> Result<i64, LoadError> {
        let word = self.word("bad face")?;
        let value = integer(&self.lines.text[word]);
        value.ok_or_else(|| self.bad("bad face"))
    }

    /// Takes the header, and returns the numbers of vertices and of faces. A file without `OFF` begins with them.
    fn counts(&mut self) -> Result<[usize; 2], LoadError> {
        let missing = |file: &str| LoadError::BadHeader {
            file: file.to_owned(),
            problem: "expected `OFF` and the numbers of vertices and faces".to_owned(),
        };
        if !self.lines.next(self.source)? {
            return Err(missing(self.source.name));
        }
        let first = Words::new(&self.lines.text).next().unwrap_or_default();
        if let Some((prefix, length)) = header_of(first) {
            if !PREFIXES.contains(&prefix) {
                return Err(self.bad("points of other than three dimensions are not supported"));
            }
            if Words::new(&self.lines.text).any(|word| word == b"BINARY") {
                return Err(self.bad("binary OFF is not supported"));
            }
            self.lines.skip(length);
        }
        let mut counts = [0; 2];
        for count in &mut counts {
            let problem = "expected the numbers of vertices and faces";
            let word = self.word(problem)?;
            let value = integer(&self.lines.text[word]).and_then(|it| usize::try_from(it).ok());
            *count = value.ok_or_else(|| self.bad(problem))?;
        }
        Ok(counts)
    }

    fn bad(&self, problem: &str) -> LoadError {
        LoadError::BadLine {
            file: self.source.name.to_owned(),
            line: self.lines.number,
            problem: format!("{problem}: {}", quoted(&self.lines.text)),
        }
    }
}
