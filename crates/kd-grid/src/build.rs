//! From triangles to cells: two passes that count, and no memory for each cell.
//!
//! ```text
//! triangles ──▶ chunks: the cells of each ──▶ slabs: references of each cell ──▶ offsets, references
//!               (chunk by chunk)              counted, then entered (slab by slab)
//! ```
//!
//! A grid is cut into slabs of some ten thousand cells, so that what a slab's cells hold stays in a cache while it is counted
//! and entered, and so that threads have slabs, and cells, of their own. For that, triangles are sorted by the slabs that they
//! reach, in chunks, first. In a cell, triangles are in the order of their numbers, whoever does what when.

use kd_core::Mesh;

use crate::lattice::{CellRange, Lattice};
use crate::options::{BuildError, GridOptions, Overlap};
use crate::overlap::for_each_cell;
use crate::tasks;

/// Triangles to a chunk.
const CHUNK: usize = 1 << 14;
/// Cells of a slab, about: four bytes each should stay near.
const SLAB: usize = 1 << 15;

/// What a build gives.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    pub(crate) lattice: Lattice,
    /// Where the references of each cell begin, and at last where they end.
    pub(crate) offsets: Vec<u32>,
    pub(crate) refs: Vec<u32>,
    pub(crate) halvings: u32,
}

/// A triangle and its cells.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Placed {
    cells: CellRange,
    triangle: u32,
}

/// Triangles of a chunk, sorted by slab; one that reaches into several is there for each.
struct Chunk {
    placed: Vec<Placed>,
    /// Where those of each slab begin, and at last where they end.
    offsets: Vec<u32>,
    /// How many cells their ranges have.
    cells: u64,
}

pub(crate) fn build(mesh: &Mesh, options: &GridOptions) -> Result<Cells, BuildError> {
    options.check(mesh.len())?;
    tasks::with_threads(options.threads, || {
        let build = Build {
            mesh,
            overlap: options.overlap,
            is_parallel: options.threads != 1,
        };
        build.cells(options)
    })
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
            let slabs = Slabs::of(&lattice);
            let chunks = self.place(&lattice, &slabs);
            // One cell has a reference to each triangle, and the limit is no less.
            if chunks.iter().map(|chunk| chunk.cells).sum::<u64>() <= limit {
                return self.enter(lattice, &slabs, &chunks, halvings);
            }
            lattice = lattice.halved();
            halvings += 1;
        }
    }

    /// Finds the cells of all triangles.
    fn place(&self, lattice: &Lattice, slabs: &Slabs) -> Vec<Chunk> {
        let starts: Vec<usize> = (0..self.mesh.len()).step_by(CHUNK).collect();
        tasks::map(starts, self.is_parallel, |start| {
            let end = self.mesh.len().min(start + CHUNK);
            self.place_chunk(lattice, slabs, start, end)
        })
    }

    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has fewer than 2^30 triangles"
    )]
    fn place_chunk(&self, lattice: &Lattice, slabs: &Slabs, start: usize, end: usize) -> Chunk {
        let mut cells = 0;
        // By one more than the slab: what is counted there becomes where the next one begins.
        let mut offsets = vec![0_u32; slabs.count + 2];
        let mut placed = Vec::with_capacity(end - start);
        for triangle in start as u32..end as u32 {
            let range = lattice.range(self.mesh.corners(triangle));
            cells += range.count();
            for slab in slabs.reached(&range) {
                offsets[slab + 2] += 1;
            }
            placed.push(Placed {
                cells: range,
                triangle,
            });
        }
        if slabs.count == 1 {
            return Chunk {
                offsets: vec![0, placed.len() as u32],
                placed,
                cells,
            };
        }
        for slab in 2..offsets.len() {
            offsets[slab] += offsets[slab - 1];
        }
        let mut sorted = bytemuck::zeroed_vec(offsets[slabs.count + 1] as usize);
        for place in placed {
            for slab in slabs.reached(&place.cells) {
                sorted[offsets[slab + 1] as usize] = place;
                offsets[slab + 1] += 1;
            }
        }
        offsets.truncate(slabs.count + 1);
        Chunk {
            placed: sorted,
            offsets,
            cells,
        }
    }

    /// Counts the references of every cell, then enters them.
    fn enter(&self, lattice: Lattice, slabs: &Slabs, chunks: &[Chunk], halvings: u32) -> Cells {
        // The pages come from the system, zeroed and not yet touched, so that threads share the work of touching them.
        let mut offsets: Vec<u32> = bytemuck::zeroed_vec(lattice.cells() + 1);
        let in_slab = |slab: usize| {
            chunks.iter().flat_map(move |chunk| {
                let (start, end) = (chunk.offsets[slab], chunk.offsets[slab + 1]);
                &chunk.placed[start as usize..end as usize]
            })
        };
        let each_cell = |slab: usize, enter: &mut dyn FnMut(usize, u32)| {
            let (first_cell, layers) = (slabs.first_cell(slab), slabs.layers(slab));
            for placed in in_slab(slab) {
                let cells = slabs.within(&placed.cells, &layers);
                let corners = || self.mesh.corners(placed.triangle);
                let exactly = (self.overlap == Overlap::Exact).then_some(corners);
                for_each_cell(&lattice, &cells, exactly, |cell| {
                    enter(cell - first_cell, placed.triangle);
                });
            }
        };

        // Each slab's offsets begin at its second cell's: a cell's place, while it is filled, is where the next one begins.
        let own_offsets = offsets[1..].chunks_mut(slabs.cells).enumerate().collect();
        let counts = tasks::map(own_offsets, self.is_parallel, |(slab, offsets)| {
            each_cell(slab, &mut |cell, _| offsets[cell] += 1);
            let mut begin = 0;
            for offset in offsets.iter_mut() {
                begin += std::mem::replace(offset, begin);
            }
            begin
        });
        let count: usize = counts.iter().map(|count| *count as usize).sum();
        let mut refs: Vec<u32> = bytemuck::zeroed_vec(count);

        let mut begin = 0;
        let mut rest = refs.as_mut_slice();
        let own_offsets = offsets[1..].chunks_mut(slabs.cells);
        let parts = own_offsets
            .zip(counts)
            .enumerate()
            .map(|(slab, (offsets, count))| {
                let own;
                (own, rest) = std::mem::take(&mut rest).split_at_mut(count as usize);
                let first = begin;
                begin += count;
                (slab, offsets, own, first)
            });
        tasks::map(
            parts.collect(),
            self.is_parallel,
            |(slab, offsets, refs, first)| {
                each_cell(slab, &mut |cell, triangle| {
                    let place = &mut offsets[cell];
                    refs[*place as usize] = triangle;
                    *place += 1;
                });
                for offset in offsets {
                    *offset += first;
                }
            },
        );
        Cells {
            lattice,
            offsets,
            refs,
            halvings,
        }
    }
}

/// A grid cut across the axis of the most cells.
struct Slabs {
    axis: usize,
    /// Layers of cells in each slab; the last one may have fewer.
    thickness: u16,
    layers: u32,
    /// Cells of each slab but perhaps the last one.
    cells: usize,
    count: usize,
}

/// The first and the last layer of a slab.
struct Layers {
    first: u16,
    last: u16,
}

impl Slabs {
    #[allow(clippy::cast_possible_truncation, reason = "at most 2^16 layers")]
    fn of(lattice: &Lattice) -> Self {
        let axis = lattice.outer;
        let layers = lattice.resolution[axis];
        let per_layer = lattice.strides[axis] as usize;
        let thickness = (SLAB / per_layer).clamp(1, layers.min(u32::from(u16::MAX)) as usize);
        Self {
            axis,
            thickness: thickness as u16,
            layers,
            cells: thickness * per_layer,
            count: (layers as usize).div_ceil(thickness),
        }
    }

    /// The slabs that a range reaches into.
    #[inline]
    fn reached(&self, cells: &CellRange) -> std::ops::RangeInclusive<usize> {
        let slab = |layer: u16| usize::from(layer / self.thickness);
        slab(cells.first[self.axis])..=slab(cells.last[self.axis])
    }

    #[allow(clippy::cast_possible_truncation, reason = "at most 2^16 layers")]
    fn layers(&self, slab: usize) -> Layers {
        let first = slab * usize::from(self.thickness);
        let end = (first + usize::from(self.thickness)).min(self.layers as usize);
        Layers {
            first: first as u16,
            last: (end - 1) as u16,
        }
    }

    fn first_cell(&self, slab: usize) -> usize {
        slab * self.cells
    }

    /// The part of a range that is in these layers.
    #[inline]
    fn within(&self, cells: &CellRange, layers: &Layers) -> CellRange {
        let mut within = *cells;
        let axis = self.axis;
        within.first[axis] = cells.first[axis].max(layers.first);
        within.last[axis] = cells.last[axis].min(layers.last);
        within
    }
}
