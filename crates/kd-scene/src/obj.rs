//! Reader of Wavefront OBJ.
//!
//! One pass over the statements collects vertices and triangles. A scene also takes the attributes and the materials of faces on the way
//! ([`scene`]).

#[cfg(feature = "scenes")]
mod material;
#[cfg(feature = "scenes")]
mod scene;
mod statements;

use std::io::Read;

use kd_core::Mesh;

use crate::LoadError;
use crate::error::quoted;
use crate::file_mesh::{Corner, FacePlace, FileMesh, ReadMesh};
use crate::report::{Place, Report, Strictness, WarningCode};
use crate::source::Source;
use crate::words::{Words, integer, number};
#[cfg(feature = "scenes")]
pub use scene::read_obj_scene;
#[cfg(feature = "scenes")]
pub(crate) use scene::read_obj_scene_with;
use statements::Statements;

/// Reads the geometry of a Wavefront OBJ file as a mesh. Errors name the file `name`.
///
/// All objects, groups and materials form one mesh, with vertices and faces in file order. Convex polygons become fans of triangles,
/// concave ones are triangulated by ear clipping. Negative (relative) indices are valid, and so are faces before their vertices. Faces of
/// fewer than three corners, weights, colors, points and lines are left out; [`load_mesh_with`](crate::load_mesh_with) returns a warning
/// for each kind. The file is read piece by piece.
///
/// # Errors
///
/// [`LoadError`] with the line: an invalid number, an index out of range (such as 0), a coordinate that is not finite, a free-form curve
/// or surface.
pub fn read_obj(reader: impl Read, name: &str) -> Result<Mesh, LoadError> {
    let mut source = Source::new(reader, None, name);
    read_obj_with(&mut source, &mut Report::new(Strictness::Usual))
}

/// [`read_obj`], with its warnings.
pub(crate) fn read_obj_with(
    source: &mut Source<'_>,
    report: &mut Report,
) -> Result<Mesh, LoadError> {
    let mesh = FileMesh::new(source.name);
    Ok(read_with(source, mesh, report, &mut Plain)?.mesh)
}

/// What a reader takes beside the geometry.
trait Beside {
    /// What a face has, for triangles that are set later.
    type Face;

    /// A statement that is no vertex and no face. Returns whether the keyword is known.
    fn statement(
        &mut self,
        keyword: &[u8],
        statement: &[u8],
        line: usize,
        report: &mut Report,
    ) -> bool;

    /// A face of at least three corners is next.
    fn face(&mut self, statement: &[u8], line: usize, report: &mut Report);

    /// A triangle of that face, by its number and as numbers of corners.
    fn triangle(&mut self, number: usize, corners: [usize; 3]);

    /// Returns the face for [`restore`](Self::restore).
    fn keep(&mut self) -> Self::Face;

    /// Makes a face the next one.
    fn restore(&mut self, face: Self::Face);
}

/// Nothing.
struct Plain;

impl Beside for Plain {
    type Face = ();

    fn statement(&mut self, keyword: &[u8], _: &[u8], _: usize, _: &mut Report) -> bool {
        let of_looks = [&b"vn"[..], b"vt", b"mtllib", b"usemtl"];
        of_looks.contains(&keyword)
    }

    fn face(&mut self, _: &[u8], _: usize, _: &mut Report) {}
    fn triangle(&mut self, _: usize, _: [usize; 3]) {}
    fn keep(&mut self) -> Self::Face {}
    fn restore(&mut self, (): Self::Face) {}
}

/// Statements that neither a mesh nor a scene has a use for, and that change nothing.
const SILENT: [&[u8]; 4] = [b"o", b"g", b"s", b"mg"];

/// Reads a file. The triangles that were left out have had their turn with `beside`.
fn read_with<B: Beside>(
    source: &mut Source<'_>,
    mut mesh: FileMesh<'_>,
    report: &mut Report,
    beside: &mut B,
) -> Result<ReadMesh, LoadError> {
    let name = source.name;
    let mut corners = Vec::new();
    let mut faces = 0;
    let mut kept = Vec::new();
    let mut statements = Statements::new(source)?;
    while let Some((line, statement)) = statements.next()? {
        let bad = |problem: &str| LoadError::BadLine {
            file: name.to_owned(),
            line,
            problem: format!("{problem}: {}", quoted(statement)),
        };
        if memchr::memchr(0, statement).is_some() {
            return Err(bad("not text"));
        }
        let mut words = Words::new(statement);
        let place = || Some(Place::Line(line));
        match words.next() {
            None => {}
            Some(b"v") => {
                let position = position(&mut words).map_err(bad)?;
                mesh.vertex(position, Some(line), report)?;
                let rest = words.clone().count();
                if rest == 1 {
                    let what = "the fourth coordinate, a weight of curves, is not used";
                    report.warn(name, place(), WarningCode::Unused, what);
                } else if rest >= 3 && mesh.has_looks() {
                    let mut color = [1.0; 3];
                    for channel in &mut color {
                        *channel = words.next().and_then(number).unwrap_or(1.0);
                    }
                    mesh.set_color(color);
                }
            }
            // `fo` is an obsolete spelling of `f`.
            Some(b"f" | b"fo") => {
                corners.clear();
                for word in words {
                    let corner = corner(word, mesh.vertices());
                    corners.push(corner.ok_or_else(|| bad("bad face"))?);
                }
                let number = faces;
                faces += 1;
                if corners.len() < 3 {
                    let what = "a face has fewer than three corners; it is left out";
                    report.warn(name, place(), WarningCode::FewCorners, what);
                    continue;
                }
                beside.face(statement, line, report);
                let first = mesh.triangles();
                let of_file = FacePlace {
                    number,
                    line: Some(line),
                };
                if !mesh.face(&corners, of_file, report)? {
                    kept.push(beside.keep());
                    continue;
                }
                for (number, corners) in (first..).zip(mesh.last()) {
                    beside.triangle(number, *corners);
                }
            }
            Some(b"curv" | b"curv2" | b"surf") => {
                return Err(bad("free-form curves and surfaces are not supported"));
            }
            Some(keyword) => {
                let is_known = beside.statement(keyword, statement, line, report);
                if !is_known && !SILENT.contains(&keyword) {
                    let what = format!("{} is not used", quoted(keyword));
                    report.warn(name, place(), WarningCode::Unused, what);
                }
            }
        }
    }
    let mut kept = kept.into_iter().map(Some).collect::<Vec<_>>();
    mesh.finish(report, |number, first, triangles| {
        if let Some(face) = kept[number].take() {
            beside.restore(face);
        }
        for (number, corners) in (first..).zip(triangles) {
            beside.triangle(number, *corners);
        }
    })
}

/// The corner of a word, after `vertices` vertices; `None` for a word that is no index.
#[inline]
fn corner(word: &[u8], vertices: usize) -> Option<Corner> {
    let end = word.iter().position(|byte| *byte == b'/');
    let written = integer(&word[..end.unwrap_or(word.len())])?;
    let vertex = if written < 0 {
        i64::try_from(vertices).ok()?.saturating_add(written)
    } else {
        written - 1
    };
    Some(Corner { vertex, written })
}

/// The three coordinates of a vertex, which the words begin with.
#[inline]
fn position(words: &mut Words<'_>) -> Result<[f32; 3], &'static str> {
    let mut position = [0.0; 3];
    for coordinate in &mut position {
        let word = words.next().ok_or("bad vertex")?;
        *coordinate = number(word).ok_or_else(|| match std::str::from_utf8(word) {
            Ok(_) => "bad vertex",
            Err(_) => "not text",
        })?;
    }
    Ok(position)
}
