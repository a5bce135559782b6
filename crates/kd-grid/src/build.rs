//! From triangles to cells: sorted twice by counting, and no memory for each cell.
//!
//! ```text
//! triangles ──▶ chunks: the cells of each, ──▶ slabs: references of each cell ──▶ offsets, references
//!               sorted by slab                 counted, then entered
//! ```
//!
//! A grid is cut into slabs of some ten thousand cells, so that what a slab's cells hold stays in a cache while it is counted
//! and entered, and so that threads have slabs, and cells, of their own. For that, triangles are sorted by the slabs that they
//! reach, in chunks, first. In a cell, triangles are in the order of their numbers, whoever does what when.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use kd_core::Mesh;

use crate::lattice::{CellRange, Lattice};
use crate::options::{BuildError, GridOptions, Overlap};
use crate::overlap::{each_of_box, for_each_cell, for_each_cell_met, is_worth_a_test};
use crate::tasks;

/// Triangles to a chunk.
const CHUNK: usize = 1 << 12;
/// Meshes of fewer triangles are not worth several threads.
const FEW: usize = 1 << 13;

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
    /// Below 8 a small box in one slab: its bits tell the axes along which there are two cells, and not one. Otherwise
    /// [`ASKED`](Self::ASKED), and the triangle is asked once more when its cells are needed; or how many more cells there
    /// are along each axis, eight bits for each, over [`BOX`](Self::BOX).
    kind: u32,
}

impl Cover {
    const ASKED: u32 = u32::MAX;
    const BOX: u32 = 1 << 31;
    /// A box may have so many more cells along an axis.
    const MOST: u32 = 254;

    /// Of a box of so many more cells along each axis, if it is not too large.
    #[inline(always)]
    fn of_box(first: u32, [x, y, z]: [u32; 3], is_in_one_slab: bool) -> Self {
        let kind = if (x | y | z) <= 1 && is_in_one_slab {
            x | y << 1 | z << 2
        } else if x.max(y).max(z) <= Self::MOST {
            Self::BOX | x | y << 8 | z << 16
        } else {
            Self::ASKED
        };
        Self { first, kind }
    }

    /// How many cells there are along each axis of a [`BOX`](Self::BOX).
    fn counts(self) -> [usize; 3] {
        [0, 8, 16].map(|shift| (self.kind >> shift & 0xff) as usize + 1)
    }

    /// Only small boxes are surely in one slab.
    #[inline(always)]
    fn is_small(self) -> bool {
        self.kind < 8
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
            is_parallel: options.threads != 1 && mesh.len() > FEW,
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
            // One cell has a reference to each triangle, and the limit is no less.
            if let Some(chunks) = self.place(&lattice, slabs, limit) {
                return self.enter(lattice, slabs, &chunks, halvings);
            }
            lattice = lattice.halved();
            halvings += 1;
        }
    }

    /// Finds the cells of all triangles; `None` if there are more of them than `limit`, which is found out before memory is
    /// taken for more.
    fn place(&self, lattice: &Lattice, slabs: Slabs, limit: u64) -> Option<Vec<Chunk>> {
        let starts: Vec<usize> = (0..self.mesh.len()).step_by(CHUNK).collect();
        // Whether the sum of all is beyond the limit does not depend on who adds first.
        let cells = AtomicU64::new(0);
        let chunks = tasks::map(starts, self.is_parallel, |start| {
            let end = self.mesh.len().min(start + CHUNK);
            self.place_chunk(lattice, slabs, start..end, |own| {
                cells.fetch_add(own, Ordering::Relaxed) + own <= limit
            })
        });
        chunks.into_iter().collect()
    }

    #[allow(
        clippy::cast_possible_truncation,
        reason = "a mesh has fewer than 2^30 triangles"
    )]
    fn place_chunk(
        &self,
        lattice: &Lattice,
        slabs: Slabs,
        triangles: Range<usize>,
        is_within_limit: impl FnOnce(u64) -> bool,
    ) -> Option<Chunk> {
        let first = triangles.start as u32;
        let mut cells = 0;
        // By one more than the slab: what is counted there becomes where the next one begins.
        let mut offsets = vec![0_u32; slabs.count + 2];
        let mut covers: Vec<Cover> = bytemuck::zeroed_vec(triangles.len());
        for (triangle, cover) in (first..).zip(&mut covers) {
            let range = lattice.range(self.mesh.corners(triangle));
            cells += range.count();
            *cover = self.cover(lattice, slabs, &range);
            offsets[slabs.of_cell(cover.first) + 2] += 1;
            if !cover.is_small() {
                for slab in slabs.reached(lattice, &range).skip(1) {
                    offsets[slab + 2] += 1;
                }
            }
        }
        if !is_within_limit(cells) {
            return None;
        }
        for slab in 2..offsets.len() {
            offsets[slab] += offsets[slab - 1];
        }
        let mut placed = bytemuck::zeroed_vec(offsets[slabs.count + 1] as usize);
        let mut put = |slab: usize, triangle: u32, cover: Cover| {
            let place = &mut offsets[slab + 1];
            placed[*place as usize] = Placed { triangle, cover };
            *place += 1;
        };
        for (triangle, cover) in (first..).zip(covers) {
            put(slabs.of_cell(cover.first), triangle, cover);
            if !cover.is_small() {
                let range = lattice.range(self.mesh.corners(triangle));
                for slab in slabs.reached(lattice, &range).skip(1) {
                    put(slab, triangle, cover);
                }
            }
        }
        offsets.truncate(slabs.count + 1);
        Some(Chunk { placed, offsets })
    }

    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "cells are counted with 32 bits"
    )]
    fn cover(&self, lattice: &Lattice, slabs: Slabs, range: &CellRange) -> Cover {
        let first = lattice.number(range.first) as u32;
        if self.overlap == Overlap::Exact && is_worth_a_test(range) {
            return Cover {
                first,
                kind: Cover::ASKED,
            };
        }
        let more = [0, 1, 2].map(|axis| range.last[axis] - range.first[axis]);
        let last = lattice.number(range.last) as u32;
        Cover::of_box(first, more, slabs.of_cell(first) == slabs.of_cell(last))
    }

    /// Finds the cells of all triangles of a slab, in the order of triangles.
    fn entries(
        &self,
        lattice: &Lattice,
        slabs: Slabs,
        slab: usize,
        chunks: &[Chunk],
        entries: &mut Entries<'_>,
    ) {
        let small = SmallBoxes::new(lattice.strides);
        let strides = lattice.strides.map(|stride| stride as usize);
        let cells = slabs.cells(slab);
        for chunk in chunks {
            for &Placed { triangle, cover } in chunk.of_slab(slab) {
                if cover.is_small() {
                    let first = cover.first as usize - cells.start;
                    entries.add_all(first, small.cells(cover.kind), triangle);
                    continue;
                }
                let enter = |cell: usize| {
                    if cells.contains(&cell) {
                        entries.add_all(cell - cells.start, &[0], triangle);
                    }
                };
                if cover.kind == Cover::ASKED {
                    self.ask(lattice, cells.clone(), triangle, enter);
                } else {
                    each_of_box(cover.first as usize, cover.counts(), strides, enter);
                }
            }
        }
    }

    /// Finds the cells of a triangle in the layers of a slab.
    #[cold]
    fn ask(&self, lattice: &Lattice, slab: Range<usize>, triangle: u32, enter: impl FnMut(usize)) {
        let corners = self.mesh.corners(triangle);
        let range = lattice.range(corners);
        let within = lattice.within(&range, slab.start, slab.end);
        if self.overlap == Overlap::Exact && is_worth_a_test(&range) {
            for_each_cell_met(lattice, &within, corners, enter);
        } else {
            for_each_cell(lattice, &within, enter);
        }
    }

    /// Counts the references of every cell, then enters them.
    fn enter(&self, lattice: Lattice, slabs: Slabs, chunks: &[Chunk], halvings: u32) -> Cells {
        // The pages come from the system, zeroed and not yet touched, so that threads share the work of touching them.
        let mut offsets: Vec<u32> = bytemuck::zeroed_vec(lattice.cells() + 1);
        // Each slab's offsets begin at its second cell's: a cell's place, while it is filled, is where the next one begins.
        let own_offsets = offsets[1..].chunks_mut(slabs.size());
        let own_offsets = own_offsets.enumerate().collect();
        let own_refs = tasks::map(own_offsets, self.is_parallel, |(slab, offsets)| {
            self.enter_slab(&lattice, slabs, slab, chunks, offsets)
        });
        // As many as `max_refs` allows, which 32 bits count.
        let count = own_refs.iter().map(Vec::len).sum();
        let mut refs: Vec<u32> = bytemuck::zeroed_vec(count);
        let (mut begin, mut rest) = (0, refs.as_mut_slice());
        let own_offsets = offsets[1..].chunks_mut(slabs.size());
        let parts = own_offsets.zip(own_refs).map(|(offsets, own_refs)| {
            let place;
            (place, rest) = std::mem::take(&mut rest).split_at_mut(own_refs.len());
            let first = begin;
            begin += offsets.last().copied().unwrap_or(0);
            (offsets, own_refs, place, first)
        });
        tasks::map(parts.collect(), self.is_parallel, |part| {
            let (offsets, own_refs, place, first) = part;
            place.copy_from_slice(&own_refs);
            for offset in offsets {
                *offset += first;
            }
        });
        Cells {
            lattice,
            offsets,
            refs,
            halvings,
        }
    }

    /// The references of a slab, cell by cell, and in `offsets` where those of each cell end.
    fn enter_slab(
        &self,
        lattice: &Lattice,
        slabs: Slabs,
        slab: usize,
        chunks: &[Chunk],
        offsets: &mut [u32],
    ) -> Vec<u32> {
        let mut entries = Entries {
            counts: offsets,
            list: Vec::new(),
        };
        self.entries(lattice, slabs, slab, chunks, &mut entries);
        let Entries {
            counts: offsets,
            list: entries,
        } = entries;
        let mut begin = 0;
        for offset in offsets.iter_mut() {
            begin += std::mem::replace(offset, begin);
        }
        let mut refs = vec![0; entries.len()];
        for [cell, triangle] in entries {
            let place = &mut offsets[cell as usize];
            refs[*place as usize] = triangle;
            *place += 1;
        }
        refs
    }
}

/// Which triangles are in which cells of a slab.
struct Entries<'a> {
    /// How many each cell has.
    counts: &'a mut [u32],
    /// Cells, told by their places in the slab, and triangles. Cells are found once, and written down: that takes less than
    /// finding them again.
    list: Vec<[u32; 2]>,
}

impl Entries<'_> {
    /// Adds a triangle to the cells that are so far from the first one.
    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a slab has at most 2^15 cells"
    )]
    fn add_all(&mut self, first: usize, cells: &[u32], triangle: u32) {
        // As a whole, so that there is one look at whether the list is long enough.
        self.list.extend(cells.iter().map(|cell| {
            let cell = first + *cell as usize;
            self.counts[cell] += 1;
            [cell as u32, triangle]
        }));
    }
}

/// Consecutive cells, as many in each slab as a power of two; the last one may have fewer.
#[derive(Clone, Copy, Debug)]
struct Slabs {
    power: u32,
    count: usize,
}

impl Slabs {
    /// The most cells of a slab, as a power of two: their offsets, of four bytes each, should stay near.
    const LARGEST: u32 = 15;
    /// The fewest, so that most triangles are in one.
    const SMALLEST: u32 = 12;

    /// So many that threads have about as much to do, if there are enough cells.
    fn of(lattice: &Lattice) -> Self {
        const MANY: usize = 16;
        let cells = lattice.cells();
        let wanted = (cells / MANY).max(1).ilog2();
        let power = wanted.clamp(Self::SMALLEST, Self::LARGEST);
        Self {
            power,
            count: cells.div_ceil(1 << power),
        }
    }

    /// Cells of each.
    fn size(self) -> usize {
        1 << self.power
    }

    /// The slab of a cell.
    #[inline(always)]
    fn of_cell(self, cell: u32) -> usize {
        (cell >> self.power) as usize
    }

    /// The cells of a slab, those included that a last one has not.
    #[inline(always)]
    fn cells(self, slab: usize) -> Range<usize> {
        slab << self.power..(slab + 1) << self.power
    }

    /// The slabs that a range of cells reaches into, and perhaps others between them.
    fn reached(self, lattice: &Lattice, range: &CellRange) -> Range<usize> {
        lattice.number(range.first) >> self.power..(lattice.number(range.last) >> self.power) + 1
    }
}

/// Boxes of one or two cells along each axis, cell by cell.
struct SmallBoxes {
    /// How far each cell is from the first one, by the axes along which there are two.
    cells: [[u32; 8]; 8],
    counts: [u8; 8],
}

impl SmallBoxes {
    fn new(strides: [u32; 3]) -> Self {
        let mut cells = [[0; 8]; 8];
        let mut counts = [0; 8];
        for (axes, (cells, count)) in cells.iter_mut().zip(&mut counts).enumerate() {
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
                *count += 1;
            }
        }
        Self { cells, counts }
    }

    /// Those of a small [`Cover`].
    #[inline(always)]
    fn cells(&self, kind: u32) -> &[u32] {
        let axes = (kind & 7) as usize;
        &self.cells[axes][..usize::from(self.counts[axes] & 15).min(8)]
    }
}
