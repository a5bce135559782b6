//! A uniform grid and its queries.

use kd_core::{Aabb, Hit, Mesh, Ray};
use kd_trace::kit::{Any, Closest, Ordered};

use crate::build::{self, Cells};
use crate::lattice::Lattice;
use crate::options::{BuildError, GridOptions};
use crate::stats::GridStats;
use crate::walk::walk;

/// Space divided into equal cells, each with a list of the triangles in it.
///
/// Quick to build, in time proportional to the number of triangles; slow for rays where some places are much denser than
/// others ("a teapot in a stadium"). Every answer equals that of [`kd_trace::brute_force`] to the bit, and so that of a
/// kd-tree.
///
/// Memory: 4 bytes a cell and 4 bytes a reference. The mesh is not copied; every query takes it.
#[derive(Clone, Debug)]
pub struct UniformGrid {
    cells: Cells,
    triangles: u32,
}

impl UniformGrid {
    /// Builds a grid over a mesh.
    ///
    /// Time is linear in the triangles, the cells and the references. For memory while it is
    /// built, see [`GridOptions::with_max_refs`]; 4 bytes more are taken for each thousand triangles and slab of cells, of which
    /// there are eight for each thread or one for each million cells.
    ///
    /// # Errors
    ///
    /// [`BuildError`] names an option that makes no sense.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has fewer than 2^30 triangles"
    )]
    pub fn build(mesh: &Mesh, options: &GridOptions) -> Result<Self, BuildError> {
        Ok(Self {
            cells: build::build(mesh, options)?,
            triangles: mesh.len() as u32,
        })
    }

    /// The closest hit with `t_min <= t <= t_max`, the lower triangle among equals, or `None`.
    ///
    /// Takes time proportional to the cells on the way, of which there are up to the cube root of all, and to what is in
    /// them. From more than 2²⁶ times the longest side of the grid away, every triangle is tested instead: nothing less is
    /// sure there.
    ///
    /// # Panics
    ///
    /// If `mesh` is not the one that the grid was built from, and has fewer triangles.
    pub fn intersect(&self, mesh: &Mesh, ray: &Ray) -> Option<Hit> {
        let mut closest = Closest::default();
        // It never breaks: there may always be a nearer one.
        let _ = walk(self, mesh, ray, &mut closest);
        closest.0
    }

    /// Whether there is any hit: the same as `intersect(..).is_some()`, sooner.
    ///
    /// # Panics
    ///
    /// As [`intersect`](Self::intersect).
    pub fn occluded(&self, mesh: &Mesh, ray: &Ray) -> bool {
        walk(self, mesh, ray, &mut Any::default()).is_break()
    }

    /// The first `max` hits in `out`, which is cleared before: ordered by `t`, then by triangle, each triangle once.
    ///
    /// # Panics
    ///
    /// As [`intersect`](Self::intersect).
    pub fn hits(&self, mesh: &Mesh, ray: &Ray, max: usize, out: &mut Vec<Hit>) {
        out.clear();
        if max > 0 {
            // It never breaks: there may always be a nearer one.
            let _ = walk(self, mesh, ray, &mut Ordered { max, out });
        }
    }

    /// How many cells there are along each axis.
    pub fn resolution(&self) -> [u32; 3] {
        self.cells.lattice.resolution
    }

    /// The triangles of a cell, told by its place along each axis; in the order of their numbers.
    ///
    /// # Panics
    ///
    /// If there is no such cell.
    pub fn triangles_in(&self, place: [u32; 3]) -> &[u32] {
        let resolution = self.resolution();
        let exists = place.iter().zip(resolution).all(|(at, along)| *at < along);
        assert!(exists, "cell {place:?} of {resolution:?}");
        self.cell(self.lattice().number(place))
    }

    /// The box around all triangles, which is divided into cells.
    pub fn bounds(&self) -> Aabb {
        self.lattice().bounds
    }

    /// How many triangles the grid is over.
    pub fn triangles(&self) -> u32 {
        self.triangles
    }

    /// How cells are filled. Looks at every cell.
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

    /// The triangles of a cell.
    #[inline]
    pub(crate) fn cell(&self, number: usize) -> &[u32] {
        let offsets = &self.cells.offsets;
        &self.cells.refs[offsets[number] as usize..offsets[number + 1] as usize]
    }

    /// How many references each cell has.
    pub(crate) fn counts(&self) -> impl Iterator<Item = u32> {
        let offsets = self.cells.offsets.as_slice();
        offsets.windows(2).map(|pair| pair[1] - pair[0])
    }
}
