//! The build: two counting sorts from triangles to cells, without memory per cell.
//!
//! ```text
//! triangles ──▶ chunks: an entry for each cell of a     ──▶ slabs: entries counted by cell, ──▶ offsets, references
//!               triangle, sorted by slab                    then sorted by cell
//! ```
//!
//! A slab is a range of cells. Threads work on slabs of their own, and the counters of one slab fit in the cache. The references
//! of a cell ascend, at any number of threads.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use kd_core::Mesh;

use crate::entries::{CHUNK, Chunk, Entries, Slabs};
use crate::lattice::Lattice;
use crate::options::{GridError, GridOptions, Overlap};
use crate::overlap::{for_each_cell, for_each_cell_met, is_worth_a_test};
use crate::small_boxes::SmallBoxes;

/// Up to this number of triangles, one thread builds a grid about as fast as another thread wakes. (Six meshes of 11 000 to 39 000 triangles on two
/// threads, from a throw-away program, 2026-11-29.)
const FEW: usize = 1 << 15;

/// The result of a build.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    pub(crate) lattice: Lattice,
    /// Start of the references of each cell, then the end of the last cell.
    pub(crate) offsets: Vec<u32>,
    pub(crate) refs: Vec<u32>,
    pub(crate) halvings: u32,
}

/// The cells that a triangle's box overlaps.
#[derive(Clone, Copy, Debug, Default)]
struct Cover {
    /// The number of the first cell.
    first: u32,
    /// The kind of [`SmallBoxes`], if it is one.
    small: Option<u8>,
}

/// Memory that a thread reuses for every chunk.
#[derive(Default)]
struct Scratch {
    covers: Vec<Cover>,
    entries: Entries,
}

pub(crate) fn build(mesh: &Mesh, options: &GridOptions) -> Result<Cells, GridError> {
    options.check(mesh.len())?;
    let build = Build {
        mesh,
        overlap: options.overlap,
        is_parallel: options.threads != 1 && mesh.len() > FEW,
    };
    let threads = if build.is_parallel {
        kd_tasks::useful_threads(options.threads, mesh.len())
    } else {
        1
    };
    Ok(kd_tasks::with_threads(threads, || build.cells(options))?)
}

struct Build<'a> {
    mesh: &'a Mesh,
    overlap: Overlap,
    is_parallel: bool,
}

impl Build<'_> {
    fn cells(&self, options: &GridOptions) -> Cells {
        let triangles = self.mesh.len();
        if triangles == 0 {
            return Cells {
                lattice: Lattice::with_resolution(self.mesh.bounds(), [1; 3]),
                offsets: vec![0; 2],
                refs: Vec::new(),
                halvings: 0,
            };
        }
        let wanted = (f64::from(options.density) * triangles as f64).min(options.max_cells as f64);
        let mut lattice = Lattice::new(self.mesh.bounds(), wanted);
        let limit = options.refs_limit(triangles);
        let mut halvings = 0;
        loop {
            let slabs = Slabs::new(lattice.cells(), self.is_parallel);
            // Ends at one cell at the latest, with one reference per triangle: the limit is no less.
            if let Some(chunks) = self.chunks(&lattice, slabs, limit) {
                let (offsets, refs) = self.enter(lattice.cells(), slabs, &chunks);
                return Cells {
                    lattice,
                    offsets,
                    refs,
                    halvings,
                };
            }
            lattice = lattice.halved();
            halvings += 1;
        }
    }

    /// Finds the cells of all triangles; `None` if boxes overlap more than `limit` cells in total. Counts before it allocates.
    fn chunks(&self, lattice: &Lattice, slabs: Slabs, limit: u64) -> Option<Vec<Chunk>> {
        let small = SmallBoxes::new(lattice.strides);
        let starts: Vec<usize> = (0..self.mesh.len()).step_by(CHUNK).collect();
        // The sum only grows and the last thread sees all of it, so that the outcome does not depend on the order of additions.
        let cells = AtomicU64::new(0);
        let chunks =
            kd_tasks::map_in_place(starts, self.is_parallel, |scratch: &mut Scratch, start| {
                if cells.load(Ordering::Relaxed) > limit {
                    return None;
                }
                let triangles = start..self.mesh.len().min(start + CHUNK);
                let own = self.cover(lattice, triangles.clone(), &mut scratch.covers);
                if cells.fetch_add(own, Ordering::Relaxed) + own > limit {
                    return None;
                }
                scratch.entries.clear();
                self.find(lattice, &small, triangles, scratch);
                Some(scratch.entries.sorted_by(slabs))
            });
        chunks.into_iter().collect()
    }

    /// Finds the cells that each triangle's box overlaps. Returns their number, summed over all boxes.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has fewer than 2^30 triangles, and cells are counted with 32 bits"
    )]
    fn cover(&self, lattice: &Lattice, triangles: Range<usize>, covers: &mut Vec<Cover>) -> u64 {
        covers.resize(triangles.len(), Cover::default());
        let mut cells = 0;
        for (triangle, cover) in (triangles.start as u32..).zip(covers) {
            let range = lattice.range(self.mesh.corners(triangle));
            cells += range.count();
            *cover = Cover {
                first: lattice.number(range.first) as u32,
                small: SmallBoxes::kind(&range),
            };
        }
        cells
    }

    /// Makes an entry for each cell of each triangle.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has fewer than 2^30 triangles"
    )]
    fn find(
        &self,
        lattice: &Lattice,
        small: &SmallBoxes,
        triangles: Range<usize>,
        scratch: &mut Scratch,
    ) {
        let Scratch { covers, entries } = scratch;
        for (place, cover) in (0..).zip(covers) {
            if let Some(kind) = cover.small {
                entries.add_all(cover.first, small.cells(kind), place);
            } else {
                self.find_in_large_box(lattice, triangles.start as u32 + place, |cell| {
                    entries.add(cell, place);
                });
            }
        }
    }

    /// Finds the cells of a triangle whose box is not small.
    fn find_in_large_box(&self, lattice: &Lattice, triangle: u32, enter: impl FnMut(usize)) {
        let corners = self.mesh.corners(triangle);
        let range = lattice.range(corners);
        if self.overlap == Overlap::Exact && is_worth_a_test(&range) {
            for_each_cell_met(lattice, &range, corners, enter);
        } else {
            for_each_cell(lattice, &range, enter);
        }
    }

    /// Sorts entries by cell. Returns the start of each cell's references, and all references.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "references are counted with 32 bits"
    )]
    fn enter(&self, cells: usize, slabs: Slabs, chunks: &[Chunk]) -> (Vec<u32>, Vec<u32>) {
        // Fresh zeroed pages: threads share the page faults.
        let mut offsets: Vec<u32> = bytemuck::zeroed_vec(cells + 1);
        let count = chunks.iter().map(Chunk::len).sum();
        let mut refs: Vec<u32> = bytemuck::zeroed_vec(count);
        let (mut begin, mut rest) = (0, refs.as_mut_slice());
        // Each slab's offsets start at its second cell's: the offset of a cell, once it is filled, is the start of the next cell.
        let own_offsets = offsets[1..].chunks_mut(slabs.size()).enumerate();
        let slabs_to_fill = own_offsets.map(|(slab, offsets)| {
            let count: usize = chunks.iter().map(|chunk| chunk.of_slab(slab).len()).sum();
            let refs;
            (refs, rest) = std::mem::take(&mut rest).split_at_mut(count);
            let first = begin;
            begin += count as u32;
            (slab, offsets, refs, first)
        });
        let slabs_to_fill = slabs_to_fill.collect();
        kd_tasks::map_in_place(slabs_to_fill, self.is_parallel, |(): &mut (), slab| {
            let (slab, offsets, refs, first) = slab;
            enter_slab(chunks, slab, offsets, refs, first);
        });
        (offsets, refs)
    }
}

/// Sorts the entries of a slab by cell. Writes its references to `refs`, which `first` references precede, and the end of each
/// cell's references to `offsets`.
#[allow(
    clippy::cast_possible_truncation,
    reason = "a mesh has fewer than 2^30 triangles"
)]
fn enter_slab(chunks: &[Chunk], slab: usize, offsets: &mut [u32], refs: &mut [u32], first: u32) {
    for entry in chunks.iter().flat_map(|chunk| chunk.of_slab(slab)) {
        offsets[entry.cell()] += 1;
    }
    let mut begin = first;
    for offset in offsets.iter_mut() {
        begin += std::mem::replace(offset, begin);
    }
    for (chunk, start) in chunks.iter().zip((0..).step_by(CHUNK)) {
        for entry in chunk.of_slab(slab) {
            let place = &mut offsets[entry.cell()];
            refs[(*place - first) as usize] = start + entry.triangle();
            *place += 1;
        }
    }
}
