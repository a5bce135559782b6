//! Entries, pairs of a triangle and a cell, sorted by slabs of cells.

use crate::small_boxes::CELLS;

/// Triangles per chunk.
pub(crate) const CHUNK: usize = 1 << CHUNK_POWER;
const CHUNK_POWER: u32 = 10;

/// Ranges of consecutive cells. The size is a power of two; the last slab may have fewer cells.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slabs {
    power: u32,
    count: usize,
}

impl Slabs {
    /// 32 bits hold the index of a cell in the slab and of a triangle in a chunk. The offsets of a slab take 4 MiB.
    const LARGEST: u32 = 20;
    /// With fewer cells, the overhead per slab would matter.
    const SMALLEST: u32 = 12;

    /// One slab if possible, or several per thread to balance the load.
    pub(crate) fn new(cells: usize, is_parallel: bool) -> Self {
        const PER_THREAD: usize = 8;
        let wanted = if is_parallel {
            PER_THREAD * kd_tasks::threads()
        } else {
            1
        };
        let power = cells.div_ceil(wanted).next_power_of_two().ilog2();
        let power = power.clamp(Self::SMALLEST, Self::LARGEST);
        Self {
            power,
            count: cells.div_ceil(1 << power),
        }
    }

    /// Cells per slab.
    pub(crate) fn size(self) -> usize {
        1 << self.power
    }
}

/// Index of a triangle in its chunk in the lowest bits, number of the cell above.
type Wide = u64;

/// Index of a triangle in its chunk in the lowest bits, index of a cell in its slab above.
#[derive(Clone, Copy, Debug, bytemuck::Zeroable)]
#[repr(transparent)]
pub(crate) struct Entry(u32);

impl Entry {
    /// Index of the cell in its slab.
    #[inline(always)]
    pub(crate) fn cell(self) -> usize {
        (self.0 >> CHUNK_POWER) as usize
    }

    /// Index of the triangle in its chunk.
    #[inline(always)]
    pub(crate) fn triangle(self) -> u32 {
        self.0 % (1 << CHUNK_POWER)
    }
}

/// Entries of a chunk in the order of triangles.
#[derive(Debug, Default)]
pub(crate) struct Entries {
    /// Has spare length behind the last entry.
    list: Vec<Wide>,
    len: usize,
}

impl Entries {
    /// Small boxes are written in pieces of this length.
    const PIECE: usize = CELLS / 2;

    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Enters a triangle in a cell.
    #[inline]
    pub(crate) fn add(&mut self, cell: usize, triangle: u32) {
        self.make_room();
        self.list[self.len] = (cell as Wide) << CHUNK_POWER | Wide::from(triangle);
        self.len += 1;
    }

    /// Enters a triangle in the first `count` of `cells`, which are offsets from the cell `first`.
    #[inline(always)]
    pub(crate) fn add_all(
        &mut self,
        first: u32,
        (cells, count): (&[u32; CELLS], usize),
        triangle: u32,
    ) {
        self.make_room();
        let (places, _) = self.list[self.len..].as_chunks_mut::<{ Self::PIECE }>();
        let (cells, _) = cells.as_chunks::<{ Self::PIECE }>();
        // Usually one piece. Later entries overwrite what it writes beyond the last cell.
        for (places, cells) in places
            .iter_mut()
            .zip(cells)
            .take(1 + usize::from(count > Self::PIECE))
        {
            for (place, cell) in places.iter_mut().zip(cells) {
                *place = Wide::from(first + cell) << CHUNK_POWER | Wide::from(triangle);
            }
        }
        self.len += count;
    }

    /// Reserves the length of a small box.
    #[inline(always)]
    fn make_room(&mut self) {
        if self.list.len() < self.len + CELLS {
            self.list.resize(2 * self.len + 4 * CHUNK, 0);
        }
    }

    /// Sorts entries by slab; within a slab they stay in the order of triangles.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "an entry is the low half of a wide one, and entries are counted in 32 bits"
    )]
    pub(crate) fn sorted_by(&self, slabs: Slabs) -> Chunk {
        let all = &self.list[..self.len];
        if slabs.count == 1 {
            return Chunk {
                entries: all.iter().map(|entry| Entry(*entry as u32)).collect(),
                ends: vec![all.len() as u32],
            };
        }
        let shift = CHUNK_POWER + slabs.power;
        let slab_of = |entry: Wide| (entry >> shift) as usize;
        // Four interleaved streams with counters of their own: consecutive entries are mostly of one slab, and increments of one
        // counter would wait for each other.
        let quarter = all.len() / STREAMS;
        let (streams, rest) = all.split_at(quarter * STREAMS);
        let (a, bcd) = streams.split_at(quarter);
        let (b, cd) = bcd.split_at(quarter);
        let (c, d) = cd.split_at(quarter);
        let in_turn = || a.iter().zip(b).zip(c.iter().zip(d));
        let mut places = vec![[0_u32; STREAMS]; slabs.count];
        for ((a, b), (c, d)) in in_turn() {
            for (stream, entry) in [a, b, c, d].into_iter().enumerate() {
                places[slab_of(*entry)][stream] += 1;
            }
        }
        for entry in rest {
            places[slab_of(*entry)][STREAMS - 1] += 1;
        }
        let mut begin = 0;
        for place in places.as_flattened_mut() {
            begin += std::mem::replace(place, begin);
        }
        let mut entries: Vec<Entry> = bytemuck::zeroed_vec(all.len());
        let mut put = |entry: Wide, stream: usize| {
            let place = &mut places[slab_of(entry)][stream];
            entries[*place as usize] = Entry((entry & ((1 << shift) - 1)) as u32);
            *place += 1;
        };
        for ((a, b), (c, d)) in in_turn() {
            for (stream, entry) in [a, b, c, d].into_iter().enumerate() {
                put(*entry, stream);
            }
        }
        for entry in rest {
            put(*entry, STREAMS - 1);
        }
        Chunk {
            entries,
            ends: places.iter().map(|places| places[STREAMS - 1]).collect(),
        }
    }
}

const STREAMS: usize = 4;

/// Entries of a chunk, sorted by slab.
pub(crate) struct Chunk {
    entries: Vec<Entry>,
    /// End of the entries of each slab.
    ends: Vec<u32>,
}

impl Chunk {
    /// Number of entries.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// The entries of a slab.
    #[inline]
    pub(crate) fn of_slab(&self, slab: usize) -> &[Entry] {
        let begin = slab.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.entries[begin as usize..self.ends[slab] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest index of a triangle in a chunk.
    const MOST: u32 = (1 << CHUNK_POWER) - 1;

    /// Entries of cells up to 40 000, in runs and out of order.
    fn some(count: u32) -> Entries {
        let mut entries = Entries::default();
        for i in 0..count {
            entries.add((i * i / 7 % 1000 * 40) as usize, i % (MOST + 1));
        }
        entries
    }

    /// All cells and triangles, in order.
    fn pairs(entries: &Entries) -> Vec<(u64, u64)> {
        let all = entries.list[..entries.len].iter();
        all.map(|entry| (entry >> CHUNK_POWER, entry % CHUNK as Wide))
            .collect()
    }

    #[test]
    fn slabs_keep_the_order_of_entries() {
        for (power, count) in [(12, 10), (16, 1)] {
            let slabs = Slabs { power, count };
            for length in [0, 1, 2, 3, 4, 5, 7, 100, 1023] {
                let entries = some(length);
                let chunk = entries.sorted_by(slabs);
                assert_eq!(chunk.len(), length as usize, "all");
                for slab in 0..count {
                    let first = (slab << power) as u64;
                    let mut own = pairs(&entries);
                    own.retain(|(cell, _)| (first..first + (1 << power)).contains(cell));
                    let found = chunk.of_slab(slab).iter();
                    let found: Vec<(u64, u64)> = found
                        .map(|entry| (first + entry.cell() as u64, entry.triangle().into()))
                        .collect();
                    assert_eq!(found, own, "slab {slab} of {count}, {length} entries");
                }
            }
        }
    }

    #[test]
    fn small_boxes_keep_earlier_entries() {
        let mut entries = Entries::default();
        let cells = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
        let mut expected = Vec::new();
        for (first, count) in [(0, 1), (100, 8), (200, 9), (300, 15), (400, 2), (500, 7)] {
            entries.add_all(first, (&cells, count), MOST);
            let own = cells[..count].iter();
            expected.extend(own.map(|cell| (u64::from(first + cell), MOST.into())));
        }
        entries.add(5000, 3);
        expected.push((5000, 3));
        assert_eq!(pairs(&entries), expected, "cell by cell");
    }

    #[test]
    fn slabs_cover_all_cells() {
        for cells in [
            1,
            4095,
            4096,
            4097,
            1 << 20,
            (1 << 20) + 1,
            1 << 28,
            u32::MAX as usize,
        ] {
            for is_parallel in [false, true] {
                let slabs = Slabs::new(cells, is_parallel);
                let (whole, last) = (slabs.size() * slabs.count, slabs.size());
                assert!(whole - last < cells && cells <= whole, "{cells}");
                assert!(slabs.power + CHUNK_POWER <= 32, "bits of an entry: {cells}");
            }
        }
    }
}
