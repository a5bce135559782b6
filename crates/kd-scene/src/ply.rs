//! Reader of PLY.
//!
//! Elements are read from the bytes of the file, whatever the header says of their number, so that the size of the file bounds the
//! memory. The crate `ply-rs-bw`, which kd used before, allocates what a header claims, and reads one property at a time.

mod binary;
mod header;
mod text;

use std::io::Read;

use kd_core::Mesh;

use crate::LoadError;
use crate::file_mesh::{Corner, FacePlace, FileMesh};
use crate::report::{Report, Strictness, WarningCode};
use crate::source::Source;
use binary::BinaryRows;
use header::{Element, Encoding, Kind, read_header};
use text::TextRows;

/// Reads a PLY file as a mesh: text, or binary in either byte order. Errors name the file `name`.
///
/// The reader uses the scalar properties `x`, `y`, `z` of `vertex`, of any number type, the list `vertex_indices` or `vertex_index` of
/// `face`, of any integer type, with indices from 0, and the same list of `tristrips`, where -1 ends a strip. It skips other properties
/// and elements. Vertices keep their order. Convex polygons become fans of triangles, concave ones are triangulated by ear clipping, in
/// file order. Without faces and strips, the mesh has no triangles. The values of an element may be on several lines, but no line has
/// those of two. The file is read piece by piece.
///
/// # Errors
///
/// [`LoadError`] with the line (header, text) or the element (binary): an invalid header, a name that is declared twice,
/// missing data, more values than an element has, an invalid number, a coordinate that is not finite in `f32`, a face of fewer than
/// three corners, an index out of range.
pub fn read_ply(reader: impl Read, name: &str) -> Result<Mesh, LoadError> {
    let mut source = Source::new(reader, None, name);
    read_ply_with(&mut source, &mut Report::new(Strictness::Usual))
}

/// [`read_ply`], with its warnings. A lenient reader leaves out damaged faces, and vertices that are not finite with the faces that use
/// them.
pub(crate) fn read_ply_with(
    source: &mut Source<'_>,
    report: &mut Report,
) -> Result<Mesh, LoadError> {
    let name = source.name;
    let header = read_header(source)?;
    let mut mesh = FileMesh::new(name);
    let mut rows = Rows {
        encoding: header.encoding,
        text: TextRows::new(header.lines),
    };
    for element in &header.elements {
        let role = Role::of(element).map_err(|problem| LoadError::BadHeader {
            file: name.to_owned(),
            problem,
        })?;
        rows.read(source, element, role, &mut mesh, report)?;
    }
    report_left_over(source, report)?;
    Ok(mesh.finish(report, |_, _, _| {})?.mesh)
}

/// Warns of data after the last element. A line end there is common and harmless.
fn report_left_over(source: &mut Source<'_>, report: &mut Report) -> Result<(), LoadError> {
    const PIECE: usize = 1 << 16;
    let (mut left, mut blanks) = (0, 0);
    loop {
        let bytes = source.at_least(PIECE)?;
        let length = bytes.len();
        if length == 0 {
            break;
        }
        let text = bytes.trim_ascii_end().len();
        if text > 0 {
            left += blanks + text;
            blanks = 0;
        }
        blanks += length - text;
        source.take(length);
    }
    if left > 0 {
        let what = format!("{left} bytes left over after the last element the header declares");
        report.warn(source.name, None, WarningCode::LeftOver, what);
    }
    Ok(())
}

/// What a mesh has of an element.
#[derive(Debug, Default)]
struct Row {
    position: [f32; 3],
    corners: Vec<Corner>,
}

impl Row {
    fn set(&mut self, property: &str, value: impl FnOnce() -> f32) {
        if let Some(axis) = axis_of(property) {
            self.position[axis] = value();
        }
    }
}

/// The axis of a coordinate.
fn axis_of(property: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|axis| *axis == property)
}

fn is_corner_list(property: &str) -> bool {
    matches!(property, "vertex_indices" | "vertex_index")
}

/// The role of an element in a mesh.
#[derive(Clone, Copy)]
enum Role {
    Vertex,
    Face,
    Strip,
    Other,
}

impl Role {
    /// Determines the role by the name, and checks that the required properties exist.
    fn of(element: &Element) -> Result<Self, String> {
        let kind_of = |name: &str| {
            let mut found = element.properties.iter().filter(|it| it.name == name);
            found.next().map(|property| property.kind)
        };
        match element.name.as_str() {
            "vertex" => {
                for axis in ["x", "y", "z"] {
                    if !matches!(kind_of(axis), Some(Kind::Scalar(_))) {
                        return Err(format!("`vertex` has no scalar property `{axis}`"));
                    }
                }
                Ok(Self::Vertex)
            }
            kind @ ("face" | "tristrips") => {
                let mut lists = element
                    .properties
                    .iter()
                    .filter(|it| is_corner_list(&it.name));
                let (Some(list), None) = (lists.next(), lists.next()) else {
                    let names = "`vertex_indices` and `vertex_index`";
                    return Err(format!("`{kind}` needs one of the lists {names}"));
                };
                match list.kind {
                    Kind::List { count, item } if count.is_integer() && item.is_integer() => {}
                    _ => return Err(format!("`{}` is not a list of integers", list.name)),
                }
                Ok(if kind == "face" {
                    Self::Face
                } else {
                    Self::Strip
                })
            }
            _ => Ok(Self::Other),
        }
    }
}

/// The data after the header.
struct Rows {
    encoding: Encoding,
    text: TextRows,
}

impl Rows {
    /// Reads all elements of a kind.
    fn read(
        &mut self,
        source: &mut Source<'_>,
        element: &Element,
        role: Role,
        mesh: &mut FileMesh<'_>,
        report: &mut Report,
    ) -> Result<(), LoadError> {
        // An element without properties has no data, for every count.
        if element.properties.is_empty() {
            return Ok(());
        }
        let is_text = self.encoding == Encoding::Text;
        let binary = BinaryRows::new(element, self.encoding);
        if !is_text {
            // The header claims a number, but the file has room for some only.
            let count = |size| element.count.min(source.room_for(size));
            match role {
                Role::Vertex => mesh.reserve(count(element.least_size()), 0)?,
                Role::Face => {
                    mesh.reserve(0, count(element.least_size() + 3 * element.item_size()))?;
                }
                Role::Strip | Role::Other => {}
            }
        }
        let mut row = Row::default();
        for index in 0..element.count {
            if is_text {
                self.text.next(source, element, index, &mut row)?;
            } else {
                binary.next(source, index, &mut row)?;
            }
            let line = is_text.then_some(self.text.line);
            let place = FacePlace {
                number: index,
                line,
            };
            match role {
                Role::Vertex => mesh.vertex(row.position, line, report)?,
                Role::Face => {
                    mesh.face(&row.corners, place, report)?;
                }
                Role::Strip => add_strips(&row.corners, place, mesh, report)?,
                Role::Other => {}
            }
        }
        Ok(())
    }
}

/// Adds the triangles of strips, which -1 separates. Every second triangle of a strip is reversed.
fn add_strips(
    corners: &[Corner],
    place: FacePlace,
    mesh: &mut FileMesh<'_>,
    report: &mut Report,
) -> Result<(), LoadError> {
    for strip in corners.split(|corner| corner.written == -1) {
        for (number, corners) in strip.windows(3).enumerate() {
            let [a, b, c] = [0, 1, 2].map(|i| corners[i]);
            // A repeated corner joins two strips.
            if a == b || b == c || c == a {
                continue;
            }
            let triangle = if number % 2 == 0 {
                [a, b, c]
            } else {
                [b, a, c]
            };
            mesh.face(&triangle, place, report)?;
        }
    }
    Ok(())
}
