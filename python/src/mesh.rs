//! Meshes of arrays.

use kd::Mesh;
use kd::glam::DVec3;
use pyo3::prelude::*;

use crate::arrays::{Rows, RowsView, faces, reserved};
use crate::errors::of_mesh;
use crate::rays::rounded;

/// A mesh, and the point at which its coordinates have their zero.
pub(crate) struct PlacedMesh {
    pub(crate) mesh: Mesh,
    pub(crate) zero: DVec3,
    /// The largest error of a vertex on each axis, if it is known.
    pub(crate) rounding: Option<DVec3>,
}

impl PlacedMesh {
    /// Float32 vertices are taken as they are, with the zero of their own coordinates. Float64 vertices become offsets in float32 from a
    /// zero near them ([`Mesh::from_f64`]).
    pub(crate) fn new(vertices: &Bound<'_, PyAny>, triangles: &Bound<'_, PyAny>) -> PyResult<Self> {
        let vertices = Rows::new("vertices", vertices)?;
        let triangles = faces("faces", triangles)?;
        match vertices.view() {
            RowsView::Single(_) => {
                let mesh = Mesh::new(single("vertices", &vertices)?, triangles);
                Ok(Self {
                    mesh: mesh.map_err(|error| of_mesh(&error))?,
                    zero: DVec3::ZERO,
                    rounding: Some(DVec3::ZERO),
                })
            }
            RowsView::Double(view) => {
                let mut positions = reserved(view.nrows(), "vertices")?;
                vertices
                    .view()
                    .for_each(0, view.nrows(), |_, row| positions.push(row));
                let world = Mesh::from_f64(&positions, triangles);
                let world = world.map_err(|error| of_mesh(&error))?;
                Ok(Self {
                    mesh: world.mesh,
                    zero: world.origin,
                    rounding: Some(world.rounding),
                })
            }
        }
    }
}

/// All rows in f32, rounded.
pub(crate) fn single(argument: &str, rows: &Rows<'_>) -> PyResult<Vec<[f32; 3]>> {
    let mut single = reserved(rows.len(), argument)?;
    rows.view()
        .for_each(0, rows.len(), |_, row| single.push(row.map(rounded)));
    Ok(single)
}
