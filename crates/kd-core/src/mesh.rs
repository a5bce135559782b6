//! Triangle meshes, checked once.

use glam::{Affine3A, Vec3, Vec3A};
use thiserror::Error;

use crate::Aabb;

/// Most triangles a mesh may have: builders keep a triangle's number in 30 bits.
pub const MAX_TRIANGLES: usize = (1 << 30) - 1;

/// An indexed triangle mesh whose positions are finite and whose indices are in range.
///
/// It is checked when it is made and cannot be changed after, so everything behind it relies on that. A mesh without
/// triangles is valid: nothing hits it. Triangles of zero area are valid too: they are kept, so that triangle numbers
/// stay the caller's, counted by [`zero_area_count`](Self::zero_area_count), and never hurt.
///
/// Memory: 12 bytes a vertex and 12 bytes a triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    bounds: Aabb,
}

/// Why a mesh was refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Its number, from 0.
        vertex: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error(
        "triangle {triangle}, corner {corner}: index {index} is out of range, there are {vertices} vertices"
    )]
    IndexOutOfRange {
        /// The triangle's number, from 0.
        triangle: usize,
        /// 0, 1 or 2.
        corner: usize,
        /// The index it holds.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// New positions for a mesh that has another number of vertices.
    #[error("{given} positions for a mesh of {vertices} vertices")]
    VertexCount {
        /// How many were given.
        given: usize,
        /// How many vertices there are.
        vertices: usize,
    },
    /// More than [`MAX_TRIANGLES`] triangles.
    #[error("{triangles} triangles are too many, at most {MAX_TRIANGLES} fit")]
    TooLarge {
        /// How many there are.
        triangles: usize,
    },
}

impl Mesh {
    /// A mesh of `triangles`, each three indices into `positions`.
    ///
    /// Vertices that no triangle uses are allowed (and do not count towards the bounds), but must be finite too.
    ///
    /// # Errors
    ///
    /// [`MeshError`] names the first vertex or triangle that breaks a rule.
    pub fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        if triangles.len() > MAX_TRIANGLES {
            return Err(MeshError::TooLarge {
                triangles: triangles.len(),
            });
        }
        check_finite(&positions)?;
        let vertices = positions.len();
        for (triangle, indices) in triangles.iter().enumerate() {
            if let Some(corner) = indices.iter().position(|&i| i as usize >= vertices) {
                return Err(MeshError::IndexOutOfRange {
                    triangle,
                    corner,
                    index: indices[corner],
                    vertices,
                });
            }
        }
        Ok(Self::checked(positions, triangles))
    }

    /// What [`new`](Self::new) would accept.
    fn checked(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        let corners = triangles.iter().flatten();
        let nothing = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (min, max) = corners.fold(nothing, |(min, max), &i| {
            let corner = Vec3A::from(positions[i as usize]);
            (min.min(corner), max.max(corner))
        });
        let bounds = if triangles.is_empty() {
            Aabb::EMPTY
        } else {
            Aabb {
                min: min.into(),
                max: max.into(),
            }
        };
        Self {
            positions,
            triangles,
            bounds,
        }
    }

    /// All meshes as one: vertices and triangles of each after those of the one before.
    ///
    /// # Errors
    ///
    /// [`MeshError::TooLarge`].
    ///
    /// # Panics
    ///
    /// If there are 2³² vertices or more, 48 GiB of them.
    pub fn concatenated<'a>(meshes: impl IntoIterator<Item = &'a Self>) -> Result<Self, MeshError> {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for mesh in meshes {
            let first = u32::try_from(positions.len()).expect("fewer than 2^32 vertices");
            positions.extend_from_slice(&mesh.positions);
            let own = mesh.triangles.iter();
            triangles.extend(own.map(|corners| corners.map(|corner| first + corner)));
        }
        if triangles.len() > MAX_TRIANGLES {
            return Err(MeshError::TooLarge {
                triangles: triangles.len(),
            });
        }
        Ok(Self::checked(positions, triangles))
    }

    /// The same triangles over other positions, one for each vertex. Faster than [`new`](Self::new): indices have been
    /// checked.
    ///
    /// # Errors
    ///
    /// [`MeshError::VertexCount`] and [`MeshError::NotFinite`].
    pub fn with_positions(&self, positions: Vec<[f32; 3]>) -> Result<Self, MeshError> {
        if positions.len() != self.positions.len() {
            return Err(MeshError::VertexCount {
                given: positions.len(),
                vertices: self.positions.len(),
            });
        }
        check_finite(&positions)?;
        Ok(Self::checked(positions, self.triangles.clone()))
    }

    /// The mesh moved by a transform, which may be any: mirrored triangles turn their other side, flattened ones may have
    /// no area.
    ///
    /// # Errors
    ///
    /// [`MeshError::NotFinite`] names the first vertex that is moved to where f32 ends.
    pub fn transformed(&self, by: &Affine3A) -> Result<Self, MeshError> {
        let moved = |position: &[f32; 3]| by.transform_point3a(Vec3A::from(*position)).to_array();
        self.with_positions(self.positions.iter().map(moved).collect())
    }

    /// The vertices.
    #[inline]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Three indices into [`positions`](Self::positions) per triangle, as they were given.
    #[inline]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// How many triangles there are.
    #[inline]
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether there are no triangles.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The box around all triangles; [`Aabb::EMPTY`] without any.
    #[inline]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// How many triangles have an area of exactly zero (two equal corners, or all on a line). Looks at each of them.
    pub fn zero_area_count(&self) -> usize {
        let all = 0..self.len();
        all.filter(|&triangle| has_zero_area(self.corners_at(triangle)))
            .count()
    }

    /// The three corners of a triangle.
    ///
    /// # Panics
    ///
    /// If the mesh has no such triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.corners_at(triangle as usize)
    }

    /// The unit normal of a triangle, to the side from which its corners run counter-clockwise; zero for a triangle
    /// of zero area.
    ///
    /// # Panics
    ///
    /// If the mesh has no such triangle.
    pub fn normal(&self, triangle: u32) -> Vec3 {
        let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
        (b - a).cross(c - a).normalize_or_zero().as_vec3()
    }

    /// Bytes held, vertices and indices.
    pub fn bytes(&self) -> usize {
        size_of_val(self.positions.as_slice()) + size_of_val(self.triangles.as_slice())
    }

    #[inline]
    fn corners_at(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| Vec3::from(self.positions[i as usize]))
    }
}

fn check_finite(positions: &[[f32; 3]]) -> Result<(), MeshError> {
    let is_finite = |position: &[f32; 3]| Vec3::from(*position).is_finite();
    match positions.iter().position(|position| !is_finite(position)) {
        Some(vertex) => Err(MeshError::NotFinite { vertex }),
        None => Ok(()),
    }
}

/// f64 products of f32 differences are near enough exact that only true zeros (and areas that a ray could not meet
/// anyway) compare equal to zero.
fn has_zero_area([a, b, c]: [Vec3; 3]) -> bool {
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    (b - a).cross(c - a) == glam::DVec3::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f32; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    #[test]
    fn bad_meshes_are_refused_by_element() {
        let rows = [
            (
                vec![[0.0; 3], [0.0, f32::NAN, 0.0]],
                Vec::<[u32; 3]>::new(),
                "vertex 1 is not finite",
            ),
            (
                vec![[f32::NEG_INFINITY, 0.0, 0.0]],
                vec![],
                "vertex 0 is not finite",
            ),
            (
                SQUARE.to_vec(),
                vec![[0, 1, 2], [0, 4, 2]],
                "triangle 1, corner 1: index 4 is out of range, there are 4 vertices",
            ),
            (
                vec![],
                vec![[0, 0, 0]],
                "triangle 0, corner 0: index 0 is out of range, there are 0 vertices",
            ),
        ];
        for (positions, triangles, message) in rows {
            let error = Mesh::new(positions, triangles).expect_err(message);
            assert_eq!(error.to_string(), message, "the message names the element");
        }
    }

    #[test]
    fn zero_area_is_counted_and_kept() {
        let triangles = vec![[0, 1, 2], [0, 0, 1], [1, 1, 1], [0, 2, 3]];
        let mesh = Mesh::new(SQUARE.to_vec(), triangles.clone()).expect("valid");
        assert_eq!(mesh.zero_area_count(), 2, "two of them");
        assert_eq!(mesh.triangles(), triangles, "all of them stay");
        assert_eq!(mesh.normal(0), Vec3::Z, "counter-clockwise seen from +z");
        assert_eq!(mesh.normal(1), Vec3::ZERO, "no area, no normal");
    }

    #[test]
    fn moved_meshes_are_checked_again() {
        let mesh = Mesh::new(SQUARE.to_vec(), vec![[0, 1, 2]]).expect("valid");
        let short = mesh.with_positions(SQUARE[1..].to_vec());
        let message = "3 positions for a mesh of 4 vertices";
        assert_eq!(short.expect_err("one is missing").to_string(), message);
        let mut bad = SQUARE.to_vec();
        bad[2][1] = f32::NAN;
        let refused = mesh.with_positions(bad).expect_err("NaN");
        assert_eq!(refused, MeshError::NotFinite { vertex: 2 });
        let huge =
            Affine3A::from_scale(Vec3::splat(f32::MAX)) * Affine3A::from_scale(Vec3::splat(2.0));
        let refused = mesh.transformed(&huge).expect_err("overflows");
        assert_eq!(refused, MeshError::NotFinite { vertex: 0 });
        let up = mesh.transformed(&Affine3A::from_translation(Vec3::Z));
        let up = up.expect("finite");
        assert_eq!(
            (up.bounds().min.z, up.triangles()),
            (1.0, mesh.triangles()),
            "moved"
        );
    }

    #[test]
    fn meshes_are_put_one_after_the_other() {
        let one = Mesh::new(SQUARE.to_vec(), vec![[0, 1, 2]]).expect("valid");
        let none = Mesh::new(vec![[9.0; 3]], vec![]).expect("valid");
        let all = Mesh::concatenated([&one, &none, &one]).expect("few");
        assert_eq!(all.triangles(), [[0, 1, 2], [5, 6, 7]], "numbered on");
        assert_eq!(all.corners(1), one.corners(0), "the same triangle");
        assert_eq!(all.bounds(), one.bounds(), "used ones only");
        let nothing = Mesh::concatenated([]).expect("few");
        assert!(nothing.bounds().is_empty(), "nothing at all");
    }

    #[test]
    fn bounds_ignore_unused_vertices() {
        let mut positions = SQUARE.to_vec();
        positions.push([9.0; 3]);
        let mesh = Mesh::new(positions, vec![[0, 1, 2]]).expect("valid");
        assert_eq!(
            mesh.bounds().max,
            Vec3::new(1.0, 1.0, 0.0),
            "used ones only"
        );
        let empty = Mesh::new(SQUARE.to_vec(), vec![]).expect("valid");
        assert!(
            empty.is_empty() && empty.bounds().is_empty(),
            "no triangles"
        );
    }
}
