//! Divides the primitives of a cell by a plane, in the memory of the cell: one side stays, the other moves to free memory.

use glam::Vec3;
use kd_core::{Aabb, PrimSource};
use kd_simd::{LANES, Level, Mask, Number, Simd, Task};
use smallvec::SmallVec;

use crate::CHUNK;
use crate::bits::numbers;
use crate::cell::{Counted, Place};
use crate::plane::{Plane, Side};
use crate::prim::{Around, Prim};

/// The number of primitives that move when a large cell is divided, chunk by chunk.
pub(crate) struct ChunkCounts {
    moving: Vec<usize>,
}

impl ChunkCounts {
    /// Counts on several threads; `None` if the plane cuts off empty space only.
    pub(crate) fn of<S: PrimSource>(division: &Division<'_, S>, cell: &[Prim]) -> Option<Self> {
        if division.cuts_nothing().is_some() {
            return None;
        }
        let moves = division.staying().other();
        let chunks = cell.chunks(CHUNK).collect();
        let moving = kd_tasks::map(chunks, true, |chunk: &[Prim]| {
            Counted::of(chunk, division.plane).at(moves)
        });
        Some(Self { moving })
    }

    /// The number that moves in all.
    pub(crate) fn total(&self) -> usize {
        self.moving.iter().sum()
    }
}

/// A plane that divides a cell.
pub(crate) struct Division<'a, S> {
    pub(crate) source: &'a S,
    pub(crate) place: &'a Place,
    pub(crate) plane: &'a Plane,
}

/// Both sides of a divided cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Divided {
    /// The places of the lower and the upper side.
    pub(crate) places: [Place; 2],
    pub(crate) counted: Counted,
    /// The side that stays in the memory of the cell. The other one is in the memory that was free. Each is at the front.
    stays: Side,
}

/// The primitives of a cell, and memory for those of the cells below it.
pub(crate) struct Room<'a> {
    pub(crate) prims: &'a mut [Prim],
    pub(crate) free: &'a mut [Prim],
}

impl Divided {
    /// One side with all free memory, where the lower side is built before the upper one: the upper side is kept meanwhile, and
    /// gets all of the memory afterwards.
    pub(crate) fn one<'a>(
        &self,
        part: Side,
        cell: &'a mut [Prim],
        free: &'a mut [Prim],
    ) -> Room<'a> {
        let Counted { lower, upper } = self.counted;
        let (prims, free) = match (self.stays, part) {
            (Side::Lower, Side::Lower) => (&mut cell[..lower], &mut free[upper..]),
            (Side::Lower, Side::Upper) => (&mut free[..upper], cell),
            (Side::Upper, Side::Lower) => free.split_at_mut(lower),
            (Side::Upper, Side::Upper) => (&mut cell[..upper], free),
        };
        Room { prims, free }
    }

    /// Both sides, with the free memory divided between them.
    pub(crate) fn both<'a>(&self, cell: &'a mut [Prim], free: &'a mut [Prim]) -> [Room<'a>; 2] {
        let Counted { lower, upper } = self.counted;
        let (lower_memory, upper_memory) = match self.stays {
            Side::Lower => (cell, free),
            Side::Upper => (free, cell),
        };
        let (lower, below) = lower_memory.split_at_mut(lower);
        let (upper, above) = upper_memory.split_at_mut(upper);
        // The side that stays is likely to be the larger one, and the memory that was free has more left.
        [(lower, above), (upper, below)].map(|(prims, free)| Room { prims, free })
    }
}

/// Primitives that are divided together: a bit for each fits an integer.
const BLOCK: usize = 64;

/// A copy of some primitives, divided while the originals are overwritten.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    prims: [Prim; BLOCK],
    count: usize,
}

impl Default for Block {
    fn default() -> Self {
        Self {
            prims: [Prim::NONE; BLOCK],
            count: 0,
        }
    }
}

impl Block {
    /// Copies the first ones of a list.
    fn copy_from(&mut self, prims: &[Prim]) {
        self.count = prims.len().min(BLOCK);
        self.prims[..self.count].copy_from_slice(&prims[..self.count]);
    }
}

/// A bit for each primitive of a block.
type Bits = u64;

/// [`Division::divide`] at some level.
struct Divide<'a, 'l, S> {
    division: &'a Division<'a, S>,
    block: &'a Block,
    lists: [&'l mut [Prim]; 2],
    filled: &'l mut Filled,
}

impl<L: Simd, S: PrimSource> Task<L> for Divide<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run(self, simd: L) {
        self.division
            .divide_by(simd, self.block, self.lists, self.filled);
    }
}

/// The number of primitives stored on each side, and the boxes around them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Filled {
    counted: Counted,
    lower_tight: Around,
    upper_tight: Around,
}

impl<S: PrimSource> Division<'_, S> {
    /// Divides a cell in its memory: one side stays, and the other moves to the front of the free memory, which must have room
    /// for [`moving`](Self::moving) primitives.
    pub(crate) fn in_place(
        &self,
        cell: &mut [Prim],
        free: &mut [Prim],
        block: &mut Block,
    ) -> Divided {
        if let Some(stays) = self.cuts_nothing() {
            return self.divided(&Filled::all(stays, cell.len(), &self.place.tight), stays);
        }
        let stays = self.staying();
        let mut filled = Filled::NOTHING;
        self.divide_within(cell, stays, free, block, &mut filled);
        self.divided(&filled, stays)
    }

    /// Divides a cell, or a chunk of one: one side to its front, the other to the front of other memory.
    fn divide_within(
        &self,
        cell: &mut [Prim],
        stays: Side,
        moved: &mut [Prim],
        block: &mut Block,
        filled: &mut Filled,
    ) {
        let mut from = 0;
        while from < cell.len() {
            // Writes never pass the primitives that were read.
            block.copy_from(&cell[from..]);
            from += block.count;
            let lists = match stays {
                Side::Lower => [&mut *cell, &mut *moved],
                Side::Upper => [&mut *moved, &mut *cell],
            };
            self.divide(block, lists, filled);
        }
    }

    /// The side of all primitives, if the plane cuts off empty space: known from the box around them.
    fn cuts_nothing(&self) -> Option<Side> {
        let (axis, tight) = (self.plane.axis.index(), &self.place.tight);
        let is_below = tight.max[axis] < self.plane.position;
        let is_above = tight.min[axis] > self.plane.position;
        match self.plane.planar_side {
            _ if is_below => Some(Side::Lower),
            _ if is_above => Some(Side::Upper),
            Side::Lower if tight.max[axis] == self.plane.position => Some(Side::Lower),
            Side::Upper if tight.min[axis] == self.plane.position => Some(Side::Upper),
            _ => None,
        }
    }

    /// The side that stays, because it is likely to hold more: the one with more of the box around the primitives, or with all of
    /// it where empty space is cut off.
    fn staying(&self) -> Side {
        let axis = self.plane.axis.index();
        let (below, above) = (
            self.plane.position - self.place.tight.min[axis],
            self.place.tight.max[axis] - self.plane.position,
        );
        if below > above {
            Side::Lower
        } else {
            Side::Upper
        }
    }

    /// The number of primitives that move if the cell is divided in place.
    pub(crate) fn moving(&self, cell: &[Prim]) -> usize {
        if self.cuts_nothing().is_some() {
            return 0;
        }
        Counted::of(cell, self.plane).at(self.staying().other())
    }

    /// [`in_place`](Self::in_place) for a large cell, in chunks on several threads (`ClassifyTriangles` and
    /// `FilterGeometry` of Choi et al. 2010). The moving primitives of each chunk are counted before, so that each chunk knows
    /// where it writes, and the order is that of the cell.
    pub(crate) fn in_chunks(
        &self,
        cell: &mut [Prim],
        free: &mut [Prim],
        ChunkCounts { moving }: &ChunkCounts,
    ) -> Divided {
        let stays = self.staying();
        let mut chunks = Vec::with_capacity(moving.len());
        let mut rest = &mut *free;
        for (chunk, &count) in cell.chunks_mut(CHUNK).zip(moving) {
            let moved;
            (moved, rest) = rest.split_at_mut(count);
            chunks.push((chunk, moved));
        }
        let filled = kd_tasks::map(chunks, true, |(chunk, moved)| {
            let mut filled = Filled::NOTHING;
            self.divide_within(chunk, stays, moved, &mut Block::default(), &mut filled);
            filled
        });
        let counts = |side| filled.iter().map(move |chunk| chunk.counted.at(side));
        let lengths = std::iter::repeat_n(CHUNK, moving.len());
        close_gaps(cell, counts(stays).zip(lengths));
        close_gaps(free, counts(stays.other()).zip(moving.iter().copied()));
        let all = filled.iter().copied().reduce(|all, chunk| all.and(&chunk));
        self.divided(&all.unwrap_or(Filled::NOTHING), stays)
    }

    fn divided(&self, filled: &Filled, stays: Side) -> Divided {
        let (lower, upper) = self
            .place
            .bounds
            .split(self.plane.axis, self.plane.position);
        let places = [(lower, filled.lower_tight), (upper, filled.upper_tight)];
        Divided {
            places: places.map(|(bounds, tight)| Place {
                bounds,
                tight: tight.bounds(),
                depth: self.place.depth + 1,
            }),
            counted: filled.counted,
            stays,
        }
    }

    /// Divides a block: appends to both lists, in order, and updates `filled`. A primitive that straddles the plane is clipped
    /// from the original primitive again ("perfect split").
    ///
    /// All builders divide by this one function, so equal planes give equal trees.
    fn divide(&self, block: &Block, lists: [&mut [Prim]; 2], filled: &mut Filled) {
        Level::detect().run(Divide {
            division: self,
            block,
            lists,
            filled,
        });
    }

    /// The side of a primitive is unpredictable, so no branch depends on it: bits of all primitives are computed first, and each
    /// list copies its own.
    #[inline(always)]
    fn divide_by(
        &self,
        simd: impl Simd,
        block: &Block,
        [lower_list, upper_list]: [&mut [Prim]; 2],
        filled: &mut Filled,
    ) {
        let [lower_bits, upper_bits] = self.sides(simd, block);
        let Counted { lower, upper } = filled.counted;
        let (lower_list, upper_list) = (&mut lower_list[lower..], &mut upper_list[upper..]);
        let mut lower = take(&block.prims, lower_bits, lower_list);
        let mut upper = take(&block.prims, upper_bits, upper_list);

        let cut = lower_bits & upper_bits;
        if cut != 0 {
            // All shapes are fetched before the first one is needed.
            let mut shapes = SmallVec::<[S::Shape; BLOCK]>::new();
            shapes.extend(
                numbers::<BLOCK>(cut).map(|number| self.source.shape(block.prims[number].slot())),
            );
            // The last one first: a primitive that clipping finds empty is removed, and moves only those that are done.
            let mut rest = cut;
            for shape in shapes.iter().rev() {
                let number = rest.ilog2();
                let before = (1 << number) - 1;
                rest &= before;
                let at = |bits: Bits| (bits & before).count_ones() as usize;
                let [below, above] = self.cut(&block.prims[number as usize], shape);
                lower -= mend(&mut lower_list[at(lower_bits)..lower], below);
                upper -= mend(&mut upper_list[at(upper_bits)..upper], above);
            }
        }
        for prim in &lower_list[..lower] {
            filled.lower_tight.add(prim);
        }
        for prim in &upper_list[..upper] {
            filled.upper_tight.add(prim);
        }
        filled.counted.lower += lower;
        filled.counted.upper += upper;
    }

    /// The primitives of a block that go to the lower and to the upper side; those in both are cut.
    #[inline(always)]
    fn sides(&self, simd: impl Simd, block: &Block) -> [Bits; 2] {
        let Plane { axis, position, .. } = *self.plane;
        let plane = simd.splat(position);
        let (mut below, mut above) = (0, 0);
        let (groups, _) = block.prims.as_chunks::<LANES>();
        for (number, group) in groups[..block.count.div_ceil(LANES)].iter().enumerate() {
            let starts = simd.values(group.each_ref().map(|prim| prim.start(axis)));
            let ends = simd.values(group.each_ref().map(|prim| prim.end(axis)));
            below |= Bits::from(starts.lt(plane).bits()) << (LANES * number);
            above |= Bits::from(plane.lt(ends).bits()) << (LANES * number);
        }
        let all = Bits::MAX >> (BLOCK - block.count);
        let sides = match self.plane.planar_side {
            Side::Lower => [below | !above, above],
            Side::Upper => [below, above | !below],
        };
        sides.map(|bits| bits & all)
    }

    /// The parts of a primitive that the plane cuts.
    ///
    /// Faces of the cell that the part inside does not touch need no clipping: the part is convex, and would have to cross a
    /// face to reach beyond it. (A shape that is not convex may reach further, and is cut to the known box: its parts are then
    /// larger than necessary, and still valid.)
    #[inline(always)]
    fn cut(&self, prim: &Prim, shape: &S::Shape) -> [Option<Prim>; 2] {
        let (plane, cell, whole) = (self.plane, &self.place.bounds, prim.bounds());
        let infinite = Vec3::splat(f32::INFINITY);
        let touched = Aabb {
            min: Vec3::select(whole.min.cmpgt(cell.min), -infinite, cell.min),
            max: Vec3::select(whole.max.cmplt(cell.max), infinite, cell.max),
        };
        let parts = self
            .source
            .clipped_halves(shape, &touched, plane.axis, plane.position)
            .map(|part| part.map(|part| part.intersection(&whole)));
        let parts = if parts == [None, None] {
            // Rounding put a sliver outside both sides; it must not be lost.
            let (below, above) = whole.split(plane.axis, plane.position);
            [Some(below), Some(above)]
        } else {
            parts
        };
        parts.map(|part| part.map(|bounds| Prim::new(prim.slot(), &bounds)))
    }
}

impl Filled {
    const NOTHING: Self = Self {
        counted: Counted { lower: 0, upper: 0 },
        lower_tight: Around::NOTHING,
        upper_tight: Around::NOTHING,
    };

    /// All on one side.
    fn all(side: Side, count: usize, tight: &Aabb) -> Self {
        let (nothing, all) = (Self::NOTHING, Around::of(tight));
        match side {
            Side::Lower => Self {
                counted: Counted {
                    lower: count,
                    upper: 0,
                },
                lower_tight: all,
                ..nothing
            },
            Side::Upper => Self {
                counted: Counted {
                    lower: 0,
                    upper: count,
                },
                upper_tight: all,
                ..nothing
            },
        }
    }

    /// The union with another one.
    fn and(&self, other: &Self) -> Self {
        Self {
            counted: Counted {
                lower: self.counted.lower + other.counted.lower,
                upper: self.counted.upper + other.counted.upper,
            },
            lower_tight: self.lower_tight.and(&other.lower_tight),
            upper_tight: self.upper_tight.and(&other.upper_tight),
        }
    }
}

/// Copies the primitives of the set bits to the front of a list, and returns their number.
#[inline(always)]
fn take(prims: &[Prim; BLOCK], bits: Bits, list: &mut [Prim]) -> usize {
    let count = bits.count_ones() as usize;
    for (place, number) in list[..count].iter_mut().zip(numbers::<BLOCK>(bits)) {
        *place = prims[number];
    }
    count
}

/// Replaces the first primitive of a list by a part of it, or removes it if there is no part. Returns the number removed.
#[inline(always)]
fn mend(list: &mut [Prim], part: Option<Prim>) -> usize {
    if let Some(part) = part {
        list[0] = part;
        0
    } else {
        list.copy_within(1.., 0);
        1
    }
}

/// Closes the gaps between chunks, where clipping left fewer primitives than were counted.
fn close_gaps(prims: &mut [Prim], chunks: impl Iterator<Item = (usize, usize)>) {
    let (mut to, mut from) = (0, 0);
    for (filled, counted) in chunks {
        if to < from {
            prims.copy_within(from..from + filled, to);
        }
        to += filled;
        from += counted;
    }
}

#[cfg(test)]
mod tests {
    use kd_core::{Axis, Mesh};
    use proptest::prelude::*;

    use super::*;
    use crate::cell::Lies;

    /// Small triangles, some of them flat, in a cube of 6.
    fn soup() -> impl Strategy<Value = Mesh> {
        let corner = || [0_u8..6, 0_u8..6, 0_u8..6].prop_map(|at| at.map(f32::from));
        prop::collection::vec([corner(), corner(), corner()], 1..150).prop_map(|soup| {
            let corners = soup.as_flattened().to_vec();
            let triangles = (0_u32..).step_by(3).map(|i| [i, i + 1, i + 2]);
            Mesh::new(corners, triangles.take(soup.len()).collect()).expect("finite")
        })
    }

    /// The lists of both parts, one primitive after the other.
    fn divided_slowly(division: &Division<'_, Mesh>, cell: &[Prim]) -> [Vec<Prim>; 2] {
        let [mut lower, mut upper] = [const { Vec::new() }; 2];
        for prim in cell {
            match Lies::of(prim, division.plane) {
                Lies::Below => lower.push(*prim),
                Lies::Above => upper.push(*prim),
                Lies::Across => {
                    let shape = division.source.shape(prim.slot());
                    let [below, above] = division.cut(prim, &shape);
                    lower.extend(below);
                    upper.extend(above);
                }
            }
        }
        [lower, upper]
    }

    fn tight(prims: &[Prim]) -> Aabb {
        let all = prims.iter().map(Prim::bounds);
        all.fold(Aabb::EMPTY, |all, one| all.union(&one))
    }

    proptest! {
        /// In place, in chunks, and at the portable level, compared with one primitive after the other; twice in a row, so
        /// that the second time there are parts of triangles.
        #[test]
        fn all_ways_divide_the_same(
            mesh in soup(),
            axes in [0_usize..3, 0_usize..3],
            positions in [1_u8..12, 1_u8..12],
            planar_lower: bool,
        ) {
            let mut prims: Vec<Prim> = (0..mesh.count()).map(|slot| Prim::new(slot, &PrimSource::bounds(&mesh, slot))).collect();
            let mut place = Place { bounds: mesh.bounds(), tight: mesh.bounds(), depth: 0 };
            for (axis, position) in axes.into_iter().zip(positions) {
                let plane = Plane {
                    axis: Axis::ALL[axis],
                    position: 0.5 * f32::from(position),
                    planar_side: if planar_lower { Side::Lower } else { Side::Upper },
                    cost: 0.0,
                };
                if !(place.bounds.min[axis] < plane.position && plane.position < place.bounds.max[axis]) {
                    continue;
                }
                let division = Division { source: &mesh, place: &place, plane: &plane };
                let slowly = divided_slowly(&division, &prims);

                let mut free = Prim::room_for(2 * prims.len());
                let mut cell = prims.clone();
                let divided = match ChunkCounts::of(&division, &prims) {
                    Some(counts) => division.in_chunks(&mut cell, &mut free, &counts),
                    None => division.in_place(&mut cell, &mut free, &mut Block::default()),
                };
                let rooms = divided.both(&mut cell, &mut free);
                for (side, room) in rooms.iter().enumerate() {
                    prop_assert_eq!(&*room.prims, &slowly[side][..], "in chunks");
                    prop_assert_eq!(divided.places[side].tight, tight(&slowly[side]));
                }

                let [mut lower, mut upper] = [0, 1].map(|_| Prim::room_for(prims.len()));
                let mut filled = Filled::NOTHING;
                let mut block = Block::default();
                for chunk in prims.chunks(BLOCK) {
                    block.copy_from(chunk);
                    Level::portable().run(Divide {
                        division: &division,
                        block: &block,
                        lists: [&mut lower, &mut upper],
                        filled: &mut filled,
                    });
                }
                prop_assert_eq!(&lower[..filled.counted.lower], &slowly[0][..], "portable");
                prop_assert_eq!(&upper[..filled.counted.upper], &slowly[1][..], "portable");

                let mut free = Prim::room_for(division.moving(&prims));
                let divided = division.in_place(&mut prims, &mut free, &mut block);
                let rooms = divided.both(&mut prims, &mut free).map(|room| room.prims.to_vec());
                prop_assert_eq!(&rooms, &slowly, "in place");
                for (side, part) in [Side::Lower, Side::Upper].into_iter().zip(&slowly) {
                    prop_assert_eq!(&*divided.one(side, &mut prims, &mut free).prims, &part[..]);
                }
                place = divided.places[0];
                [prims, _] = rooms;
            }
        }
    }
}
