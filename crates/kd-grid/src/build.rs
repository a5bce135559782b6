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

use std::ops::Range;

use kd_core::Mesh;

use crate::lattice::{CellRange, Lattice};
use crate::options::{BuildError, GridOptions, Overlap};
use crate::overlap::{each_of_box, for_each_cell, for_each_cell_met, is_worth_a_test};
use crate::tasks;

/// Triangles to a chunk.
const CHUNK: usize = 1 << 14;
/// Cells of a slab: two to this power. Their offsets, of four bytes each, should stay near.
const SLAB: u32 = 15;

/// What a build gives.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    pub(crate) lattice: Lattice,
    /// Where the references of each cell begin, and at last where they end.
    pub(crate) offsets: Vec<u32>,
    pub(crate) refs: Vec<u32>,
    pub(crate) halvings: u32,
}

/// The cells of a triangle.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Cover {
    /// The number of the first cell.
    first: u32,
    /// How many more there are along each axis; and 1 if they are in several slabs, or else 0. Or all of it is
    /// [`ASKED`](Self::ASKED), and the cells are found once more when they are needed.
    more: [u8; 4],
}

impl Cover {
    const ASKED: [u8; 4] = [u8::MAX; 4];

    /// How many cells there are along each axis.
    fn counts(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| usize::from(self.more[axis]) + 1)
    }

    fn is_in_several_slabs(&self) -> bool {
        self.more[3] != 0
    }
}

/// A triangle in a slab.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Placed {
    triangle: u32,
    cover: Cover,
}

/// Triangles of a chunk, sorted by slab; one that reaches into several is there for each.
struct Chunk {
    placed: Vec<Placed>,
    /// Where those of each slab begin, and at last where they end.
    offsets: Vec<u32>,
    /// How many cells their ranges have.
    cells: u64,
}

impl Chunk {
    fn of_slab(&self, slab: usize) -> &[Placed] {
        &self.placed[self.offsets[slab] as usize..self.offsets[slab + 1] as usize]
    }
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
            let chunks = self.place(&lattice);
            // One cell has a reference to each triangle, and the limit is no less.
            if chunks.iter().map(|chunk| chunk.cells).sum::<u64>() <= limit {
                return self.enter(lattice, &chunks, halvings);
            }
            lattice = lattice.halved();
            halvings += 1;
        }
    }

    /// Finds the cells of all triangles.
    fn place(&self, lattice: &Lattice) -> Vec<Chunk> {
        let slabs = lattice.cells().div_ceil(1 << SLAB);
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
    fn place_chunk(&self, lattice: &Lattice, slabs: usize, start: usize, end: usize) -> Chunk {
        let mut cells = 0;
        // By one more than the slab: what is counted there becomes where the next one begins.
        let mut offsets = vec![0_u32; slabs + 2];
        let mut covers: Vec<Cover> = bytemuck::zeroed_vec(end - start);
        for (triangle, cover) in (start as u32..).zip(&mut covers) {
            let range = lattice.range(self.mesh.corners(triangle));
            cells += range.count();
            *cover = self.cover(lattice, &range);
            offsets[slab_of(cover.first) + 2] += 1;
            if cover.is_in_several_slabs() {
                for slab in slabs_of(lattice, &range).skip(1) {
                    offsets[slab + 2] += 1;
                }
            }
        }
        for slab in 2..offsets.len() {
            offsets[slab] += offsets[slab - 1];
        }
        let mut placed = bytemuck::zeroed_vec(offsets[slabs + 1] as usize);
        let mut put = |slab: usize, triangle: u32, cover: Cover| {
            let place = &mut offsets[slab + 1];
            placed[*place as usize] = Placed { triangle, cover };
            *place += 1;
        };
        for (triangle, cover) in (start as u32..).zip(covers) {
            put(slab_of(cover.first), triangle, cover);
            if cover.is_in_several_slabs() {
                let range = lattice.range(self.mesh.corners(triangle));
                for slab in slabs_of(lattice, &range).skip(1) {
                    put(slab, triangle, cover);
                }
            }
        }
        offsets.truncate(slabs + 1);
        Chunk {
            placed,
            offsets,
            cells,
        }
    }

    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "cells are counted with 32 bits, and what is more than eight is asked"
    )]
    fn cover(&self, lattice: &Lattice, range: &CellRange) -> Cover {
        let [x, y, z] = [0, 1, 2].map(|axis| range.last[axis] - range.first[axis]);
        let is_simple = (x | y | z) < u32::from(u8::MAX)
            && (self.overlap == Overlap::Box || !is_worth_a_test(range));
        let slabs = slabs_of(lattice, range);
        Cover {
            first: lattice.number(range.first) as u32,
            more: if is_simple {
                [x as u8, y as u8, z as u8, u8::from(slabs.len() > 1)]
            } else {
                Cover::ASKED
            },
        }
    }

    /// Calls `enter` for each cell of a slab and each triangle in it: the cell's number within the slab, and the triangle's. In
    /// each cell, triangles come in order.
    fn for_each_entry(
        &self,
        lattice: &Lattice,
        slab: usize,
        chunks: &[Chunk],
        mut enter: impl FnMut(usize, u32),
    ) {
        let small = SmallBoxes::new(lattice.strides);
        let strides = lattice.strides.map(|stride| stride as usize);
        let first_cell = slab << SLAB;
        for chunk in chunks {
            for &Placed { triangle, cover } in chunk.of_slab(slab) {
                if let Some(cells) = small.cells(cover.more) {
                    let first = cover.first as usize - first_cell;
                    for &cell in cells {
                        enter(first + cell as usize, triangle);
                    }
                    continue;
                }
                let enter = |cell: usize| {
                    if cell >> SLAB == slab {
                        enter(cell - first_cell, triangle);
                    }
                };
                if cover.more == Cover::ASKED {
                    self.ask(lattice, slab, triangle, enter);
                } else {
                    each_of_box(cover.first as usize, cover.counts(), strides, enter);
                }
            }
        }
    }

    /// Finds the cells of a triangle in a slab.
    #[cold]
    fn ask(&self, lattice: &Lattice, slab: usize, triangle: u32, enter: impl FnMut(usize)) {
        let corners = self.mesh.corners(triangle);
        let range = lattice.range(corners);
        let within = lattice.within(&range, slab << SLAB, (slab + 1) << SLAB);
        if self.overlap == Overlap::Exact && is_worth_a_test(&range) {
            for_each_cell_met(lattice, &within, corners, enter);
        } else {
            for_each_cell(lattice, &within, enter);
        }
    }

    /// Counts the references of every cell, then enters them.
    fn enter(&self, lattice: Lattice, chunks: &[Chunk], halvings: u32) -> Cells {
        // The pages come from the system, zeroed and not yet touched, so that threads share the work of touching them.
        let mut offsets: Vec<u32> = bytemuck::zeroed_vec(lattice.cells() + 1);
        // Each slab's offsets begin at its second cell's: a cell's place, while it is filled, is where the next one begins.
        let own_offsets = offsets[1..].chunks_mut(1 << SLAB).enumerate().collect();
        let counts = tasks::map(own_offsets, self.is_parallel, |(slab, offsets)| {
            self.for_each_entry(&lattice, slab, chunks, |cell, _| offsets[cell] += 1);
            offsets.iter().sum::<u32>()
        });
        // As many as `max_refs` allows, which 32 bits count.
        let count: u32 = counts.iter().sum();
        let mut refs: Vec<u32> = bytemuck::zeroed_vec(count as usize);

        let (mut begin, mut rest) = (0, refs.as_mut_slice());
        let own_offsets = offsets[1..].chunks_mut(1 << SLAB);
        let parts = own_offsets.zip(counts).enumerate();
        let parts = parts.map(|(slab, (offsets, count))| {
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
                let mut begin = first;
                for offset in offsets.iter_mut() {
                    begin += std::mem::replace(offset, begin);
                }
                self.for_each_entry(&lattice, slab, chunks, |cell, triangle| {
                    let place = &mut offsets[cell];
                    refs[(*place - first) as usize] = triangle;
                    *place += 1;
                });
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

/// The slab of a cell.
#[inline(always)]
fn slab_of(cell: u32) -> usize {
    (cell >> SLAB) as usize
}

/// The slabs that a range of cells reaches into, and perhaps others between them.
#[inline(always)]
fn slabs_of(lattice: &Lattice, range: &CellRange) -> Range<usize> {
    lattice.number(range.first) >> SLAB..(lattice.number(range.last) >> SLAB) + 1
}

/// Boxes of one or two cells along each axis, cell by cell.
struct SmallBoxes {
    /// How far each cell is from the first one, by the axes along which there are two.
    cells: [[u32; 8]; 8],
}

impl SmallBoxes {
    fn new(strides: [u32; 3]) -> Self {
        let mut cells = [[0; 8]; 8];
        for (axes, cells) in cells.iter_mut().enumerate() {
            let corners = (0..8_usize).filter(|corner| corner & !axes == 0);
            for (cell, corner) in cells.iter_mut().zip(corners) {
                let along = |axis: usize| {
                    if corner >> axis & 1 == 0 {
                        0
                    } else {
                        strides[axis]
                    }
                };
                *cell = along(0) + along(1) + along(2);
            }
        }
        Self { cells }
    }

    /// Those of a [`Cover`], if it is such a box and in one slab.
    #[inline(always)]
    fn cells(&self, more: [u8; 4]) -> Option<&[u32]> {
        let [x, y, z, is_in_several] = more.map(usize::from);
        if (x | y | z) > 1 || is_in_several != 0 {
            return None;
        }
        let axes = x | y << 1 | z << 2;
        Some(&self.cells[axes][..1 << (x + y + z)])
    }
}
