//! Reader of Wavefront OBJ.
//!
//! One pass over the statements collects vertices and faces, which may precede their vertices. A scene also takes the attributes and
//! the materials of faces on the way ([`scene`]).

#[cfg(feature = "scenes")]
mod material;
#[cfg(feature = "scenes")]
mod scene;
mod statements;

use std::io::BufRead;

use glam::Vec3;
use kd_core::Mesh;

use crate::LoadError;
use crate::error::quoted;
use crate::polygon::triangles_of_face;
use crate::report::{Place, Report, Strictness, WarningCode};
#[cfg(feature = "scenes")]
pub use scene::read_obj_scene;
#[cfg(feature = "scenes")]
pub(crate) use scene::read_obj_scene_with;
use statements::{Statements, number, words};

/// Reads the geometry of a Wavefront OBJ file as a mesh. Errors name the file `name`.
///
/// All objects, groups and materials form one mesh, with the faces in file order. Convex polygons become fans of triangles, concave ones
/// are triangulated by ear clipping. Vertices are ordered by their first use in a face; unused vertices are dropped. Negative (relative)
/// indices are valid, and so are faces before their vertices. Faces of fewer than three corners, weights, colors, points and lines
/// are left out; [`load_mesh_with`](crate::load_mesh_with) returns a warning for each kind. The whole file is held in memory.
///
/// # Errors
///
/// [`LoadError`] with the line: an invalid number, an index out of range (such as 0), a coordinate that is not finite, a free-form curve
/// or surface.
pub fn read_obj(mut reader: impl BufRead, name: &str) -> Result<Mesh, LoadError> {
    let mut bytes = Vec::new();
    let read = reader.read_to_end(&mut bytes);
    read.map_err(|source| LoadError::Read {
        file: name.to_owned(),
        source,
    })?;
    read_obj_with(&bytes, name, &mut Report::new(Strictness::Usual))
}

/// [`read_obj`], with its warnings.
pub(crate) fn read_obj_with(
    bytes: &[u8],
    name: &str,
    report: &mut Report,
) -> Result<Mesh, LoadError> {
    let geometry = Geometry::read(bytes, name, report, &mut Plain)?;
    geometry.mesh(bytes, name, report, |_, _| {})
}

/// What a reader takes beside the geometry.
trait Beside {
    /// A statement that is no vertex and no face. Returns whether the keyword is known.
    fn statement(
        &mut self,
        keyword: &[u8],
        statement: &[u8],
        line: usize,
        report: &mut Report,
    ) -> bool;

    /// A face of at least three corners.
    fn face(&mut self, statement: &[u8], line: usize, report: &mut Report);
}

/// Nothing.
struct Plain;

impl Beside for Plain {
    fn statement(&mut self, keyword: &[u8], _: &[u8], _: usize, _: &mut Report) -> bool {
        let of_looks = [&b"vn"[..], b"vt", b"mtllib", b"usemtl"];
        of_looks.contains(&keyword)
    }

    fn face(&mut self, _: &[u8], _: usize, _: &mut Report) {}
}

/// Statements that neither a mesh nor a scene has a use for, and that change nothing.
const SILENT: [&[u8]; 4] = [b"o", b"g", b"s", b"mg"];

/// The vertices and the faces of a file.
#[derive(Debug, Default)]
struct Geometry {
    positions: Vec<[f32; 3]>,
    /// The vertices of all faces; some may not be there.
    corners: Vec<u32>,
    /// Where each face ends in `corners`.
    ends: Vec<usize>,
}

/// The vertex of an index that no file has.
const NOWHERE: u32 = u32::MAX;

impl Geometry {
    fn read(
        bytes: &[u8],
        name: &str,
        report: &mut Report,
        beside: &mut impl Beside,
    ) -> Result<Self, LoadError> {
        let mut geometry = Self::default();
        let mut statements = Statements::new(bytes);
        let mut statement = Vec::new();
        while let Some(line) = statements.next_into(&mut statement) {
            let bad = |problem: &str| LoadError::BadLine {
                file: name.to_owned(),
                line,
                problem: format!("{problem}: {}", quoted(&statement)),
            };
            if statement.contains(&0) {
                return Err(bad("not text"));
            }
            let mut words = words(&statement);
            let place = || Some(Place::Line(line));
            match words.next() {
                None => {}
                Some(b"v") => {
                    let position = position(words.clone()).map_err(bad)?;
                    if !Vec3::from(position).is_finite() {
                        return Err(LoadError::NotFinite {
                            file: name.to_owned(),
                            line: Some(line),
                            vertex: geometry.positions.len(),
                        });
                    }
                    geometry.positions.push(position);
                    match words.count() {
                        3 => {}
                        4 => {
                            let what = "the fourth coordinate, a weight of curves, is not used";
                            report.warn(name, place(), WarningCode::Unused, what);
                        }
                        _ => {
                            let what = "colors of vertices are not used";
                            report.warn(name, place(), WarningCode::Unused, what);
                        }
                    }
                }
                // `fo` is an obsolete spelling of `f`.
                Some(b"f" | b"fo") => {
                    let corners = words.clone().count();
                    if corners < 3 {
                        let what = "a face has fewer than three corners; it is left out";
                        report.warn(name, place(), WarningCode::FewCorners, what);
                        continue;
                    }
                    for word in words {
                        let corner = geometry.corner(word).ok_or_else(|| bad("bad face"))?;
                        geometry.corners.push(corner);
                    }
                    geometry.ends.push(geometry.corners.len());
                    beside.face(&statement, line, report);
                }
                Some(b"curv" | b"curv2" | b"surf") => {
                    return Err(bad("free-form curves and surfaces are not supported"));
                }
                Some(keyword) => {
                    let is_known = beside.statement(keyword, &statement, line, report);
                    if !is_known && !SILENT.contains(&keyword) {
                        let what = format!("{} is not used", quoted(keyword));
                        report.warn(name, place(), WarningCode::Unused, what);
                    }
                }
            }
        }
        Ok(geometry)
    }

    /// The vertex of a corner; `None` for a word that is no index. It may not be there.
    fn corner(&self, word: &[u8]) -> Option<u32> {
        let index = word.split(|byte| *byte == b'/').next()?;
        let index: i64 = std::str::from_utf8(index).ok()?.parse().ok()?;
        let number = match index {
            0 => return Some(NOWHERE),
            1.. => index - 1,
            _ => i64::try_from(self.positions.len())
                .ok()?
                .saturating_add(index),
        };
        Some(u32::try_from(number).unwrap_or(NOWHERE))
    }

    /// The triangles of all faces. `each` receives the face of each triangle, and its corners as numbers of corners of the face.
    fn mesh(
        mut self,
        bytes: &[u8],
        name: &str,
        report: &mut Report,
        mut each: impl FnMut(usize, [usize; 3]),
    ) -> Result<Mesh, LoadError> {
        let count = self.positions.len();
        if self.corners.iter().any(|corner| *corner as usize >= count) {
            return Err(self.first_bad_index(bytes, name));
        }
        let positions = self.in_order_of_use();
        let mut triangles = Vec::with_capacity(self.corners.len() - 2 * self.ends.len());
        let mut start = 0;
        for (face, end) in self.ends.iter().enumerate() {
            let corners = &self.corners[start..*end];
            start = *end;
            let mut add = |[a, b, c]: [usize; 3]| {
                triangles.push([corners[a], corners[b], corners[c]]);
                each(face, [a, b, c]);
            };
            if corners.len() == 3 {
                add([0, 1, 2]);
                continue;
            }
            let place = || Some(Place::Element("face".to_owned(), face));
            triangles_of_face(corners, &positions, name, place, report)
                .into_iter()
                .for_each(&mut add);
        }
        Mesh::new(positions, triangles).map_err(|source| LoadError::Mesh {
            file: name.to_owned(),
            source,
        })
    }

    /// The positions of vertices in the order of their first use, which numbers them again.
    fn in_order_of_use(&mut self) -> Vec<[f32; 3]> {
        let mut numbers = vec![NOWHERE; self.positions.len()];
        let mut used = Vec::with_capacity(self.positions.len());
        for corner in &mut self.corners {
            let number = &mut numbers[*corner as usize];
            if *number == NOWHERE {
                *number = u32::try_from(used.len()).expect("no more than there are vertices");
                used.push(self.positions[*corner as usize]);
            }
            *corner = *number;
        }
        used
    }

    /// The error of the first index that is out of range.
    fn first_bad_index(&self, bytes: &[u8], name: &str) -> LoadError {
        let vertices = self.positions.len();
        let mut statements = Statements::new(bytes);
        let mut statement = Vec::new();
        let (mut seen, mut face) = (0_i64, 0);
        while let Some(line) = statements.next_into(&mut statement) {
            let mut words = words(&statement);
            match words.next() {
                Some(b"v") => seen += 1,
                Some(b"f" | b"fo") if words.clone().count() >= 3 => {
                    for corner in words {
                        let index = corner.split(|byte| *byte == b'/').next();
                        let index = index.and_then(|index| std::str::from_utf8(index).ok());
                        let index: i64 = index.and_then(|index| index.parse().ok()).unwrap_or(0);
                        let number = if index < 0 {
                            seen.saturating_add(index)
                        } else {
                            index - 1
                        };
                        if usize::try_from(number).map_or(true, |number| number >= vertices) {
                            return LoadError::IndexOutOfRange {
                                file: name.to_owned(),
                                line: Some(line),
                                face,
                                index,
                                vertices,
                            };
                        }
                    }
                    face += 1;
                }
                _ => {}
            }
        }
        LoadError::BadHeader {
            file: name.to_owned(),
            problem: "a face has an index out of range".to_owned(),
        }
    }
}

/// The three coordinates of a vertex.
fn position<'a>(words: impl Iterator<Item = &'a [u8]> + Clone) -> Result<[f32; 3], &'static str> {
    if words.clone().any(|word| std::str::from_utf8(word).is_err()) {
        return Err("not text");
    }
    let mut numbers = words.map(number);
    let mut position = [0.0; 3];
    for coordinate in &mut position {
        *coordinate = numbers.next().flatten().ok_or("bad vertex")?;
    }
    Ok(position)
}
