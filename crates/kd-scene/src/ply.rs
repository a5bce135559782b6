//! Reader of PLY.
//!
//! Elements are read from the bytes of the file, whatever the header says of their number, so that the size of the file bounds the
//! memory. The crate `ply-rs-bw` (version 4.0.1) allocates what a header claims.

mod binary;
mod header;
mod text;

use std::io::Read;

use kd_core::Mesh;

use crate::LoadError;
use crate::file_mesh::{Corner, FacePlace, FileMesh, ReadMesh};
use crate::report::{Report, Strictness, WarningCode};
use crate::source::Source;
use binary::BinaryRows;
use header::{Element, Encoding, Kind, Scalar, read_header};
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
    let mesh = FileMesh::new(name);
    let read = read_ply_with(&mut source, mesh, &mut Report::new(Strictness::Usual))?;
    Ok(read.mesh)
}

/// Reads a file into `mesh`, with warnings. A lenient reader leaves out damaged faces, and vertices that are not finite with the faces that
/// use them.
pub(crate) fn read_ply_with(
    source: &mut Source<'_>,
    mut mesh: FileMesh<'_>,
    report: &mut Report,
) -> Result<ReadMesh, LoadError> {
    let name = source.name;
    let header = read_header(source, report)?;
    if mesh.has_looks() {
        report_unused(&header.elements, name, report);
    }
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
    mesh.finish(report, |_, _, _| {})
}

/// Warns of what a scene could have and does not take.
fn report_unused(elements: &[Element], file: &str, report: &mut Report) {
    for element in elements.iter().filter(|element| element.count > 0) {
        let is_used = |name: &str| match element.name.as_str() {
            "vertex" => place_of(name).is_some(),
            _ => is_corner_list(name),
        };
        let names = element
            .properties
            .iter()
            .map(|property| property.name.as_str());
        let unused: Vec<&str> = names.filter(|name| !is_used(name)).collect();
        if !unused.is_empty() {
            let what = format!("of `{}`, {} is not used", element.name, unused.join(", "));
            report.warn(file, None, WarningCode::Unused, what);
        }
    }
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
    /// The values of [`VALUES`], in this order; those that a vertex lacks are 0.
    values: [f32; VALUES.len()],
    corners: Vec<Corner>,
}

/// The properties of a vertex that are used: position, normal, color.
const VALUES: [&str; 9] = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"];

impl Row {
    fn set(&mut self, property: &str, value: impl FnOnce() -> f32) {
        if let Some(place) = place_of(property) {
            self.values[place] = value();
        }
    }

    fn three(&self, first: usize) -> [f32; 3] {
        [
            self.values[first],
            self.values[first + 1],
            self.values[first + 2],
        ]
    }
}

/// The place of a property among [`VALUES`].
fn place_of(property: &str) -> Option<usize> {
    VALUES.iter().position(|name| *name == property)
}

/// What vertices have beside their positions.
#[derive(Clone, Copy, Debug, Default)]
struct VertexHas {
    normal: bool,
    /// The value of a full channel of a color.
    full_color: Option<f32>,
}

impl VertexHas {
    fn of(element: &Element) -> Self {
        let scalar_of = |name: &str| match element.kind_of(name)? {
            Kind::Scalar(scalar) => Some(scalar),
            Kind::List { .. } => None,
        };
        let has = |names: &[&str]| names.iter().all(|name| scalar_of(name).is_some());
        let full = |scalar: Scalar| match scalar {
            Scalar::F32 | Scalar::F64 => 1.0,
            Scalar::U16 => 65535.0,
            Scalar::I16 => 32767.0,
            _ => 255.0,
        };
        let full_color = scalar_of("red").map(full);
        Self {
            normal: has(&VALUES[3..6]),
            full_color: full_color.filter(|_| has(&VALUES[6..])),
        }
    }
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
        match element.name.as_str() {
            "vertex" => {
                for axis in ["x", "y", "z"] {
                    if !matches!(element.kind_of(axis), Some(Kind::Scalar(_))) {
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
        let has = if mesh.has_looks() {
            VertexHas::of(element)
        } else {
            VertexHas::default()
        };
        for index in 0..element.count {
            if is_text {
                self.text.next(source, element, index, &mut row, report)?;
            } else {
                binary.next(source, index, &mut row)?;
            }
            let line = is_text.then_some(self.text.line);
            let place = FacePlace {
                number: index,
                line,
            };
            match role {
                Role::Vertex => {
                    mesh.vertex(row.three(0), line, report)?;
                    if has.normal {
                        mesh.set_normal(row.three(3));
                    }
                    if let Some(full) = has.full_color {
                        mesh.set_color(row.three(6).map(|channel| channel / full));
                    }
                }
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
    // An unsigned -1 is the largest number of 32 bits.
    let ends_strip = |corner: &Corner| [-1, i64::from(u32::MAX)].contains(&corner.written);
    for strip in corners.split(ends_strip) {
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
