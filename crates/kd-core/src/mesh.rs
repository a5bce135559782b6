//! Triangle meshes, checked on construction.

use glam::{Affine3A, DAffine3, Vec3, Vec3A};
use kd_buffer::Buffer;
use thiserror::Error;

use crate::{Aabb, is_zero_area, transformed_point};

/// The greatest number of triangles of a mesh: builders store a triangle's number in 30 bits.
pub const MAX_TRIANGLES: usize = (1 << 30) - 1;

/// An indexed triangle mesh whose positions are finite and whose indices are in range.
///
/// A mesh is checked on construction and immutable, so that all later code relies on these properties. A mesh without
/// triangles is valid, and no ray hits it. Triangles of zero area are valid and cause no errors. They are kept, so that
/// triangle numbers remain those of the caller; [`zero_area_count`](Self::zero_area_count) counts them.
///
/// Positions are f32, which are 1 apart at 10⁷. [`from_f64`](Self::from_f64) takes positions in f64, as offsets from an origin.
///
/// Memory: 12 bytes per vertex and 12 bytes per triangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    positions: Buffer<[f32; 3]>,
    triangles: Buffer<[u32; 3]>,
    bounds: Aabb,
}

/// The reason why a mesh was refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// The number of the vertex, from 0.
        vertex: usize,
    },
    /// The origin of a mesh given in f64 is not finite.
    #[error("the mesh's origin is not finite")]
    Origin,
    /// A position given in f64 is beyond the range of f32 from the origin of its mesh.
    #[error("vertex {vertex} is out of the range of f32, seen from the mesh's origin")]
    TooFar {
        /// The number of the vertex, from 0.
        vertex: usize,
    },
    /// A triangle has a vertex index that is out of range.
    #[error(
        "triangle {triangle}, corner {corner}: index {index} is out of range, there are {vertices} vertices"
    )]
    IndexOutOfRange {
        /// The number of the triangle, from 0.
        triangle: usize,
        /// The corner of the triangle: 0, 1 or 2.
        corner: usize,
        /// The vertex index of that corner.
        index: u32,
        /// The number of vertices of the mesh.
        vertices: usize,
    },
    /// The number of new positions differs from the number of vertices of the mesh.
    #[error("{given} positions for a mesh of {vertices} vertices")]
    VertexCount {
        /// The number of positions given.
        given: usize,
        /// The number of vertices of the mesh.
        vertices: usize,
    },
    /// More than [`MAX_TRIANGLES`] triangles.
    #[error("{triangles} triangles are too many, a mesh has at most {MAX_TRIANGLES}")]
    TooLarge {
        /// The number of triangles given.
        triangles: usize,
    },
}

impl Mesh {
    /// A mesh of `triangles`, each of which has three indices into `positions`. Linear in both.
    ///
    /// Vertices that no triangle uses are allowed. They must be finite too, and do not count towards the bounds.
    ///
    /// # Errors
    ///
    /// [`MeshError`] names the first vertex that is not finite, or the first triangle with an index out of range.
    pub fn new(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        Self::from_buffers(positions.into(), triangles.into())
    }

    /// [`new`](Self::new) without a copy of what is in a mapped file.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn from_buffers(
        positions: Buffer<[f32; 3]>,
        triangles: Buffer<[u32; 3]>,
    ) -> Result<Self, MeshError> {
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

    /// A mesh of buffers that are taken for those of a mesh with these bounds, unread. Constant time.
    ///
    /// If they are not, answers about the mesh are wrong and queries may panic; memory stays safe.
    pub fn from_trusted_buffers(
        positions: Buffer<[f32; 3]>,
        triangles: Buffer<[u32; 3]>,
        bounds: Aabb,
    ) -> Self {
        Self {
            positions,
            triangles,
            bounds,
        }
    }

    /// A mesh of positions and indices that satisfy the rules of [`new`](Self::new). Computes the bounds.
    fn checked(positions: Buffer<[f32; 3]>, triangles: Buffer<[u32; 3]>) -> Self {
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

    /// One mesh of all `meshes`: vertices and triangles of each mesh follow those of the mesh before. Linear in the result.
    ///
    /// # Errors
    ///
    /// [`MeshError::TooLarge`] if the meshes together have more than [`MAX_TRIANGLES`] triangles.
    ///
    /// # Panics
    ///
    /// If the meshes together have 2³² vertices or more (48 GiB).
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
        Ok(Self::checked(positions.into(), triangles.into()))
    }

    /// The same triangles with new positions, one for each vertex. Linear, and faster than [`new`](Self::new), since indices
    /// are not checked again.
    ///
    /// # Errors
    ///
    /// [`MeshError::VertexCount`] if the number of positions differs, [`MeshError::NotFinite`] for the first position that
    /// is not finite.
    pub fn with_positions(&self, positions: Vec<[f32; 3]>) -> Result<Self, MeshError> {
        if positions.len() != self.positions.len() {
            return Err(MeshError::VertexCount {
                given: positions.len(),
                vertices: self.positions.len(),
            });
        }
        check_finite(&positions)?;
        Ok(Self::checked(positions.into(), self.triangles.clone()))
    }

    /// The mesh with every vertex transformed by [`transformed_point`]. Any transform is valid: a mirroring one reverses the orientation of
    /// triangles, a singular one may leave triangles of zero area. Linear.
    ///
    /// # Errors
    ///
    /// [`MeshError::NotFinite`] names the first vertex that is not finite in f32 after the transform.
    pub fn transformed(&self, by: &Affine3A) -> Result<Self, MeshError> {
        let moved = self.positions.iter().map(|at| transformed_point(by, *at));
        self.with_positions(moved.collect())
    }

    /// [`transformed`](Self::transformed) by a transform in f64: each coordinate is computed in f64 and rounded once, by at most 2⁻²⁴
    /// of itself. Linear.
    ///
    /// Where the matrix is the identity, the sum of position and translation is correct up to 2⁻⁵³ before it is rounded.
    ///
    /// # Errors
    ///
    /// As [`transformed`](Self::transformed).
    pub fn transformed_f64(&self, by: &DAffine3) -> Result<Self, MeshError> {
        let moved = |position: &[f32; 3]| {
            let position = Vec3::from(*position).as_dvec3();
            by.transform_point3(position).as_vec3().to_array()
        };
        self.with_positions(self.positions.iter().map(moved).collect())
    }

    /// The vertices.
    #[inline]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Three indices into [`positions`](Self::positions) per triangle, in the order given.
    #[inline]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The number of triangles.
    #[inline]
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether the mesh has no triangles.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// The box around all triangles; [`Aabb::EMPTY`] for a mesh without triangles. Constant time.
    #[inline]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// The number of triangles whose area is exactly zero ([`is_zero_area`]). Linear.
    pub fn zero_area_count(&self) -> usize {
        let all = 0..self.len();
        all.filter(|&triangle| is_zero_area(self.corners_at(triangle)))
            .count()
    }

    /// Whether the area of a triangle is exactly zero ([`is_zero_area`]): no ray hits it.
    ///
    /// # Panics
    ///
    /// If `triangle` is out of range.
    #[inline]
    pub fn is_zero_area(&self, triangle: u32) -> bool {
        is_zero_area(self.corners(triangle))
    }

    /// The three corners of a triangle, in scene units.
    ///
    /// # Panics
    ///
    /// If `triangle` is out of range.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.corners_at(triangle as usize)
    }

    /// The unit normal of a triangle, on the side from which its corners appear counter-clockwise; zero for a triangle of
    /// zero area.
    ///
    /// # Panics
    ///
    /// If `triangle` is out of range.
    pub fn normal(&self, triangle: u32) -> Vec3 {
        let [a, b, c] = self.corners(triangle).map(|p| p.as_dvec3());
        (b - a).cross(c - a).normalize_or_zero().as_vec3()
    }

    /// Bytes of vertices and indices.
    pub fn bytes(&self) -> usize {
        size_of_val(self.positions()) + size_of_val(self.triangles())
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const SQUARE: [[f32; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    #[test]
    fn bad_meshes_are_refused_and_the_element_is_named() {
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
    fn zero_area_triangles_are_counted_and_kept() {
        let triangles = vec![[0, 1, 2], [0, 0, 1], [1, 1, 1], [0, 2, 3]];
        let mesh = Mesh::new(SQUARE.to_vec(), triangles.clone()).expect("valid");
        assert_eq!(mesh.zero_area_count(), 2, "two have zero area");
        assert_eq!(mesh.triangles(), triangles, "all triangles are kept");
        assert_eq!(mesh.normal(0), Vec3::Z, "counter-clockwise seen from +z");
        assert_eq!(mesh.normal(1), Vec3::ZERO, "zero area has no normal");
    }

    #[test]
    fn new_positions_are_checked() {
        let mesh = Mesh::new(SQUARE.to_vec(), vec![[0, 1, 2]]).expect("valid");
        let short = mesh.with_positions(SQUARE[1..].to_vec());
        let message = "3 positions for a mesh of 4 vertices";
        let error = short.expect_err("one position is missing");
        assert_eq!(error.to_string(), message);
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
            "translated, with the same triangles"
        );
    }

    #[test]
    fn transforms_in_f64_round_once() {
        let mesh = Mesh::new(SQUARE.to_vec(), vec![[0, 1, 2]]).expect("valid");
        // A turn by 90 degrees around a far point, which f32 would round to halves.
        let far = DVec3::new(5e5 + 0.25, 5.2e6 + 0.125, 0.0);
        let turn = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let there = DAffine3::from_translation(far);
        let moved = mesh.transformed_f64(&(there.inverse() * turn * there));
        let moved = moved.expect("finite");
        let exact = DVec3::new(-far.y - far.x, far.x - far.y, 0.0);
        let corner = Vec3::from(moved.positions()[0]).as_dvec3();
        let error = (corner - exact).abs().max_element();
        assert!(error <= 0.25, "half a unit in the last place: {error}");
        let up = DAffine3::from_translation(DVec3::Z * 1e39);
        let refused = mesh.transformed_f64(&up).expect_err("overflows");
        assert_eq!(refused, MeshError::NotFinite { vertex: 0 });
    }

    #[test]
    fn concatenation_renumbers_vertices() {
        let one = Mesh::new(SQUARE.to_vec(), vec![[0, 1, 2]]).expect("valid");
        let none = Mesh::new(vec![[9.0; 3]], vec![]).expect("valid");
        let all = Mesh::concatenated([&one, &none, &one]).expect("few");
        assert_eq!(
            all.triangles(),
            [[0, 1, 2], [5, 6, 7]],
            "consecutive numbers"
        );
        assert_eq!(all.corners(1), one.corners(0), "the same triangle");
        assert_eq!(all.bounds(), one.bounds(), "unused vertices do not count");
        let nothing = Mesh::concatenated([]).expect("few");
        assert!(nothing.bounds().is_empty(), "no meshes give an empty mesh");
    }

    #[test]
    fn bounds_ignore_unused_vertices() {
        let mut positions = SQUARE.to_vec();
        positions.push([9.0; 3]);
        let mesh = Mesh::new(positions, vec![[0, 1, 2]]).expect("valid");
        assert_eq!(
            mesh.bounds().max,
            Vec3::new(1.0, 1.0, 0.0),
            "unused vertices do not count"
        );
        let empty = Mesh::new(SQUARE.to_vec(), vec![]).expect("valid");
        assert!(
            empty.is_empty() && empty.bounds().is_empty(),
            "no triangles"
        );
    }
}
