//! Reader of PLY: `ply-rs-bw` parses the header and one binary element at a time.
//!
//! The loop of the crate over elements trusts the header: 71 bytes that declare 30 million vertices without properties made it
//! allocate 1.2 GB (version 4.0.1, 2026-11-23). The loop here reads elements only from bytes of the file, so the size of the
//! file bounds the memory. Text elements are parsed here, because the grammar of the crate refuses `.5`, `1.` and `nan`, and
//! ignores extra values at the end of a line.

mod header;

use std::str::SplitAsciiWhitespace;

use kd_core::Mesh;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use crate::LoadError;
use crate::error::quoted;
use crate::polygon::triangles_of_face;
use crate::report::{Place, Report, Strictness, WarningCode};
use header::PlainHeader;

/// Reads a PLY file as a mesh: text, or binary in either byte order. Errors name the file `name`.
///
/// The reader uses the scalar properties `x`, `y`, `z` of `vertex`, of any number type, and the list `vertex_indices` or
/// `vertex_index` of `face`, of any integer type, with indices from 0. It skips other properties and elements. Vertices keep
/// their order. Convex polygons become fans of triangles, concave ones are triangulated by ear clipping, in file order. Without a `face`
/// element, the mesh has no triangles. The values of an element may be on several lines, but no line has those of two.
///
/// # Errors
///
/// [`LoadError`] with the line (header, text) or the element (binary): an invalid header, a name that is declared twice,
/// missing data, more values than an element has, an invalid number, a coordinate that is not finite in `f32`, a face of fewer than
/// three corners, an index out of range, triangle strips (`tristrips`).
pub fn read_ply(bytes: &[u8], name: &str) -> Result<Mesh, LoadError> {
    read_ply_with(bytes, name, &mut Report::new(Strictness::Usual))
}

/// [`read_ply`], with its warnings. A lenient reader leaves out damaged faces, and vertices that are not finite with the faces that use
/// them.
pub(crate) fn read_ply_with(
    bytes: &[u8],
    name: &str,
    report: &mut Report,
) -> Result<Mesh, LoadError> {
    let file = || name.to_owned();
    let plain = PlainHeader::of(bytes);
    let parser = Parser::<Row>::new();
    let mut reader = Reader::new(plain.text.as_slice());
    let header = parser.read_header(&mut reader).map_err(|error| {
        match plain.original(error.line().unwrap_or(1)) {
            Some((line, text)) if plain.has_end || !text.is_empty() => LoadError::BadLine {
                file: file(),
                line,
                problem: format!("bad header line: {}", quoted(text)),
            },
            _ => LoadError::BadHeader {
                file: file(),
                problem: "`end_header` is missing".to_owned(),
            },
        }
    })?;
    refuse_duplicates(&plain.text, &header, name)?;
    let mut elements = ElementReader {
        name,
        parser,
        encoding: header.encoding,
        next_line: plain.lines + 1,
        element_line: plain.lines,
        rest: plain.data,
    };

    let mut positions = Vec::new();
    let mut not_finite = Vec::new();
    let mut faces = Faces::default();
    for element in header.elements.values() {
        let kind = ElementKind::of(element).map_err(|problem| LoadError::BadHeader {
            file: file(),
            problem,
        })?;
        // An element without properties has no data, for every count.
        let count = if element.properties.is_empty() {
            0
        } else {
            element.count
        };
        for index in 0..count {
            let row = elements.next_row(element, index)?;
            let line = elements.text_line();
            match kind {
                ElementKind::Vertex => {
                    let position = row.position.map(nearest);
                    if position.iter().any(|coordinate| !coordinate.is_finite()) {
                        let error = LoadError::NotFinite {
                            file: file(),
                            line,
                            vertex: index,
                        };
                        let what = "a vertex is not finite; it is left out";
                        let place = place(line, "vertex", index);
                        report.leave_out(error, place, WarningCode::NotFinite, what)?;
                        not_finite.push(positions.len());
                    }
                    positions.push(position);
                }
                ElementKind::Face if row.corners.len() < 3 => {
                    let error = LoadError::TooFewCorners {
                        file: file(),
                        line,
                        face: index,
                        corners: row.corners.len(),
                    };
                    let what = "a face has fewer than three corners; it is left out";
                    let place = place(line, "face", index);
                    report.leave_out(error, place, WarningCode::FewCorners, what)?;
                }
                ElementKind::Face => faces.push(index, &row.corners, line),
                ElementKind::Other => {}
            }
        }
    }
    // A line end after the data is common and harmless.
    let left = elements.rest.trim_ascii();
    if !left.is_empty() {
        let what = format!(
            "{} bytes left over after the last element the header declares",
            left.len()
        );
        report.warn(name, None, WarningCode::LeftOver, what);
    }
    let triangles = faces.triangles(&positions, &not_finite, name, report)?;
    // No face uses them: in the place of another one they change no box.
    let finite = positions.iter().find(|at| at.iter().all(|x| x.is_finite()));
    let finite = finite.copied().unwrap_or_default();
    for vertex in not_finite {
        positions[vertex] = finite;
    }
    Mesh::new(positions, triangles).map_err(|source| LoadError::Mesh {
        file: file(),
        source,
    })
}

/// A line of a text file, or an element of a binary one.
fn place(line: Option<usize>, kind: &str, index: usize) -> Option<Place> {
    Some(match line {
        Some(line) => Place::Line(line),
        None => Place::Element(kind.to_owned(), index),
    })
}

/// The nearest `f32`. A number that does not fit becomes infinite and is refused later.
#[expect(clippy::cast_possible_truncation, reason = "rounding is intended")]
fn nearest(coordinate: f64) -> f32 {
    coordinate as f32
}

/// The role of an element in a mesh.
#[derive(Clone, Copy)]
enum ElementKind {
    Vertex,
    Face,
    Other,
}

impl ElementKind {
    /// Determines the role by the name, and checks that the required properties exist.
    fn of(element: &ElementDef) -> Result<Self, String> {
        let types = &element.properties;
        match element.name.as_str() {
            "vertex" => {
                for axis in ["x", "y", "z"] {
                    let found = types.get(axis).map(|property| &property.data_type);
                    if !matches!(found, Some(PropertyType::Scalar(_))) {
                        return Err(format!("`vertex` has no scalar property `{axis}`"));
                    }
                }
                Ok(Self::Vertex)
            }
            "face" => {
                let mut lists = types.iter().filter(|(name, _)| is_corner_list(name));
                let (Some((name, list)), None) = (lists.next(), lists.next()) else {
                    return Err(
                        "`face` needs one of the lists `vertex_indices` and `vertex_index`"
                            .to_owned(),
                    );
                };
                if !is_integer_list(&list.data_type) {
                    return Err(format!("`{name}` is not a list of integers"));
                }
                Ok(Self::Face)
            }
            "tristrips" => Err("triangle strips are not supported".to_owned()),
            _ => Ok(Self::Other),
        }
    }
}

/// Refuses two elements, or two properties of an element, of the same name. The crate keeps only the last of them, so that it
/// would assign data to the wrong properties.
fn refuse_duplicates(text: &[u8], header: &Header, name: &str) -> Result<(), LoadError> {
    let lines_with = |keyword: &[u8]| {
        let lines = text.split(|&byte| byte == b'\n');
        lines.filter(|line| line.starts_with(keyword)).count()
    };
    let kept = header.elements.values().map(|it| it.properties.len());
    let kept = kept.sum::<usize>() + header.elements.len();
    if kept == lines_with(b"element") + lines_with(b"property") {
        return Ok(());
    }
    Err(LoadError::BadHeader {
        file: name.to_owned(),
        problem: "two elements or two properties have the same name".to_owned(),
    })
}

fn is_integer_list(data_type: &PropertyType) -> bool {
    let integer = |scalar: &ScalarType| !matches!(scalar, ScalarType::Float | ScalarType::Double);
    matches!(data_type, PropertyType::List(count, item) if integer(count) && integer(item))
}

/// The faces of the file. They may precede the vertices, so their indices are checked at the end.
#[derive(Default)]
struct Faces {
    corners: Vec<i64>,
    /// End of each face in `corners`.
    ends: Vec<usize>,
    /// The number of each face in the file.
    numbers: Vec<usize>,
    /// Line of each face in a text file; empty in a binary file.
    lines: Vec<usize>,
}

impl Faces {
    fn push(&mut self, number: usize, corners: &[i64], line: Option<usize>) {
        self.corners.extend_from_slice(corners);
        self.ends.push(self.corners.len());
        self.numbers.push(number);
        self.lines.extend(line);
    }

    /// The triangles of all faces, after a check of their indices. `not_finite` are vertices in ascending order.
    fn triangles(
        &self,
        positions: &[[f32; 3]],
        not_finite: &[usize],
        name: &str,
        report: &mut Report,
    ) -> Result<Vec<[u32; 3]>, LoadError> {
        let vertices = positions.len();
        let mut triangles = Vec::with_capacity(self.corners.len() - 2 * self.ends.len());
        let mut polygon = Vec::new();
        let mut start = 0;
        for (number, &end) in self.ends.iter().enumerate() {
            let line = self.lines.get(number).copied();
            let face = self.numbers[number];
            let place = || place(line, "face", face);
            let corners = &self.corners[start..end];
            start = end;
            polygon.clear();
            let there = corners.iter().map_while(|index| {
                let corner = u32::try_from(*index).ok()?;
                ((corner as usize) < vertices).then_some(corner)
            });
            polygon.extend(there);
            if let Some(index) = corners.get(polygon.len()) {
                let error = LoadError::IndexOutOfRange {
                    file: name.to_owned(),
                    line,
                    face,
                    index: *index,
                    vertices,
                };
                let what = "a face has an index out of range; it is left out";
                report.leave_out(error, place(), WarningCode::BadIndex, what)?;
                continue;
            }
            let is_bad = |corner: &u32| not_finite.binary_search(&(*corner as usize)).is_ok();
            if !not_finite.is_empty() && polygon.iter().any(is_bad) {
                let what = "a face uses a vertex that is not finite; it is left out";
                report.warn(name, place(), WarningCode::NotFinite, what);
                continue;
            }
            if let &[a, b, c] = polygon.as_slice() {
                triangles.push([a, b, c]);
                continue;
            }
            let found = triangles_of_face(&polygon, positions, name, place, report);
            let corners = found.into_iter();
            triangles.extend(corners.map(|corners| corners.map(|corner| polygon[corner])));
        }
        Ok(triangles)
    }
}

/// The properties of one element that a mesh uses.
#[derive(Default)]
struct Row {
    position: [f64; 3],
    corners: Vec<i64>,
}

impl Row {
    fn set(&mut self, property: &str, value: f64) -> PropertyAccessResult {
        let axis = match property {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.position[axis] = value;
        PropertyAccessResult::Set
    }

    fn set_list<T: Into<i64>>(&mut self, property: &str, list: Vec<T>) -> PropertyAccessResult {
        if !is_corner_list(property) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = list.into_iter().map(Into::into).collect();
        PropertyAccessResult::Set
    }
}

fn is_corner_list(property: &str) -> bool {
    matches!(property, "vertex_indices" | "vertex_index")
}

macro_rules! setters {
    ($($scalar:ident $list:ident $type:ty),*) => {$(
        fn $scalar(&mut self, property: &str, value: $type) -> PropertyAccessResult {
            self.set(property, f64::from(value))
        }
        fn $list(&mut self, property: &str, list: Vec<$type>) -> PropertyAccessResult {
            self.set_list(property, list)
        }
    )*};
}

impl PropertyAccess for Row {
    fn new() -> Self {
        Self::default()
    }

    setters!(
        set_char set_list_char i8, set_uchar set_list_uchar u8,
        set_short set_list_short i16, set_ushort set_list_ushort u16,
        set_int set_list_int i32, set_uint set_list_uint u32
    );

    fn set_float(&mut self, property: &str, value: f32) -> PropertyAccessResult {
        self.set(property, f64::from(value))
    }

    fn set_double(&mut self, property: &str, value: f64) -> PropertyAccessResult {
        self.set(property, value)
    }
}

/// The data after the header.
struct ElementReader<'a> {
    name: &'a str,
    parser: Parser<Row>,
    encoding: Encoding,
    rest: &'a [u8],
    /// Line number of the start of `rest`.
    next_line: usize,
    /// Line number of the start of the last element, in a text.
    element_line: usize,
}

/// The words of an element of a text, line by line.
struct Words<'r, 'a> {
    reader: &'r mut ElementReader<'a>,
    of_line: SplitAsciiWhitespace<'a>,
    /// The lines that were begun.
    lines: usize,
}

const TOO_FEW: &str = "too few values";
const TOO_MANY: &str = "more values than the header declares";

impl<'a> ElementReader<'a> {
    /// Line number of the last element, if the file is text.
    fn text_line(&self) -> Option<usize> {
        (self.encoding == Encoding::Ascii).then_some(self.element_line)
    }

    fn next_row(&mut self, element: &ElementDef, index: usize) -> Result<Row, LoadError> {
        let row = match self.encoding {
            Encoding::Ascii => return self.next_text_row(element, index),
            Encoding::BinaryBigEndian => {
                self.parser.read_big_endian_element(&mut self.rest, element)
            }
            Encoding::BinaryLittleEndian => self
                .parser
                .read_little_endian_element(&mut self.rest, element),
        };
        row.map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => self.truncated(element, index),
            _ => LoadError::BadElement {
                file: self.name.to_owned(),
                element: element.name.clone(),
                index,
                problem: error
                    .to_string()
                    .lines()
                    .next()
                    .unwrap_or_default()
                    .to_owned(),
            },
        })
    }

    fn next_text_row(&mut self, element: &ElementDef, index: usize) -> Result<Row, LoadError> {
        let Some(first) = self.next_line() else {
            return Err(self.truncated(element, index));
        };
        self.element_line = self.next_line - 1;
        let row = text(first).and_then(|text| {
            let mut words = Words {
                reader: self,
                of_line: text.split_ascii_whitespace(),
                lines: 1,
            };
            words.row(element)
        });
        row.map_err(|problem| LoadError::BadLine {
            file: self.name.to_owned(),
            line: self.element_line,
            problem: format!("{} {index}: {problem}: {}", element.name, quoted(first)),
        })
    }

    /// Takes the next line that is not blank.
    fn next_line(&mut self) -> Option<&'a [u8]> {
        while !self.rest.is_empty() {
            let (line, rest) = header::first_line(self.rest);
            self.rest = rest;
            self.next_line += 1;
            let line = line.trim_ascii();
            if !line.is_empty() {
                return Some(line);
            }
        }
        None
    }

    fn truncated(&self, element: &ElementDef, index: usize) -> LoadError {
        LoadError::Truncated {
            file: self.name.to_owned(),
            element: element.name.clone(),
            index,
            count: element.count,
        }
    }
}

fn text(line: &[u8]) -> Result<&str, &'static str> {
    std::str::from_utf8(line).map_err(|_| "not text")
}

impl<'a> Words<'_, 'a> {
    /// The next word of the element, which may be on another line.
    fn next(&mut self) -> Result<&'a str, &'static str> {
        loop {
            if let Some(word) = self.of_line.next() {
                return Ok(word);
            }
            let line = self.reader.next_line().ok_or(TOO_FEW)?;
            self.of_line = text(line)?.split_ascii_whitespace();
            self.lines += 1;
        }
    }

    fn row(&mut self, element: &ElementDef) -> Result<Row, &'static str> {
        let mut row = Row::default();
        for (property, definition) in &element.properties {
            let word = self.next()?;
            match definition.data_type {
                PropertyType::Scalar(ref scalar) => {
                    row.set(property, number(word, scalar)?);
                }
                PropertyType::List(_, ref scalar) => {
                    let count: usize = word.parse().map_err(|_| "bad list count")?;
                    let is_corners = is_corner_list(property);
                    for _ in 0..count {
                        let word = self.next()?;
                        if is_corners {
                            row.corners.push(word.parse().map_err(|_| "bad number")?);
                        } else {
                            number(word, scalar)?;
                        }
                    }
                }
            }
        }
        match self.of_line.next() {
            None => Ok(row),
            // The values of the next element.
            Some(_) if self.lines > 1 => Err(TOO_FEW),
            Some(_) => Err(TOO_MANY),
        }
    }
}

/// Parses a number and rounds it to the declared type, so that text and binary files give equal meshes.
fn number(word: &str, scalar: &ScalarType) -> Result<f64, &'static str> {
    match scalar {
        ScalarType::Float => word.parse::<f32>().map(f64::from),
        _ => word.parse::<f64>(),
    }
    .map_err(|_| "bad number")
}
