//! A uniform grid and its queries.

use std::sync::Arc;

use kd_core::{Aabb, Hit, Mesh, Ray};
use kd_trace::delegate_ray_query;
use kd_trace::kit::{Any, Closest, Ordered};

use crate::build::{self, Cells};
use crate::lattice::Lattice;
use crate::options::{GridError, GridOptions};
use crate::stats::GridStats;
use crate::walk::walk;

/// A box divided into equal cells, each with a list of the triangles in it.
///
/// A grid is quick to build, in time proportional to the number of triangles, and slow for rays where density varies much ("a
/// teapot in a stadium"). Every answer equals that of [`kd_trace::brute_force`] to the bit, and so that of a kd-tree.
///
/// Memory: 4 bytes a cell and 4 bytes a reference, beside the mesh, which the grid shares.
#[derive(Clone, Debug)]
pub struct UniformGrid {
    mesh: Arc<Mesh>,
    cells: Cells,
}

impl UniformGrid {
    /// Builds a grid over a mesh.
    ///
    /// Time is linear in triangles, cells and references. For memory during the build, see [`GridOptions::with_max_refs`]; in
    /// addition it takes 4 bytes for each thousand triangles and slab of cells, with eight slabs for each thread or one for
    /// each million cells.
    ///
    /// # Errors
    ///
    /// [`GridError`] if an option is out of range or threads cannot be started.
    pub fn build(mesh: impl Into<Arc<Mesh>>, options: &GridOptions) -> Result<Self, GridError> {
        let mesh = mesh.into();
        let cells = build::build(&mesh, options)?;
        Ok(Self { mesh, cells })
    }

    /// The mesh that the grid is over.
    pub fn mesh(&self) -> &Arc<Mesh> {
        &self.mesh
    }

    /// The closest hit with `t_min <= t <= t_max`, the lower triangle among equals, or `None`.
    ///
    /// Time is proportional to the cells along the ray, up to about the cube root of all cells, and to their contents. A ray
    /// from more than 2²⁶ times the longest side of the grid away is tested against every triangle: rounding leaves no bound on
    /// its cells.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut closest = Closest::default();
        // `Closest` never breaks: a nearer hit is always possible.
        let _ = walk(self, ray, &mut closest);
        closest.0
    }

    /// Whether there is any hit: equal to `intersect(ray).is_some()`, and faster.
    pub fn occluded(&self, ray: &Ray) -> bool {
        walk(self, ray, &mut Any::default()).is_break()
    }

    /// The first `max` hits, ordered by `t`, then by triangle, each triangle once. Clears `out` first.
    pub fn hits(&self, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        Ordered::fill(out, max, |ordered| {
            // `Ordered` never breaks: a nearer hit is always possible.
            let _ = walk(self, ray, ordered);
        });
    }

    /// The number of cells along each axis.
    pub fn resolution(&self) -> [u32; 3] {
        self.cells.lattice.resolution
    }

    /// The triangles of a cell, in ascending order. `cell` is its index along each axis.
    ///
    /// # Panics
    ///
    /// If an index is not below the [`resolution`](Self::resolution).
    pub fn triangles_in(&self, cell: [u32; 3]) -> &[u32] {
        let resolution = self.resolution();
        let exists = cell.iter().zip(resolution).all(|(at, along)| *at < along);
        assert!(exists, "cell {cell:?} of {resolution:?}");
        self.cell(self.lattice().number(cell))
    }

    /// The box around all triangles, which is divided into cells.
    pub fn bounds(&self) -> Aabb {
        self.lattice().bounds
    }

    /// The number of triangles.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has fewer than 2^30 triangles"
    )]
    pub fn triangles(&self) -> u32 {
        self.mesh.len() as u32
    }

    /// Statistics of the cells. Linear in the number of cells.
    pub fn stats(&self) -> GridStats {
        GridStats::of(self)
    }

    /// Bytes of cells and references.
    pub fn bytes(&self) -> usize {
        size_of_val(self.cells.offsets.as_slice()) + size_of_val(self.cells.refs.as_slice())
    }

    pub(crate) fn lattice(&self) -> &Lattice {
        &self.cells.lattice
    }

    pub(crate) fn halvings(&self) -> u32 {
        self.cells.halvings
    }

    pub(crate) fn refs(&self) -> &[u32] {
        &self.cells.refs
    }

    /// The triangles of the cell with a number.
    #[inline]
    pub(crate) fn cell(&self, number: usize) -> &[u32] {
        let offsets = &self.cells.offsets;
        &self.cells.refs[offsets[number] as usize..offsets[number + 1] as usize]
    }

    /// The number of references of each cell.
    pub(crate) fn counts(&self) -> impl Iterator<Item = u32> {
        let offsets = self.cells.offsets.as_slice();
        offsets.windows(2).map(|pair| pair[1] - pair[0])
    }
}

delegate_ray_query! {
    impl RayQuery<Hit = Hit> for UniformGrid: single;
    grid => grid,
}
