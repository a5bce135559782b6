//! Reader of STL, text and binary.

use std::io::Read;
use std::ops::Range;

use kd_core::Mesh;

use crate::LoadError;
use crate::error::quoted;
use crate::file_mesh::{Corner, FacePlace, FileMesh};
use crate::report::{Place, Report, Strictness, WarningCode};
use crate::source::Source;
use crate::text_lines::TextLines;
use crate::words::{Words, number};

/// Bytes of the header of a binary file.
const HEADER: usize = 80;
/// Bytes before the first triangle.
const START: usize = HEADER + 4;
/// Bytes of a triangle: a normal, three corners, an attribute.
const TRIANGLE: usize = 50;

/// Reads an STL file as a mesh: text, or binary. Errors name the file `name`.
///
/// Each triangle has three vertices of its own, in file order, as the file has them. Normals are not read: the order of the corners says
/// which side is outside. A text may have several solids, and facets of more than three corners, which are triangulated.
///
/// # Errors
///
/// [`LoadError`] with the line (text) or the triangle (binary): missing data, an invalid number, a coordinate that is not finite, a facet
/// of fewer than three corners.
pub fn read_stl(reader: impl Read, name: &str) -> Result<Mesh, LoadError> {
    let mut source = Source::new(reader, None, name);
    read_stl_with(&mut source, &mut Report::new(Strictness::Usual))
}

/// [`read_stl`], with its warnings. A lenient reader leaves out damaged facets.
pub(crate) fn read_stl_with(
    source: &mut Source<'_>,
    report: &mut Report,
) -> Result<Mesh, LoadError> {
    if is_text(source)? {
        read_text(source, report)
    } else {
        read_binary(source, report)
    }
}

/// Whether the source is a binary STL file by its length, which its number of triangles determines.
pub(crate) fn is_binary(source: &mut Source<'_>) -> Result<bool, LoadError> {
    let length = source.length();
    let start = source.at_least(START)?;
    let count = start
        .get(HEADER..START)
        .and_then(|count| count.first_chunk());
    let expected =
        count.map(|count| START as u64 + TRIANGLE as u64 * u64::from(u32::from_le_bytes(*count)));
    Ok(expected.is_some() && expected == length)
}

/// Whether the source is an STL text: a `solid` and its first `facet`, or its end. Binary files may begin with `solid` too.
pub(crate) fn is_text(source: &mut Source<'_>) -> Result<bool, LoadError> {
    if is_binary(source)? {
        return Ok(false);
    }
    /// The name of a solid may be long.
    const HEAD: usize = 1 << 12;
    let head = source.at_least(HEAD)?;
    let head = &head[..head.len().min(HEAD)];
    // The number of triangles of a binary file has a zero byte, up to 16 million.
    let has_zero = memchr::memchr(0, head).is_some();
    let head = head.trim_ascii_start();
    if has_zero || !starts_with(head, b"solid") {
        return Ok(false);
    }
    let mut words = Words::new(head).skip(1);
    let is_statement = |word: &[u8]| is(word, b"facet") || is(word, b"endsolid");
    Ok(words.any(is_statement))
}

fn starts_with(text: &[u8], word: &[u8]) -> bool {
    text.get(..word.len()).is_some_and(|start| is(start, word))
}

fn is(word: &[u8], keyword: &[u8]) -> bool {
    word.eq_ignore_ascii_case(keyword)
}

fn read_binary(source: &mut Source<'_>, report: &mut Report) -> Result<Mesh, LoadError> {
    let name = source.name;
    let start = source.at_least(START)?;
    let Some(count) = start
        .get(HEADER..START)
        .and_then(|count| count.first_chunk())
    else {
        return Err(LoadError::BadHeader {
            file: name.to_owned(),
            problem: format!(
                "expected {START} bytes of binary STL or `solid`, found {}",
                start.len()
            ),
        });
    };
    let count = u32::from_le_bytes(*count) as usize;
    source.take(START);
    let mut mesh = FileMesh::new(name);
    let room = count.min(source.room_for(TRIANGLE));
    mesh.reserve(3 * room, room)?;
    let mut colored = 0;
    for number in 0..count {
        let bytes = source.at_least(TRIANGLE)?;
        let Some(bytes) = bytes.first_chunk::<TRIANGLE>() else {
            return Err(LoadError::Truncated {
                file: name.to_owned(),
                element: "triangle".to_owned(),
                index: number,
                count,
            });
        };
        let float = |at: usize| {
            let bytes = bytes[at..].first_chunk().expect("fifty bytes");
            f32::from_le_bytes(*bytes)
        };
        let corners = [12, 24, 36].map(|at| [float(at), float(at + 4), float(at + 8)]);
        colored += usize::from(bytes[48..] != [0, 0]);
        source.take(TRIANGLE);
        add(
            &mut mesh,
            &corners,
            FacePlace { number, line: None },
            report,
        )?;
    }
    if colored > 0 {
        let what = format!("the attributes (colors) of {colored} triangles are not used");
        report.warn(name, None, WarningCode::Unused, what);
    }
    let left = source.at_least(1)?.len();
    if left > 0 {
        let what = "bytes are left over after the last triangle that the header declares";
        report.warn(name, None, WarningCode::LeftOver, what);
    }
    Ok(mesh.finish(report, |_, _, _| {})?.mesh)
}

/// Adds a facet with vertices of its own.
fn add(
    mesh: &mut FileMesh<'_>,
    corners: &[[f32; 3]],
    place: FacePlace,
    report: &mut Report,
) -> Result<(), LoadError> {
    let first = mesh.vertices();
    for corner in corners {
        mesh.vertex(*corner, place.line, report)?;
    }
    let corner = |number: usize| {
        Corner::from_zero(i64::try_from(number).expect("fewer than 2^63, as each takes memory"))
    };
    if corners.len() == 3 {
        mesh.face(
            &[corner(first), corner(first + 1), corner(first + 2)],
            place,
            report,
        )?;
        return Ok(());
    }
    let all: Vec<Corner> = (first..mesh.vertices()).map(corner).collect();
    mesh.face(&all, place, report)?;
    Ok(())
}

fn read_text(source: &mut Source<'_>, report: &mut Report) -> Result<Mesh, LoadError> {
    let mut reader = TextReader {
        name: source.name,
        mesh: FileMesh::new(source.name),
        lines: TextLines::new(0, None),
        facets: 0,
        corners: Vec::new(),
        open: None,
        is_damaged: false,
        normal: 0,
        has_end: false,
    };
    while reader.lines.next(source)? {
        // Most files have one statement a line, but a line may have several.
        while let Some(word) = reader.lines.word() {
            if !reader.statement(word, source, report)? {
                break;
            }
        }
    }
    if let Some(line) = reader.open {
        let error = LoadError::BadLine {
            file: source.name.to_owned(),
            line,
            problem: "the file ends in this facet".to_owned(),
        };
        let what = "the file ends in a facet; it is left out";
        report.leave_out(
            error,
            Some(Place::Line(line)),
            WarningCode::BadElement,
            what,
        )?;
    } else if !reader.has_end {
        let what = "the file ends without `endsolid`";
        let place = Some(Place::Line(reader.lines.number));
        report.warn(source.name, place, WarningCode::MissingEnd, what);
    }
    Ok(reader.mesh.finish(report, |_, _, _| {})?.mesh)
}

struct TextReader<'a> {
    name: &'a str,
    mesh: FileMesh<'a>,
    lines: TextLines,
    facets: usize,
    /// The corners of the facet that is open.
    corners: Vec<[f32; 3]>,
    /// The line of that facet.
    open: Option<usize>,
    /// Whether it has a vertex that cannot be read.
    is_damaged: bool,
    /// How many numbers of its normal are still to come.
    normal: usize,
    has_end: bool,
}

impl TextReader<'_> {
    /// Reads the statement that begins with a word. Returns whether the line may have another one.
    fn statement(
        &mut self,
        word: Range<usize>,
        source: &mut Source<'_>,
        report: &mut Report,
    ) -> Result<bool, LoadError> {
        let place = Some(Place::Line(self.lines.number));
        let word = &self.lines.text[word];
        if is(word, b"vertex") {
            return self.vertex(source, report);
        }
        if is(word, b"facet") {
            if self.open.is_some() {
                let error = self.bad("the facet before has no `endfacet`");
                let what = "a facet has no `endfacet`; it is left out";
                report.leave_out(error, place, WarningCode::BadElement, what)?;
            }
            self.corners.clear();
            self.open = Some(self.lines.number);
            self.is_damaged = false;
        } else if is(word, b"endfacet") {
            let line = self
                .open
                .take()
                .ok_or_else(|| self.bad("no facet is open"))?;
            let number = self.facets;
            self.facets += 1;
            if !self.is_damaged {
                let place = FacePlace {
                    number,
                    line: Some(line),
                };
                add(&mut self.mesh, &self.corners, place, report)?;
            }
        } else if is(word, b"solid") || is(word, b"endsolid") {
            self.has_end = is(word, b"endsolid");
            return Ok(self.skip_name());
        } else if is(word, b"color") {
            return Ok(false);
        } else if is(word, b"normal") {
            // The order of the corners says which side is outside.
            self.normal = 3;
        } else if number(word).is_some() {
            if self.normal == 0 {
                let what = "numbers after those of a vertex or a normal are not used";
                report.warn(self.name, place, WarningCode::Unused, what);
            }
            self.normal = self.normal.saturating_sub(1);
        } else if !["outer", "loop", "endloop"]
            .iter()
            .any(|known| is(word, known.as_bytes()))
        {
            let error = self.bad("not a statement of STL");
            let what = "a line is no statement of STL; it is left out";
            report.leave_out(error, place, WarningCode::BadElement, what)?;
            return Ok(false);
        }
        Ok(true)
    }

    /// Skips the name of a solid, which may have any words: all up to a facet on the same line. Returns whether there is one.
    fn skip_name(&mut self) -> bool {
        let mut before: Option<Range<usize>> = None;
        while let Some(word) = self.lines.word() {
            let is_normal = is(&self.lines.text[word.clone()], b"normal");
            if let Some(before) =
                before.filter(|before| is(&self.lines.text[before.clone()], b"facet"))
                && is_normal
            {
                self.lines.skip(before.start);
                return true;
            }
            before = Some(word);
        }
        false
    }

    /// Reads the coordinates of a vertex, which may go on on another line.
    fn vertex(&mut self, source: &mut Source<'_>, report: &mut Report) -> Result<bool, LoadError> {
        if self.open.is_none() {
            return Err(self.bad("no facet is open"));
        }
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            let word = loop {
                match self.lines.word() {
                    Some(word) => break Some(word),
                    None if self.lines.next(source)? => {}
                    None => break None,
                }
            };
            let Some(value) = word.and_then(|word| number(&self.lines.text[word])) else {
                let place = Some(Place::Line(self.lines.number));
                let what = "a facet has a bad vertex; it is left out";
                report.leave_out(self.bad("bad vertex"), place, WarningCode::BadElement, what)?;
                self.is_damaged = true;
                return Ok(false);
            };
            *coordinate = value;
        }
        self.corners.push(position);
        Ok(true)
    }

    fn bad(&self, problem: &str) -> LoadError {
        LoadError::BadLine {
            file: self.name.to_owned(),
            line: self.lines.number,
            problem: format!("{problem}: {}", quoted(&self.lines.text)),
        }
    }
}
