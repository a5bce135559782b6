//! The representation of a primitive that builders move: 32 bytes, two vectors.

use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use kd_core::{Aabb, Axis};

/// The box around a primitive, or around a primitive clipped to a cell, and the slot of the primitive.
///
/// The fourth component of `low` holds the slot, so that a primitive is two aligned vectors and never straddles a cache
/// line. The fourth component of `high` is not used.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Prim {
    low: [f32; 4],
    high: [f32; 4],
}

const _: () = assert!(size_of::<Prim>() == 32, "two primitives to a cache line");

/// A bit added to the slot, so that the slot read as a float is never denormal: denormals slow down vector arithmetic.
const NOT_DENORMAL: u32 = 1 << 30;

impl Prim {
    /// An initial value for memory that is written later.
    pub(crate) const NONE: Self = Self {
        low: [0.0; 4],
        high: [0.0; 4],
    };

    /// Memory for `count` primitives.
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

    /// The slot of the primitive: its number in the source.
    #[inline]
    pub(crate) fn slot(&self) -> u32 {
        self.low[3].to_bits() & !NOT_DENORMAL
    }

    /// The lower end of the box along an axis.
    #[inline]
    pub(crate) fn start(&self, axis: Axis) -> f32 {
        self.low[axis.index()]
    }

    /// The upper end of the box along an axis.
    #[inline]
    pub(crate) fn end(&self, axis: Axis) -> f32 {
        self.high[axis.index()]
    }

    /// The starts along all axes and one unspecified number, then the ends and one unspecified number.
    #[inline]
    pub(crate) fn ends(&self) -> &[f32; 8] {
        bytemuck::cast_ref(self)
    }

    /// The box.
    #[inline]
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb {
            min: self.low().truncate(),
            max: self.high().truncate(),
        }
    }

    /// The starts along all axes; the fourth component is unspecified.
    #[inline]
    pub(crate) fn low(&self) -> Vec4 {
        Vec4::from_array(self.low)
    }

    /// The ends along all axes; the fourth component is unspecified.
    #[inline]
    pub(crate) fn high(&self) -> Vec4 {
        Vec4::from_array(self.high)
    }
}

/// A box that grows to contain primitives.
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

    /// A growing box that starts as `bounds`.
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

    /// The union of both boxes.
    pub(crate) fn and(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// The box; [`Aabb::EMPTY`] if no primitive was added.
    pub(crate) fn bounds(&self) -> Aabb {
        Aabb {
            min: self.low.truncate(),
            max: self.high.truncate(),
        }
    }
}

/// Primitives for the tests of other modules.
#[cfg(test)]
pub(crate) mod samples {
    use super::*;

    /// Boxes with integer corners and sizes in halves, and the box around all of them.
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
    fn slots_of_30_bits_are_stored_exactly() {
        let bounds = Aabb::around([Vec3::NEG_ONE, Vec3::ONE]);
        for slot in [0, 1, 12_345, 0x3f80_0000, (1 << 30) - 1] {
            let prim = Prim::new(slot, &bounds);
            assert_eq!((prim.slot(), prim.bounds()), (slot, bounds), "{slot}");
            let copy = prim;
            assert_eq!(
                copy.slot(),
                slot,
                "copied, also if the bits are those of a NaN"
            );
        }
    }
}
