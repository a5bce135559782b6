//! Meshes given in f64.

use glam::DVec3;

use crate::exact::{to_f32, two_sum};
use crate::mesh_origin::origin_on_axis;
use crate::{Mesh, MeshError};

/// A mesh far from the origin of its world: an origin in f64, and a mesh of f32 offsets from it.
///
/// [`Mesh::from_f64`] makes it. The position of a vertex in the world is `origin` plus its position in `mesh`.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldMesh {
    /// The mesh. Its positions are offsets from `origin`.
    pub mesh: Mesh,
    /// The point of the world at which `mesh` has its zero.
    pub origin: DVec3,
    /// The largest difference between a given position and `origin` plus its offset, on each axis: zero exactly where every offset is
    /// exact. It is measured, not estimated, and correct up to 2⁻⁵² of itself.
    pub rounding: DVec3,
}

impl Mesh {
    /// A mesh of positions in f64, as offsets in f32 from an origin that suits them. Linear in positions and triangles.
    ///
    /// On each axis the origin is chosen such that all offsets are exact, if that is possible with a multiple of 2⁻ᵏ, `k ≥ 0`: a whole
    /// number where one suffices, else the coarsest fraction; among these the nearest to the middle of all positions. It is possible
    /// for coordinates that are exact in f32 near some whole number and at most 2²⁴ away from it. Where no such origin exists, the
    /// origin is the middle, and offsets are rounded by at most 2⁻²⁵ of the extent on the axis. (The f64 subtraction adds at most
    /// 2⁻⁵³ of the offset.)
    ///
    /// If all positions move by the same whole number on an axis, and f64 holds them exactly before and after, the origin moves with
    /// them, and the offsets are the same to the bit.
    ///
    /// Vertices that no triangle uses count, too.
    ///
    /// ```
    /// use kd_core::Mesh;
    ///
    /// // A triangle at UTM coordinates, on a grid of 2⁻¹⁰. In f32 its northings would be rounded to halves.
    /// let (x, y) = (500_000.0 + 1.0 / 1024.0, 5_200_000.0 + 5.0 / 1024.0);
    /// let positions = [[x, y, 0.0], [x + 250.0, y, 0.0], [x, y + 250.0, 31.5]];
    /// let world = Mesh::from_f64(&positions, vec![[0, 1, 2]])?;
    /// assert_eq!(world.origin.to_array(), [500_125.0, 5_200_125.0, 16.0]);
    /// assert_eq!(world.rounding.to_array(), [0.0; 3]);
    /// assert_eq!(world.mesh.positions()[0], [1.0 / 1024.0 - 125.0, 5.0 / 1024.0 - 125.0, -16.0]);
    /// # Ok::<(), kd_core::MeshError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// Those of [`new`](Self::new), and [`MeshError::TooFar`] for the first vertex whose offset is beyond f32.
    pub fn from_f64(
        positions: &[[f64; 3]],
        triangles: Vec<[u32; 3]>,
    ) -> Result<WorldMesh, MeshError> {
        check_finite(positions)?;
        let axis = |k: usize| origin_on_axis(positions.iter().map(move |position| position[k]));
        let origin = DVec3::new(axis(0), axis(1), axis(2));
        Self::from_f64_at(origin, positions, triangles)
    }

    /// [`from_f64`](Self::from_f64) with a given origin, for meshes that share one. Offsets are rounded by at most 2⁻²⁴ of
    /// themselves.
    ///
    /// # Errors
    ///
    /// Those of [`from_f64`](Self::from_f64), and [`MeshError::Origin`] if the origin is not finite.
    pub fn from_f64_at(
        origin: impl Into<DVec3>,
        positions: &[[f64; 3]],
        triangles: Vec<[u32; 3]>,
    ) -> Result<WorldMesh, MeshError> {
        let origin = origin.into();
        if !origin.is_finite() {
            return Err(MeshError::Origin);
        }
        check_finite(positions)?;
        let mut rounding = [0.0_f64; 3];
        let mut offsets = Vec::with_capacity(positions.len());
        for (vertex, position) in positions.iter().enumerate() {
            let mut offset = [0.0; 3];
            for k in 0..3 {
                let rounded;
                (offset[k], rounded) = offset_of(position[k], origin[k]);
                if !offset[k].is_finite() {
                    return Err(MeshError::TooFar { vertex });
                }
                rounding[k] = rounding[k].max(rounded);
            }
            offsets.push(offset);
        }
        Ok(WorldMesh {
            mesh: Self::new(offsets, triangles)?,
            origin,
            rounding: rounding.into(),
        })
    }
}

/// The offset of a coordinate, and its distance from the exact one.
fn offset_of(coordinate: f64, origin: f64) -> (f32, f64) {
    let [difference, rest] = two_sum(coordinate, -origin);
    let offset = to_f32(difference);
    (offset, (difference - f64::from(offset) + rest).abs())
}

fn check_finite(positions: &[[f64; 3]]) -> Result<(), MeshError> {
    let is_finite = |position: &[f64; 3]| DVec3::from(*position).is_finite();
    match positions.iter().position(|position| !is_finite(position)) {
        Some(vertex) => Err(MeshError::NotFinite { vertex }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn bad_positions_are_refused_and_named() {
        let good = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let mut infinite = good;
        infinite[2][1] = f64::INFINITY;
        let mut far = good;
        far[1][0] = 1e39;
        let rows = [
            ([0.0; 3], infinite, "vertex 2 is not finite"),
            (
                [0.0; 3],
                far,
                "vertex 1 is out of the range of f32, seen from the mesh's origin",
            ),
            (
                [-1e39, 0.0, 0.0],
                good,
                "vertex 0 is out of the range of f32, seen from the mesh's origin",
            ),
            (
                [0.0, f64::NAN, 0.0],
                good,
                "the mesh's origin is not finite",
            ),
        ];
        for (origin, positions, message) in rows {
            let error = Mesh::from_f64_at(origin, &positions, vec![[0, 1, 2]]);
            assert_eq!(error.expect_err(message).to_string(), message);
        }
        let error = Mesh::from_f64(&infinite, vec![]).expect_err("infinite");
        assert_eq!(error, MeshError::NotFinite { vertex: 2 });
        far[1][0] = f64::MAX;
        far[0][0] = f64::MIN;
        let error = Mesh::from_f64(&far, vec![]).expect_err("no origin is near both");
        assert_eq!(error, MeshError::TooFar { vertex: 0 });
        let error = Mesh::from_f64(&good, vec![[0, 1, 3]]).expect_err("no vertex 3");
        assert!(
            matches!(error, MeshError::IndexOutOfRange { index: 3, .. }),
            "{error}"
        );
    }

    #[test]
    fn nothing_is_at_the_origin() {
        let nothing = Mesh::from_f64(&[], vec![]).expect("valid");
        assert_eq!(nothing.origin, DVec3::ZERO);
        assert_eq!(nothing.rounding, DVec3::ZERO);
        assert!(nothing.mesh.is_empty());
    }

    #[test]
    fn the_rounding_is_the_largest_that_occurred() {
        let unit = 2.0_f64.powi(-30);
        let positions = [[1.0 + unit, 0.0, 0.0], [-1.0 - 3.0 * unit, 0.0, 0.0]];
        let mesh = Mesh::from_f64_at([0.0; 3], &positions, vec![]).expect("valid");
        assert_eq!(mesh.rounding, DVec3::new(3.0 * unit, 0.0, 0.0));
        // The subtraction in f64 loses the number, and its rest is reported.
        let mesh = Mesh::from_f64_at([1e20, 0.0, 0.0], &[[unit, 0.0, 0.0]], vec![]);
        let mesh = mesh.expect("valid");
        let of_f32 = (1e20 - f64::from(-mesh.mesh.positions()[0][0])).abs();
        assert_eq!(mesh.rounding.x, of_f32.max(unit));
    }

    proptest! {
        #[test]
        fn roundings_are_bounded_and_true(
            positions in prop::collection::vec(prop::array::uniform3(-1e7_f64..1e7), 1..20),
        ) {
            let world = Mesh::from_f64(&positions, vec![]).expect("valid");
            for k in 0..3 {
                let on_axis = || positions.iter().map(|position| position[k]);
                let extent = on_axis().fold(f64::MIN, f64::max) - on_axis().fold(f64::MAX, f64::min);
                let error = positions.iter().zip(world.mesh.positions()).map(|(given, offset)| {
                    (given[k] - world.origin[k] - f64::from(offset[k])).abs()
                });
                let largest = error.fold(0.0, f64::max);
                let of_f64 = 1e7 * f64::EPSILON;
                prop_assert!((world.rounding[k] - largest).abs() <= of_f64);
                prop_assert!(world.rounding[k] <= extent * 2.0_f64.powi(-25) + of_f64);
            }
        }
    }
}
