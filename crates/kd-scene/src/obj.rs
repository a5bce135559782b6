//! Reader of Wavefront OBJ: `tobj` parses a stream that is filtered to geometry.
//!
//! `tobj` 4 turns a polyline (`l 1 2 3`) into a polygon, drops faces of two corners, refuses comments after a statement, line
//! continuations (`\`), and files where only some vertices have a color, and its errors name no line. A filter can handle all
//! of these: [`Geometry`] passes one plain `v` or `f` statement at a time to `tobj` and keeps its line number. Errors that
//! `tobj` detects only at the end are located by a second pass over the lines.

#[cfg(feature = "scenes")]
mod scene;

use std::io::{self, BufRead, Read};
use std::path::Path;

use kd_core::Mesh;

use crate::LoadError;
use crate::error::quoted;
#[cfg(feature = "scenes")]
pub use scene::read_obj_scene;

/// Reads the geometry of a Wavefront OBJ file as a mesh. Errors name the file `name`.
///
/// All objects, groups and materials form one mesh, with the faces in file order as triangle fans. Vertices are ordered by
/// their first use in a face; unused vertices are dropped. Negative (relative) indices are valid, and so are faces before their
/// vertices. A fourth coordinate divides the other three. Colors, material files, points, lines and unknown statements are
/// ignored. The whole file is held in memory.
///
/// # Errors
///
/// [`LoadError`] with the line: an invalid number, a face of fewer than three corners, an index out of range (such as 0), a
/// coordinate that is not finite, a free-form curve or surface.
pub fn read_obj(mut reader: impl BufRead, name: &str) -> Result<Mesh, LoadError> {
    let file = || name.to_owned();
    let mut bytes = Vec::new();
    if let Err(source) = reader.read_to_end(&mut bytes) {
        return Err(LoadError::Read {
            file: file(),
            source,
        });
    }
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(&bytes);
    let mut geometry = Geometry::new(bytes, name);
    let options = tobj::LoadOptions {
        triangulate: true,
        ..Default::default()
    };
    // The filter removes the statements that name material files.
    let no_materials = |_: &Path| Err(tobj::LoadError::GenericFailure);
    let models = match tobj::load_obj_buf(&mut geometry, &options, no_materials) {
        Ok((models, _)) => models,
        Err(error) => return Err(geometry.explain(error)),
    };

    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for tobj::Model { mesh, .. } in models {
        let base = u32::try_from(positions.len()).unwrap_or(u32::MAX);
        positions.extend_from_slice(mesh.positions.as_chunks::<3>().0);
        let corners = mesh.indices.as_chunks::<3>().0.iter();
        triangles.extend(corners.map(|corners| corners.map(|corner| base.saturating_add(corner))));
    }
    if positions
        .iter()
        .flatten()
        .any(|coordinate| !coordinate.is_finite())
        && let Some((line, vertex)) = first_not_finite(bytes)
    {
        let line = Some(line);
        return Err(LoadError::NotFinite {
            file: file(),
            line,
            vertex,
        });
    }
    Mesh::new(positions, triangles).map_err(|source| LoadError::Mesh {
        file: file(),
        source,
    })
}

/// The byte order mark that some editors write before UTF-8 text.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The statements of a file: lines without comments, with continued lines joined.
struct Statements<'a> {
    rest: &'a [u8],
    /// Number of lines taken: the line number of the end of the current statement.
    lines: usize,
}

impl<'a> Statements<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            lines: 0,
        }
    }

    /// Writes the next statement to `into`, and returns the number of its first line, from 1.
    fn next_into(&mut self, into: &mut Vec<u8>) -> Option<usize> {
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

fn words(statement: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    statement
        .split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
}

/// The position index of a corner of a face: the text before the first slash.
fn position_index(corner: &[u8]) -> &[u8] {
    match corner.iter().position(|&byte| byte == b'/') {
        // A corner that starts with a slash has no position. It stays whole, so that `tobj` refuses it.
        Some(0) | None => corner,
        Some(slash) => &corner[..slash],
    }
}

/// A stream of plain `v` and `f` statements for `tobj`.
struct Geometry<'a> {
    bytes: &'a [u8],
    name: &'a str,
    statements: Statements<'a>,
    /// The current statement in the file.
    statement: Vec<u8>,
    /// The current statement as `tobj` reads it; the first `consumed` bytes are read.
    plain: Vec<u8>,
    consumed: usize,
    /// Line number of the current statement.
    line: usize,
    /// Numbers of vertices and faces so far.
    vertices: usize,
    faces: usize,
    /// The error of the filter, which `tobj` cannot carry.
    error: Option<LoadError>,
}

impl<'a> Geometry<'a> {
    fn new(bytes: &'a [u8], name: &'a str) -> Self {
        Self {
            bytes,
            name,
            statements: Statements::new(bytes),
            statement: Vec::new(),
            plain: Vec::new(),
            consumed: 0,
            line: 0,
            vertices: 0,
            faces: 0,
            error: None,
        }
    }

    /// Finds the next `v` or `f` statement. At the end of the file `plain` stays empty.
    fn advance(&mut self) -> Result<(), LoadError> {
        self.plain.clear();
        self.consumed = 0;
        while self.plain.is_empty() {
            let Some(line) = self.statements.next_into(&mut self.statement) else {
                return Ok(());
            };
            self.line = line;
            if self.statement.contains(&0) {
                return Err(self.bad_line("not text"));
            }
            let mut words = words(&self.statement);
            match words.next() {
                Some(b"v") => {
                    self.vertices += 1;
                    // Four numbers are homogeneous coordinates; more than four are a position and a color.
                    let numbers = if words.clone().count() == 4 { 4 } else { 3 };
                    self.plain.push(b'v');
                    for number in words.take(numbers) {
                        self.plain.push(b' ');
                        self.plain.extend_from_slice(number);
                    }
                }
                // `fo` is an obsolete spelling of `f`.
                Some(b"f" | b"fo") => {
                    let (face, corners) = (self.faces, words.clone().count());
                    if corners < 3 {
                        let (file, line) = (self.name.to_owned(), Some(line));
                        return Err(LoadError::TooFewCorners {
                            file,
                            line,
                            face,
                            corners,
                        });
                    }
                    self.faces += 1;
                    self.plain.push(b'f');
                    for corner in words {
                        self.plain.push(b' ');
                        self.plain.extend_from_slice(position_index(corner));
                    }
                }
                Some(b"curv" | b"curv2" | b"surf") => {
                    return Err(self.bad_line("free-form curves and surfaces are not supported"));
                }
                _ => continue,
            }
            self.plain.push(b'\n');
        }
        Ok(())
    }

    fn bad_line(&self, problem: &str) -> LoadError {
        LoadError::BadLine {
            file: self.name.to_owned(),
            line: self.line,
            problem: format!("{problem}: {}", quoted(&self.statement)),
        }
    }

    /// Adds the location to an error of `tobj`. `tobj` reads one statement at a time, so an invalid statement is the current
    /// one. It checks indices at the end, so an index out of range is searched for.
    fn explain(mut self, error: tobj::LoadError) -> LoadError {
        if let Some(error) = self.error.take() {
            return error;
        }
        match error {
            tobj::LoadError::FaceVertexOutOfBounds => self.first_bad_index(),
            tobj::LoadError::PositionParseError => self.bad_line("bad vertex"),
            tobj::LoadError::FaceParseError => self.bad_line("bad face"),
            tobj::LoadError::ScalingByZeroError => self.bad_line("the fourth coordinate is zero"),
            tobj::LoadError::ReadError => self.bad_line("not text"),
            other => self.bad_line(&other.to_string()),
        }
    }

    fn first_bad_index(&self) -> LoadError {
        let mut statements = Statements::new(self.bytes);
        let mut statement = Vec::new();
        let (mut seen, mut face) = (0_i64, 0);
        while let Some(line) = statements.next_into(&mut statement) {
            let mut words = words(&statement);
            match words.next() {
                Some(b"v") => seen += 1,
                Some(b"f" | b"fo") => {
                    for corner in words.map(position_index) {
                        let index = std::str::from_utf8(corner).ok();
                        let Some(index) = index.and_then(|index| index.parse::<i64>().ok()) else {
                            return LoadError::BadLine {
                                file: self.name.to_owned(),
                                line,
                                problem: format!("bad face: {}", quoted(&statement)),
                            };
                        };
                        let number = if index < 0 {
                            seen.saturating_add(index)
                        } else {
                            index - 1
                        };
                        if usize::try_from(number).map_or(true, |number| number >= self.vertices) {
                            return LoadError::IndexOutOfRange {
                                file: self.name.to_owned(),
                                line: Some(line),
                                face,
                                index,
                                vertices: self.vertices,
                            };
                        }
                    }
                    face += 1;
                }
                _ => {}
            }
        }
        self.bad_line("a face has an index out of range")
    }
}

impl Read for Geometry<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(into)?;
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Geometry<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.consumed == self.plain.len()
            && let Err(error) = self.advance()
        {
            self.error = Some(error);
            return Err(io::ErrorKind::InvalidData.into());
        }
        Ok(&self.plain[self.consumed..])
    }

    fn consume(&mut self, count: usize) {
        self.consumed += count;
    }
}

/// Line number and index of the first vertex that is not finite in `f32`.
fn first_not_finite(bytes: &[u8]) -> Option<(usize, usize)> {
    let mut statements = Statements::new(bytes);
    let mut statement = Vec::new();
    let mut vertex = 0;
    while let Some(line) = statements.next_into(&mut statement) {
        let mut words = words(&statement);
        if words.next() != Some(b"v") {
            continue;
        }
        let number = |word| std::str::from_utf8(word).ok()?.parse::<f32>().ok();
        let numbers: Vec<f32> = words.map_while(number).take(5).collect();
        let w = if numbers.len() == 4 { numbers[3] } else { 1.0 };
        if numbers
            .iter()
            .take(3)
            .any(|number| !(number / w).is_finite())
        {
            return Some((line, vertex));
        }
        vertex += 1;
    }
    None
}
