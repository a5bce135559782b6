//! What lanes can do: the traits that AVX2 and the portable level implement.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use crate::{Triple, max, min};

/// Lanes of a vector.
pub const LANES: usize = 8;

/// A set of instructions. A value proves that the processor has them.
pub trait Simd: Copy + Debug {
    /// Eight lanes of f32.
    type F32: F32x8;
    /// Eight lanes of f64.
    type F64: F64x8;
    /// Three numbers of f64.
    type Triple: Triple<Number = f64>;
    /// Eight counters.
    type U32: U32x8<Mask = <Self::F32 as Number>::Mask>;

    /// Runs a task, compiled for this set of instructions.
    ///
    /// Inside another task it is a call that the compiler may inline; [`Task::run`] itself is inlined into it.
    fn run<T: Task<Self>>(self, task: T) -> T::Output;
    /// [`run`](Self::run) that is never inlined into the caller: for large or rare tasks, whose registers and constants would
    /// burden the caller's loop.
    fn apart<T: Task<Self>>(self, task: T) -> T::Output;

    /// The same number in all lanes.
    fn splat(self, x: f32) -> Self::F32;
    /// Reads eight numbers from memory.
    fn load(self, from: &[f32; LANES]) -> Self::F32;
    /// Makes a vector of eight values in registers. Faster than [`load`](Self::load) of an array that was just written, which
    /// waits for the writes.
    fn values(self, values: [f32; LANES]) -> Self::F32;
    /// The first numbers of all rows, the second ones, and so on.
    fn transpose(self, rows: [&[f32; LANES]; LANES]) -> [Self::F32; LANES];
    /// The same number in all lanes.
    fn splat_f64(self, x: f64) -> Self::F64;
    /// Converts exactly.
    fn widen(self, from: &[f32; LANES]) -> Self::F64;
    /// Converts three numbers exactly.
    fn triple(self, numbers: [f32; 3]) -> Self::Triple;
    /// The same number in all lanes.
    fn splat_u32(self, x: u32) -> Self::U32;
    /// Converts numbers below 2³¹, rounded to nearest.
    fn to_f32(self, numbers: Self::U32) -> Self::F32;
}

/// A computation over lanes, for [`Level::run`](crate::Level::run). (A closure does not do: it is inlined only where the
/// compiler chooses to, and lanes are fast only where everything is inlined.)
pub trait Task<S> {
    /// What the task computes.
    type Output;

    /// Runs the task. Mark it `#[inline(always)]`, and every function that it calls with lanes.
    fn run(self, simd: S) -> Self::Output;
}

/// Operations of f32 and f64 lanes.
pub trait Number:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// A boolean for each lane.
    type Mask: Mask;

    /// The absolute value.
    fn abs(self) -> Self;
    /// The smaller; `other` if either is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; `other` if either is NaN.
    fn max(self, other: Self) -> Self;
    /// `self <= other`, false for NaN.
    fn le(self, other: Self) -> Self::Mask;
    /// `self < other`, false for NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `self != other`, true for NaN.
    fn ne(self, other: Self) -> Self::Mask;
    /// `self == other`, false for NaN.
    fn eq(self, other: Self) -> Self::Mask;
    /// `self` where the mask is true, elsewhere `other`.
    fn or(self, mask: Self::Mask, other: Self) -> Self;
}

/// Eight lanes of f32.
pub trait F32x8: Number {
    /// `self * factor + term`, rounded once (AVX2) or twice (portable): only where an error bound covers both.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// Writes all lanes.
    fn store(self, to: &mut [f32; LANES]);
    /// Writes the lanes where the mask is true.
    fn store_where(self, mask: Self::Mask, to: &mut [f32; LANES]);
    /// Writes a number where the mask is true.
    fn put(mask: Self::Mask, number: u32, to: &mut [u32; LANES]);
    /// The lowest byte of the bits of each lane. For a number to which 2²³ was added, that is its integer part modulo 256.
    fn low_bytes(self) -> [u8; LANES];
}

/// Lanes of f64, eight or one.
pub trait Real: Number {
    /// `factor * self`.
    fn scaled(self, factor: f64) -> Self;
    /// `self >= 0`, false for NaN.
    fn is_at_least_zero(self) -> Self::Mask;
    /// `self <= 0`, false for NaN.
    fn is_at_most_zero(self) -> Self::Mask;
    /// `self != 0`, true for NaN.
    fn is_not_zero(self) -> Self::Mask;
    /// Whether all of three are at least 0, or all are at most 0. False if one is NaN.
    #[inline(always)]
    fn are_one_sided([a, b, c]: [Self; 3]) -> Self::Mask {
        let above = a.is_at_least_zero() & b.is_at_least_zero() & c.is_at_least_zero();
        let below = a.is_at_most_zero() & b.is_at_most_zero() & c.is_at_most_zero();
        above | below
    }
    /// The bits of each lane plus `add`, modulo 2⁶⁴, and with `mask`.
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self;
}

/// Eight lanes of f64.
pub trait F64x8: Real {
    /// Rounds to the nearest f32.
    fn narrow(self) -> [f32; LANES];
}

/// Eight lanes of u32, for counters.
pub trait U32x8: Copy + Debug {
    /// A boolean for each lane.
    type Mask: Mask;

    /// Adds one, modulo 2³², where the mask is true.
    fn count(self, mask: Self::Mask) -> Self;
    /// The sums, modulo 2³².
    fn add(self, other: Self) -> Self;
    /// Adds the same number to all, modulo 2³².
    fn plus(self, number: u32) -> Self;
    /// Multiplies all by the same number, modulo 2³².
    fn times(self, factor: u32) -> Self;
    /// Each divided by 2¹⁶, rounded down.
    fn high_halves(self) -> Self;
    /// `self == 0`.
    fn is_zero(self) -> Self::Mask;
    /// The counters in order.
    fn to_array(self) -> [u32; LANES];
}

/// A boolean for each lane.
pub trait Mask:
    Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// A bit for each lane, the lowest for the first.
    fn bits(self) -> u32;
}

/// The largest of eight numbers that are not NaN.
#[inline(always)]
pub fn max_lane(of: &[f32; LANES]) -> f32 {
    folded(of, max)
}

/// The smallest of eight numbers that are not NaN.
#[inline(always)]
pub fn min_lane(of: &[f32; LANES]) -> f32 {
    folded(of, min)
}

#[inline(always)]
fn folded(of: &[f32; LANES], fold: impl Fn(f32, f32) -> f32) -> f32 {
    let mut all = *of;
    for half in [4, 2, 1] {
        for lane in 0..half {
            all[lane] = fold(all[lane], all[lane + half]);
        }
    }
    all[0]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Level;

    /// Every operation on some numbers; gives all results as bits.
    #[derive(Clone, Copy)]
    struct All {
        rows: [[f32; LANES]; LANES],
    }

    impl All {
        fn of<S: Simd>(&self, simd: S) -> Vec<u64> {
            let mut bits = Vec::new();
            let mut counts = simd.splat_u32(u32::MAX);
            let rows = self.rows.each_ref();
            for column in simd.transpose(rows) {
                bits.extend(stored(column));
            }
            for pair in self.rows.windows(2) {
                let (a, b) = (simd.load(&pair[0]), simd.load(&pair[1]));
                for x in [a + b, a - b, a * b, a / b, a.abs(), a.min(b), a.max(b)] {
                    bits.extend(stored(x));
                }
                let splat = simd.splat(pair[0][0]);
                bits.extend(stored(simd.values(pair[0])));
                let bytes = (a.max(splat) + simd.splat(8_388_608.0)).or(a.le(splat), splat);
                bits.extend(bytes.low_bytes().map(u64::from));
                for mask in [
                    a.le(b),
                    a.lt(b),
                    a.ne(b),
                    a.eq(b) | b.eq(splat),
                    !a.lt(splat),
                    a.le(b) & a.ne(splat),
                ] {
                    bits.push(mask.bits().into());
                    bits.extend(stored(a.or(mask | b.lt(a), b)));
                    let mut row = pair[1];
                    a.store_where(mask, &mut row);
                    bits.extend(row.map(|x| u64::from(canonical(x).to_bits())));
                    let mut numbers = [7; LANES];
                    S::F32::put(mask, 0xffff_fffe, &mut numbers);
                    bits.extend(numbers.map(u64::from));
                    counts = counts.count(mask);
                    let sum = counts.add(counts.plus(77)).times(0x1357_9bdf);
                    bits.extend(sum.to_array().map(u64::from));
                    bits.extend(stored(simd.to_f32(sum.high_halves())));
                    bits.push((counts.is_zero() | sum.is_zero()).bits().into());
                    bits.extend(counts.to_array().map(u64::from));
                }
                let (a, b) = (simd.widen(&pair[0]), simd.widen(&pair[1]));
                let rounded = (a / b).add_and_mask_bits(1 << 26, u64::MAX << 27);
                for x in [
                    a + b,
                    a - b,
                    a * b,
                    a / b,
                    a.abs(),
                    a.min(b),
                    a.max(b),
                    a.scaled(3.7),
                    rounded,
                ] {
                    bits.extend(x.narrow().map(|x| u64::from(canonical(x).to_bits())));
                    bits.push(x.le(simd.splat_f64(0.5)).bits().into());
                    bits.push((!x.lt(b) | x.ne(a)).bits().into());
                    bits.push(x.is_at_least_zero().bits().into());
                    bits.push(x.is_at_most_zero().bits().into());
                    bits.push(x.is_not_zero().bits().into());
                    let chosen = x.or(a.le(b), b).narrow();
                    bits.extend(chosen.map(|x| u64::from(canonical(x).to_bits())));
                }
            }
            let [a, b, c, ..] = self.rows.each_ref().map(|row| [row[0], row[1], row[2]]);
            bits.extend(of_triples(simd.triple(a), simd.triple(b), simd.triple(c)));
            bits
        }
    }

    /// Every operation on triples.
    #[inline(always)]
    fn of_triples<T: Triple<Number = f64>>(a: T, b: T, c: T) -> Vec<u64> {
        let canonical = |x: f64| if x.is_nan() { f64::NAN } else { x };
        let mut bits = Vec::new();
        for x in [
            a + b,
            a - b,
            a * b,
            a.minus(0.3),
            a.times(0.7),
            a.next(),
            a.previous(),
            a.abs(),
            a.max(b),
            a.add_and_mask_bits(1 << 26, u64::MAX << 27),
            a.or(a.is_one_sided(), b),
            a.or(!b.is_one_sided(), c),
            a.with_first(0.9),
        ] {
            let numbers = [x.sum(), x.max_element()];
            let all = x.over(1.1).into_iter().chain(numbers);
            bits.extend(all.map(|x| canonical(x).to_bits()));
            bits.push(x.is_one_sided().into());
        }
        bits
    }

    impl<S: Simd> Task<S> for All {
        type Output = Vec<u64>;

        #[inline(always)]
        fn run(self, simd: S) -> Vec<u64> {
            self.of(simd)
        }
    }

    struct Apart(All);

    impl<S: Simd> Task<S> for Apart {
        type Output = Vec<u64>;

        #[inline(always)]
        fn run(self, simd: S) -> Vec<u64> {
            simd.apart(self.0)
        }
    }

    #[derive(Clone, Copy)]
    struct MultiplyAdd([[f32; LANES]; 3]);

    impl<S: Simd> Task<S> for MultiplyAdd {
        type Output = [f32; LANES];

        #[inline(always)]
        fn run(self, simd: S) -> [f32; LANES] {
            let [a, b, c] = self.0.each_ref();
            let mut sums = [0.0; LANES];
            simd.load(a)
                .mul_add(simd.load(b), simd.load(c))
                .store(&mut sums);
            sums
        }
    }

    /// Which NaN it is does not matter.
    fn canonical(x: f32) -> f32 {
        if x.is_nan() { f32::NAN } else { x }
    }

    fn stored<N: F32x8>(x: N) -> [u64; LANES] {
        let mut array = [0.0; LANES];
        x.store(&mut array);
        array.map(|x| canonical(x).to_bits().into())
    }

    fn number() -> impl Strategy<Value = f32> {
        prop_oneof![
            8 => -10.0_f32..10.0,
            1 => prop::num::f32::ANY.prop_map(canonical),
            1 => prop::sample::select(vec![0.0, -0.0, 1.0, f32::INFINITY, f32::NAN, 1e-40]),
        ]
    }

    proptest! {
        #[test]
        fn all_levels_give_the_same_bits(rows in prop::array::uniform8(prop::array::uniform8(number()))) {
            let all = All { rows };
            prop_assert_eq!(Level::detect().run(all), Level::portable().run(all));
            prop_assert_eq!(Level::detect().run(Apart(all)), Level::portable().run(all));
        }

        #[test]
        fn multiply_add_is_rounded_once_or_twice(
            rows in prop::array::uniform3(prop::array::uniform8(-10.0_f32..10.0)),
        ) {
            let [a, b, c] = rows;
            let exact: Vec<f64> = (0..LANES)
                .map(|lane| f64::from(a[lane]) * f64::from(b[lane]) + f64::from(c[lane]))
                .collect();
            let levels = [Level::portable(), Level::detect()];
            let found = levels.map(|level| level.run(MultiplyAdd(rows)));
            for (sums, lane) in found.iter().flat_map(|sums| (0..LANES).map(move |lane| (sums, lane))) {
                prop_assert!((f64::from(sums[lane]) - exact[lane]).abs() < 2e-5, "{sums:?}");
            }
        }
    }
}
