//! Bins along the three axes, and what they count: shared by object splits and plane splits.

use glam::Vec3A;

use crate::box_tree::Item;

/// 2²³: adding it leaves the nearest integer in the lowest bits.
const TO_INTEGER: f32 = (1 << 23) as f32;

/// The number of the last of `COUNT` bins, which is a mask of bits.
#[allow(clippy::cast_possible_truncation, reason = "few bins")]
pub(crate) const fn last_of<const COUNT: usize>() -> u32 {
    assert!(COUNT.is_power_of_two() && COUNT <= 256, "few, and a mask");
    COUNT as u32 - 1
}

/// Bins of equal width on each axis. The first and the last are half as wide.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bins {
    start: Vec3A,
    per_unit: Vec3A,
    /// The number of the last bin, one less than a power of two.
    last: u32,
}

impl Bins {
    /// Bins from `start` to `end`, numbered from 0 to `last`.
    pub(crate) fn new(start: Vec3A, end: Vec3A, last: u32) -> Self {
        Self {
            start,
            per_unit: Vec3A::splat(last as f32) / (end - start),
            last,
        }
    }

    /// Whether the bins of an axis are apart: it has an extent, which does not overflow.
    pub(crate) fn divide(&self, axis: usize) -> bool {
        let per_unit = self.per_unit[axis];
        per_unit > 0.0 && per_unit.is_finite()
    }

    /// Which of `COUNT` bins a point is in, on each axis. On an axis that the bins do not divide it is any of them.
    #[inline(always)]
    pub(crate) fn of<const COUNT: usize>(&self, point: Vec3A) -> [u32; 3] {
        let place = (point - self.start) * self.per_unit + TO_INTEGER;
        let bits = place.to_array().map(f32::to_bits);
        bits.map(|bits| bits & last_of::<COUNT>())
    }

    /// The bin of a coordinate on one axis.
    #[inline(always)]
    pub(crate) fn of_axis(&self, coordinate: f32, axis: usize) -> u32 {
        let place = (coordinate - self.start[axis]) * self.per_unit[axis];
        (place + TO_INTEGER).to_bits() & self.last
    }

    /// The boundary between a bin and the next one, as close as rounding permits.
    pub(crate) fn end_of(&self, bin: u32, axis: usize) -> f32 {
        self.start[axis] + (bin as f32 + 0.5) / self.per_unit[axis]
    }
}

/// A number of items and the box around them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Group {
    pub(crate) min: Vec3A,
    pub(crate) max: Vec3A,
    pub(crate) count: u32,
}

impl Group {
    pub(crate) const NOTHING: Self = Self {
        min: Vec3A::INFINITY,
        max: Vec3A::NEG_INFINITY,
        count: 0,
    };

    /// One item.
    #[inline(always)]
    pub(crate) fn of(item: &Item) -> Self {
        Self {
            min: item.min(),
            max: item.max(),
            count: 1,
        }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, other: &Self) {
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
        self.count += other.count;
    }

    /// The half area of the box times the number of items; 0 without items.
    #[inline(always)]
    pub(crate) fn cost(&self) -> f32 {
        if self.count == 0 {
            0.0
        } else {
            half_area(self.max - self.min) * self.count as f32
        }
    }
}

/// The half area of a box of this extent.
#[inline(always)]
pub(crate) fn half_area(d: Vec3A) -> f32 {
    d.x * d.y + d.y * d.z + d.z * d.x
}
