//! Wavefront OBJ: `tobj` reads it, from a stream that holds nothing but geometry.
//!
//! `tobj` 4 makes a polygon of a polyline (`l 1 2 3`), drops faces of two corners, refuses comments
//! behind a statement and broken lines (`\`), refuses files where only some vertices have a colour,
//! and its errors name no line. All of that lies in statements that a ray tracer does not need or
//! in things a filter can see, so [`Geometry`] hands it one plain `v` or `f` statement at a time
//! and remembers the line. What `tobj` finds only at the end is looked for once more, by line.

#[cfg(feature = "scenes")]
mod scene;

use std::io::{self, BufRead, Read};
use std::path::Path;

use kd_core::Mesh;

use crate::LoadError;
use crate::error::quoted;
#[cfg(feature = "scenes")]
pub use scene::read_obj_scene;

/// Reads a Wavefront OBJ file; `name` is used in errors only.
///
/// Objects, groups and materials become one mesh with the faces in file order; a missing material
/// file is no error. Vertices come in the order in which faces first use them, each once; those
/// that no face uses are left out. Negative (relative) indices and faces that stand before their
/// vertices are valid. A fourth coordinate divides the other three; colours are ignored, and so are
/// points, lines and statements that are not known.
///
/// # Errors
/// [`LoadError`] with the line: bad numbers, faces of fewer than three corners, indices out of
/// range (0 always is), coordinates that are not finite, free-form curves and surfaces.
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
    // Statements that would ask for a material file never reach tobj.
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

/// Some editors put it before UTF-8 text; the first statement is behind it.
const BYTE_ORDER_MARK: &[u8] = "\u{feff}".as_bytes();

/// The statements of a file: lines without comments, broken lines joined.
struct Statements<'a> {
    rest: &'a [u8],
    /// Lines taken so far, so the number of the last line of the current statement.
    lines: usize,
}

impl<'a> Statements<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes,
            lines: 0,
        }
    }

    /// Writes the next statement to `into` and returns the number of its first line.
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

/// The position index of a face's corner: what stands before the first slash.
fn position_index(corner: &[u8]) -> &[u8] {
    match corner.iter().position(|&byte| byte == b'/') {
        // A corner that starts with a slash has no position: kept whole, so that it is refused.
        Some(0) | None => corner,
        Some(slash) => &corner[..slash],
    }
}

/// A stream of plain `v` and `f` statements.
struct Geometry<'a> {
    bytes: &'a [u8],
    name: &'a str,
    statements: Statements<'a>,
    /// The current statement as the file has it, and as `tobj` sees it from `given` on.
    statement: Vec<u8>,
    plain: Vec<u8>,
    given: usize,
    line: usize,
    vertices: usize,
    faces: usize,
    refused: Option<LoadError>,
}

impl<'a> Geometry<'a> {
    fn new(bytes: &'a [u8], name: &'a str) -> Self {
        Self {
            bytes,
            name,
            statements: Statements::new(bytes),
            statement: Vec::new(),
            plain: Vec::new(),
            given: 0,
            line: 0,
            vertices: 0,
            faces: 0,
            refused: None,
        }
    }

    /// Finds the next `v` or `f` statement. At the end of the file `plain` stays empty.
    fn advance(&mut self) -> Result<(), LoadError> {
        self.plain.clear();
        self.given = 0;
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
                    // Four numbers are homogeneous; anything behind three others is colour.
                    let numbers = if words.clone().count() == 4 { 4 } else { 3 };
                    self.plain.push(b'v');
                    for number in words.take(numbers) {
                        self.plain.push(b' ');
                        self.plain.extend_from_slice(number);
                    }
                }
                // `fo` is the old spelling of `f`.
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

    /// Adds the place to what `tobj` says. It asks for one statement at a time, so a statement it
    /// cannot read is the current one; indices it checks at the end, so these are looked for.
    fn explain(mut self, error: tobj::LoadError) -> LoadError {
        if let Some(refused) = self.refused.take() {
            return refused;
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
        if self.given == self.plain.len()
            && let Err(refused) = self.advance()
        {
            self.refused = Some(refused);
            return Err(io::ErrorKind::InvalidData.into());
        }
        Ok(&self.plain[self.given..])
    }

    fn consume(&mut self, count: usize) {
        self.given += count;
    }
}

/// Line and number of the first vertex that is not finite as `f32`.
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
