//! The vertices and faces of a file while they are read, the same for all formats of polygons.

#[cfg(feature = "scenes")]
use glam::Vec3;
use kd_core::Mesh;

use crate::LoadError;
#[cfg(feature = "scenes")]
use crate::SceneDescription;
use crate::memory::check_room;
use crate::polygon::triangles_of_face;
use crate::report::{Place, Report, WarningCode};

/// The mesh of a file under construction. Faces may precede their vertices.
#[derive(Debug)]
pub(crate) struct FileMesh<'a> {
    file: &'a str,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Vertices that are not finite, in ascending order. A vertex in their place has some finite position.
    not_finite: Vec<u32>,
    /// Faces with vertices that are not there yet.
    waiting: Vec<WaitingFace>,
    /// The triangles of the face that was added last, as numbers of its corners.
    last: Vec<[usize; 3]>,
    /// The corners of the face that was added last.
    corners: Vec<u32>,
    /// What vertices have beside their positions; `None` if that is not wanted.
    looks: Option<VertexLooks>,
}

/// What vertices have beside their positions. An array ends with the last vertex that has one.
#[derive(Debug, Default)]
pub(crate) struct VertexLooks {
    pub(crate) colors: Vec<[f32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
}

/// A face in a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacePlace {
    /// The number of the face, from 0.
    pub(crate) number: usize,
    /// Its line, in a text.
    pub(crate) line: Option<usize>,
}

/// The vertex of a corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Corner {
    /// The number of the vertex, from 0. No vertex has a negative number.
    pub(crate) vertex: i64,
    /// The index as the file writes it.
    pub(crate) written: i64,
}

impl Corner {
    /// A corner of a format that counts vertices from 0.
    pub(crate) fn from_zero(index: i64) -> Self {
        Self {
            vertex: index,
            written: index,
        }
    }
}

#[derive(Debug)]
struct WaitingFace {
    place: FacePlace,
    corners: Vec<Corner>,
    /// The number of its first triangle; its triangles have places already.
    first: usize,
}

/// The corners of a triangle that is left out.
const LEFT_OUT: [u32; 3] = [u32::MAX; 3];

/// A mesh that was read.
#[cfg_attr(
    not(feature = "scenes"),
    expect(dead_code, reason = "a mesh alone needs no looks")
)]
pub(crate) struct ReadMesh {
    pub(crate) mesh: Mesh,
    /// The numbers that triangles had which are left out, in ascending order.
    pub(crate) left_out: Vec<usize>,
    pub(crate) looks: VertexLooks,
}

impl<'a> FileMesh<'a> {
    pub(crate) fn new(file: &'a str) -> Self {
        Self {
            file,
            positions: Vec::new(),
            triangles: Vec::new(),
            not_finite: Vec::new(),
            waiting: Vec::new(),
            last: Vec::new(),
            corners: Vec::new(),
            looks: None,
        }
    }

    /// A mesh that also takes colors and normals of vertices.
    #[cfg(feature = "scenes")]
    pub(crate) fn with_looks(file: &'a str) -> Self {
        Self {
            looks: Some(VertexLooks::default()),
            ..Self::new(file)
        }
    }

    /// Whether colors and normals of vertices are taken.
    pub(crate) fn has_looks(&self) -> bool {
        self.looks.is_some()
    }

    /// Sets the color of the vertex that was added last. Channels are clamped to 0..=1; NaN becomes 1.
    pub(crate) fn set_color(&mut self, color: [f32; 3]) {
        if let Some(looks) = &mut self.looks {
            looks.colors.resize(self.positions.len() - 1, [1.0; 3]);
            let channel = |channel: f32| {
                if channel.is_nan() {
                    1.0
                } else {
                    channel.clamp(0.0, 1.0)
                }
            };
            looks.colors.push(color.map(channel));
        }
    }

    /// Sets the normal of the vertex that was added last.
    pub(crate) fn set_normal(&mut self, normal: [f32; 3]) {
        if let Some(looks) = &mut self.looks {
            let is_finite = normal.iter().all(|coordinate| coordinate.is_finite());
            looks.normals.resize(self.positions.len() - 1, [0.0; 3]);
            looks
                .normals
                .push(if is_finite { normal } else { [0.0; 3] });
        }
    }

    /// Reserves memory for vertices and triangles that the file has room for.
    ///
    /// # Errors
    ///
    /// [`LoadError::Read`] if there is not enough.
    pub(crate) fn reserve(&mut self, vertices: usize, triangles: usize) -> Result<(), LoadError> {
        let bytes = (vertices as u64 + triangles as u64).saturating_mul(12);
        let done = check_room(bytes).and_then(|()| {
            self.positions.try_reserve_exact(vertices)?;
            Ok(self.triangles.try_reserve_exact(triangles)?)
        });
        done.map_err(|source| LoadError::Read {
            file: self.file.to_owned(),
            source,
        })
    }

    /// The number of vertices so far.
    pub(crate) fn vertices(&self) -> usize {
        self.positions.len()
    }

    /// The number of triangles so far.
    pub(crate) fn triangles(&self) -> usize {
        self.triangles.len()
    }

    /// Adds a vertex. One that is not finite is an error, or left out by a lenient reader.
    #[inline]
    pub(crate) fn vertex(
        &mut self,
        position: [f32; 3],
        line: Option<usize>,
        report: &mut Report,
    ) -> Result<(), LoadError> {
        if position.iter().all(|coordinate| coordinate.is_finite()) {
            push(&mut self.positions, position);
            return Ok(());
        }
        self.vertex_not_finite(line, report)
    }

    #[cold]
    fn vertex_not_finite(
        &mut self,
        line: Option<usize>,
        report: &mut Report,
    ) -> Result<(), LoadError> {
        let vertex = self.positions.len();
        let error = LoadError::NotFinite {
            file: self.file.to_owned(),
            line,
            vertex,
        };
        let what = "a vertex is not finite; it is left out";
        report.leave_out(
            error,
            place(line, "vertex", vertex),
            WarningCode::NotFinite,
            what,
        )?;
        self.not_finite
            .push(u32::try_from(vertex).unwrap_or(u32::MAX));
        // No triangle uses it: in the place of another vertex it changes no box.
        self.positions
            .push(self.positions.last().copied().unwrap_or_default());
        Ok(())
    }

    /// Adds a face, and returns whether its vertices are there. If not, its triangles have places, and
    /// [`finish`](Self::finish) sets them.
    #[inline]
    pub(crate) fn face(
        &mut self,
        corners: &[Corner],
        place: FacePlace,
        report: &mut Report,
    ) -> Result<bool, LoadError> {
        if let &[a, b, c] = corners
            && self.not_finite.is_empty()
            && let [Some(a), Some(b), Some(c)] = [a, b, c].map(|corner| self.known(corner))
        {
            self.last.clear();
            self.last.push([0, 1, 2]);
            push(&mut self.triangles, [a, b, c]);
            return Ok(true);
        }
        self.any_face(corners, place, report)
    }

    /// The triangles of the face that was added last, as numbers of its corners.
    pub(crate) fn last(&self) -> &[[usize; 3]] {
        &self.last
    }

    fn any_face(
        &mut self,
        corners: &[Corner],
        place: FacePlace,
        report: &mut Report,
    ) -> Result<bool, LoadError> {
        self.last.clear();
        if corners.len() < 3 {
            let error = LoadError::TooFewCorners {
                file: self.file.to_owned(),
                line: place.line,
                face: place.number,
                corners: corners.len(),
            };
            let what = "a face has fewer than three corners; it is left out";
            report.leave_out(error, place.of_face(), WarningCode::FewCorners, what)?;
            return Ok(true);
        }
        let first = self.triangles.len();
        let are_there = self.take_corners(corners);
        if are_there && self.triangulate(place, report) {
            for corners in &self.last {
                let corners = corners.map(|corner| self.corners[corner]);
                push(&mut self.triangles, corners);
            }
        } else if !are_there {
            self.triangles.resize(first + corners.len() - 2, LEFT_OUT);
            self.waiting.push(WaitingFace {
                place,
                corners: corners.to_vec(),
                first,
            });
        }
        Ok(are_there)
    }

    /// The vertex of a corner, if it is there.
    #[inline]
    fn known(&self, corner: Corner) -> Option<u32> {
        let vertex = u32::try_from(corner.vertex).ok()?;
        ((vertex as usize) < self.positions.len()).then_some(vertex)
    }

    /// Sets `corners` to those of a face up to the first that is not there. Returns whether all are.
    fn take_corners(&mut self, corners: &[Corner]) -> bool {
        let mut of_face = std::mem::take(&mut self.corners);
        of_face.clear();
        of_face.extend(corners.iter().map_while(|corner| self.known(*corner)));
        self.corners = of_face;
        self.corners.len() == corners.len()
    }

    /// Sets `last` to the triangles of `corners`. Returns whether the face is kept.
    fn triangulate(&mut self, place: FacePlace, report: &mut Report) -> bool {
        self.last.clear();
        let is_bad = |corner: &u32| self.not_finite.binary_search(corner).is_ok();
        if !self.not_finite.is_empty() && self.corners.iter().any(is_bad) {
            let what = "a face uses a vertex that is not finite; it is left out";
            report.warn(self.file, place.of_face(), WarningCode::NotFinite, what);
            return false;
        }
        if self.corners.len() == 3 {
            self.last.push([0, 1, 2]);
            return true;
        }
        let at = || place.of_face();
        self.last = triangles_of_face(&self.corners, &self.positions, self.file, at, report);
        true
    }

    /// The mesh, after the faces that wait for their vertices. `each` receives the number of such a face among those that wait, the number
    /// of its first triangle, and its triangles as numbers of corners.
    pub(crate) fn finish(
        mut self,
        report: &mut Report,
        mut each: impl FnMut(usize, usize, &[[usize; 3]]),
    ) -> Result<ReadMesh, LoadError> {
        for (number, face) in std::mem::take(&mut self.waiting).into_iter().enumerate() {
            let WaitingFace {
                place,
                corners,
                first,
            } = face;
            if !self.take_corners(&corners) {
                let error = LoadError::IndexOutOfRange {
                    file: self.file.to_owned(),
                    line: place.line,
                    face: place.number,
                    index: corners[self.corners.len()].written,
                    vertices: self.positions.len(),
                };
                let what = "a face has an index out of range; it is left out";
                report.leave_out(error, place.of_face(), WarningCode::BadIndex, what)?;
                continue;
            }
            if self.triangulate(place, report) {
                for (to, corners) in self.triangles[first..].iter_mut().zip(&self.last) {
                    *to = corners.map(|corner| self.corners[corner]);
                }
                each(number, first, &self.last);
            }
        }
        let mut left_out = Vec::new();
        if self.triangles.contains(&LEFT_OUT) {
            let numbered = self.triangles.iter().enumerate();
            let gone = numbered.filter(|(_, corners)| **corners == LEFT_OUT);
            left_out.extend(gone.map(|(number, _)| number));
            self.triangles.retain(|corners| *corners != LEFT_OUT);
        }
        self.positions.shrink_to_fit();
        self.triangles.shrink_to_fit();
        let mesh = Mesh::new(self.positions, self.triangles).map_err(|source| LoadError::Mesh {
            file: self.file.to_owned(),
            source,
        })?;
        Ok(ReadMesh {
            mesh,
            left_out,
            looks: self.looks.unwrap_or_default(),
        })
    }
}

#[cfg(feature = "scenes")]
impl ReadMesh {
    /// A scene of the mesh, with the colors and the normals of its vertices.
    pub(crate) fn into_scene(self) -> SceneDescription {
        let Self { mesh, looks, .. } = self;
        let VertexLooks { colors, normals } = looks;
        let of_triangles = |all: &[[f32; 3]], default: f32| -> Vec<[Vec3; 3]> {
            if all.is_empty() {
                return Vec::new();
            }
            let of_corner = |corner: u32| all.get(corner as usize).copied().unwrap_or([default; 3]);
            let triangles = mesh.triangles().iter();
            triangles
                .map(|corners| corners.map(|corner| of_corner(corner).into()))
                .collect()
        };
        let (colors, normals) = (of_triangles(&colors, 1.0), of_triangles(&normals, 0.0));
        let mut scene = SceneDescription::of_mesh(mesh);
        let surface = &mut scene.parts[0].surface;
        (surface.colors, surface.normals) = (colors, normals);
        scene
    }
}

/// Adds an element. Memory grows by half, so that less than twice of what is kept is ever taken.
#[inline]
fn push<T>(all: &mut Vec<T>, element: T) {
    if all.len() == all.capacity() {
        all.reserve_exact(all.len() / 2 + 64);
    }
    all.push(element);
}

impl FacePlace {
    fn of_face(self) -> Option<Place> {
        place(self.line, "face", self.number)
    }
}

/// A line of a text file, or an element of a binary one.
fn place(line: Option<usize>, kind: &str, index: usize) -> Option<Place> {
    Some(match line {
        Some(line) => Place::Line(line),
        None => Place::Element(kind.to_owned(), index),
    })
}
