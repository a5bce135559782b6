//! A primitive as builders move it around: 32 bytes, two vectors.

use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use kd_core::{Aabb, Axis};

/// A primitive, or the part of one that lies in a cell: the box around it, and which one it is.
///
/// The fourth component of `low` carries the number, so that one primitive is two aligned vectors and never straddles
/// a cache line. The fourth component of `high` is not used.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Prim {
    low: [f32; 4],
    high: [f32; 4],
}

const _: () = assert!(size_of::<Prim>() == 32, "two primitives to a cache line");

/// Set in the number's bits, so that as a float it is never denormal: arithmetic on whole vectors would slow down.
const NOT_DENORMAL: u32 = 1 << 30;

impl Prim {
    /// To fill memory with before it is written.
    pub(crate) const NONE: Self = Self {
        low: [0.0; 4],
        high: [0.0; 4],
    };

    /// Memory for so many.
    pub(crate) fn room_for(count: usize) -> Vec<Self> {
        bytemuck::zeroed_vec(count)
    }

    pub(crate) fn new(slot: u32, bounds: &Aabb) -> Self {
        let number = f32::from_bits(slot | NOT_DENORMAL);
        Self {
            low: bounds.min.extend(number).to_array(),
            high: bounds.max.extend(0.0).to_array(),
        }
    }

    /// Which one: its number in the source.
    #[inline]
    pub(crate) fn slot(&self) -> u32 {
        self.low[3].to_bits() & !NOT_DENORMAL
    }

    /// Where it starts along an axis.
    #[inline]
    pub(crate) fn start(&self, axis: Axis) -> f32 {
        self.low[axis.index()]
    }

    /// Where it ends along an axis.
    #[inline]
    pub(crate) fn end(&self, axis: Axis) -> f32 {
        self.high[axis.index()]
    }

    /// Starts along all axes and something else, then ends and something else.
    #[inline]
    pub(crate) fn ends(&self) -> &[f32; 8] {
        bytemuck::cast_ref(self)
    }

    /// The box around the part.
    #[inline]
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb {
            min: self.low().truncate(),
            max: self.high().truncate(),
        }
    }

    /// All starts, with something in the fourth component.
    #[inline]
    pub(crate) fn low(&self) -> Vec4 {
        Vec4::from_array(self.low)
    }

    /// All ends, with something in the fourth component.
    #[inline]
    pub(crate) fn high(&self) -> Vec4 {
        Vec4::from_array(self.high)
    }
}

/// The box around primitives, while it grows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    low: Vec4,
    high: Vec4,
}

impl Around {
    pub(crate) const NOTHING: Self = Self {
        low: Vec4::INFINITY,
        high: Vec4::NEG_INFINITY,
    };

    /// A box that has grown already.
    pub(crate) fn of(bounds: &Aabb) -> Self {
        Self {
            low: bounds.min.extend(0.0),
            high: bounds.max.extend(0.0),
        }
    }

    #[inline]
    pub(crate) fn add(&mut self, prim: &Prim) {
        self.low = self.low.min(prim.low());
        self.high = self.high.max(prim.high());
    }

    /// The box around both.
    pub(crate) fn and(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// [`Aabb::EMPTY`] if nothing was added.
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb {
            min: self.low.truncate(),
            max: self.high.truncate(),
        }
    }
}

/// What tests of other modules look at.
#[cfg(test)]
pub(crate) mod samples {
    use super::*;

    /// Boxes at whole numbers, of as many halves a side, and the box around them.
    pub(crate) fn boxes(corners_and_sizes: &[([i8; 3], [i8; 3])]) -> (Vec<Prim>, Aabb) {
        let prim = |(slot, (min, size)): (u32, &([i8; 3], [i8; 3]))| {
            let [min, size] = [*min, *size].map(|v| glam::Vec3::from_array(v.map(f32::from)));
            let max = min + 0.5 * size;
            Prim::new(slot, &Aabb { min, max })
        };
        let prims: Vec<Prim> = (0_u32..).zip(corners_and_sizes).map(prim).collect();
        let bounds = prims.iter().map(Prim::bounds);
        let all = bounds.fold(Aabb::EMPTY, |all, one| all.union(&one));
        (prims, all)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn numbers_of_30_bits_survive() {
        let bounds = Aabb::around([Vec3::NEG_ONE, Vec3::ONE]);
        for slot in [0, 1, 12_345, 0x3f80_0000, (1 << 30) - 1] {
            let prim = Prim::new(slot, &bounds);
            assert_eq!((prim.slot(), prim.bounds()), (slot, bounds), "{slot}");
            let copy = prim;
            assert_eq!(copy.slot(), slot, "moved, even where it looks like NaN");
        }
    }
}
