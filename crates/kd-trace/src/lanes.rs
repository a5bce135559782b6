//! Numbers side by side, eight of them.
//!
//! What is computed for many rays at once is written once, over [`Simd`], and compiled for [`Portable`] lanes and for those
//! of AVX2. A value of a type with [`Simd`] is the proof that the processor has its instructions; every function here is
//! inlined into one that was compiled for them.

#[cfg(target_arch = "x86_64")]
mod avx2;

use std::array::from_fn;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use crate::float::{max, min};

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;

/// How many numbers lie side by side.
pub(crate) const LANES: usize = 8;

/// A set of instructions.
pub(crate) trait Simd: Copy {
    type F32: F32x8;
    type F64: F64x8;

    /// Runs a task that is compiled for this set, and apart from the caller: for what is done seldom.
    fn apart<T: Task>(self, task: T) -> T::Output;
    /// The same number in all lanes.
    fn splat(self, x: f32) -> Self::F32;
    fn load(self, from: &[f32; LANES]) -> Self::F32;
    /// The first numbers of all rows, the second ones, and so on.
    fn transpose(self, rows: [&[f32; LANES]; LANES]) -> [Self::F32; LANES];
    fn splat_f64(self, x: f64) -> Self::F64;
    /// Exactly these numbers.
    fn widen(self, from: &[f32; LANES]) -> Self::F64;
}

/// Something to do. (A closure would not do: it is only inlined where the compiler likes to, and lanes are fast only where
/// everything is.)
pub(crate) trait Task {
    type Output;

    /// To be inlined always.
    fn run(self) -> Self::Output;
}

/// What both kinds of lanes can do.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
    /// A yes or no for each lane.
    type Mask: Mask;

    fn abs(self) -> Self;
    /// The smaller; the second if the first is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; the second if the first is NaN.
    fn max(self, other: Self) -> Self;
    /// False for NaN.
    fn le(self, other: Self) -> Self::Mask;
    /// False for NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// True for NaN.
    fn ne(self, other: Self) -> Self::Mask;
    /// This one where the mask says yes, elsewhere the other.
    fn or(self, mask: Self::Mask, other: Self) -> Self;
}

/// Eight numbers of f32.
pub(crate) trait F32x8: Number {
    /// `self * factor + term`, rounded once or twice: for what needs a bound of its error anyway.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    fn store(self, to: &mut [f32; LANES]);
    /// Stores the lanes where the mask says yes.
    fn store_where(self, mask: Self::Mask, to: &mut [f32; LANES]);
    /// Writes a number where the mask says yes.
    fn put(mask: Self::Mask, number: u32, to: &mut [u32; LANES]);
}

/// Eight numbers of f64.
pub(crate) trait F64x8: Number {
    /// The bits of each lane, plus one number, and with the bits of another.
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self;
    /// Rounded to the nearest.
    fn narrow(self) -> [f32; LANES];
}

/// A yes or no for each lane.
pub(crate) trait Mask:
    Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// A bit for each lane, the lowest for the first.
    fn bits(self) -> u32;
}

/// The largest of eight numbers.
#[inline(always)]
pub(crate) fn most(of: &[f32; LANES]) -> f32 {
    folded(of, max)
}

/// The smallest of eight numbers.
#[inline(always)]
pub(crate) fn least(of: &[f32; LANES]) -> f32 {
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

/// Arrays, for any processor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

/// Lanes in an array.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Array<T>([T; LANES]);

impl Simd for Portable {
    type F32 = Array<f32>;
    type F64 = Array<f64>;

    #[inline(never)]
    fn apart<T: Task>(self, task: T) -> T::Output {
        task.run()
    }

    #[inline(always)]
    fn splat(self, x: f32) -> Self::F32 {
        Array([x; LANES])
    }

    #[inline(always)]
    fn load(self, from: &[f32; LANES]) -> Self::F32 {
        Array(*from)
    }

    #[inline(always)]
    fn transpose(self, rows: [&[f32; LANES]; LANES]) -> [Self::F32; LANES] {
        from_fn(|column| Array(rows.map(|row| row[column])))
    }

    #[inline(always)]
    fn splat_f64(self, x: f64) -> Self::F64 {
        Array([x; LANES])
    }

    #[inline(always)]
    fn widen(self, from: &[f32; LANES]) -> Self::F64 {
        Array(from.map(f64::from))
    }
}

impl<T: Copy> Array<T> {
    #[inline(always)]
    fn with<U: Copy, V>(self, other: Array<U>, f: impl Fn(T, U) -> V) -> Array<V> {
        Array(from_fn(|lane| f(self.0[lane], other.0[lane])))
    }
}

macro_rules! operators {
    ($($trait:ident $function:ident $operator:tt),*) => {$(
        impl<T: Copy + $trait<Output = T>> $trait for Array<T> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.with(other, |a, b| a $operator b)
            }
        }
    )*};
}

operators!(Add add +, Sub sub -, Mul mul *, Div div /, BitAnd bitand &, BitOr bitor |);

impl Not for Array<bool> {
    type Output = Self;

    #[inline(always)]
    fn not(self) -> Self {
        Self(self.0.map(|is_set| !is_set))
    }
}

impl Mask for Array<bool> {
    #[inline(always)]
    fn bits(self) -> u32 {
        let bit = |(lane, is_set): (u32, &bool)| u32::from(*is_set) << lane;
        (0..).zip(&self.0).map(bit).sum()
    }
}

macro_rules! numbers {
    ($number:ty) => {
        impl Number for Array<$number> {
            type Mask = Array<bool>;

            #[inline(always)]
            fn abs(self) -> Self {
                Self(self.0.map(<$number>::abs))
            }

            #[inline(always)]
            fn min(self, other: Self) -> Self {
                self.with(other, |a, b| if a < b { a } else { b })
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.with(other, |a, b| if a > b { a } else { b })
            }

            #[inline(always)]
            fn le(self, other: Self) -> Self::Mask {
                self.with(other, |a, b| a <= b)
            }

            #[inline(always)]
            fn lt(self, other: Self) -> Self::Mask {
                self.with(other, |a, b| a < b)
            }

            #[inline(always)]
            #[allow(clippy::float_cmp, reason = "exactly what is asked for")]
            fn ne(self, other: Self) -> Self::Mask {
                self.with(other, |a, b| a != b)
            }

            #[inline(always)]
            fn or(self, mask: Self::Mask, other: Self) -> Self {
                let choices = self.with(other, |a, b| (a, b));
                choices.with(mask, |(a, b), is_set| if is_set { a } else { b })
            }
        }
    };
}

numbers!(f32);
numbers!(f64);

impl F32x8 for Array<f32> {
    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; LANES]) {
        *to = self.0;
    }

    #[inline(always)]
    fn store_where(self, mask: Self::Mask, to: &mut [f32; LANES]) {
        *to = self.or(mask, Self(*to)).0;
    }

    #[inline(always)]
    fn put(mask: Self::Mask, number: u32, to: &mut [u32; LANES]) {
        for (to, is_set) in to.iter_mut().zip(mask.0) {
            if is_set {
                *to = number;
            }
        }
    }
}

impl F64x8 for Array<f64> {
    #[inline(always)]
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self {
        Self(
            self.0
                .map(|x| f64::from_bits(x.to_bits().wrapping_add(add) & mask)),
        )
    }

    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "rounding is what is asked for"
    )]
    fn narrow(self) -> [f32; LANES] {
        self.0.map(|x| x as f32)
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    #![allow(unsafe_code, reason = "makes lanes of AVX2 where they were detected")]

    use proptest::prelude::*;

    use super::*;

    /// Everything that lanes can do with some numbers, as bits.
    struct All {
        rows: [[f32; LANES]; LANES],
    }

    impl All {
        fn of<S: Simd>(&self, simd: S) -> Vec<u64> {
            let mut bits = Vec::new();
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
                for mask in [
                    a.le(b),
                    a.lt(b),
                    a.ne(b),
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
                    rounded,
                ] {
                    bits.extend(x.narrow().map(|x| u64::from(canonical(x).to_bits())));
                    bits.push(x.le(simd.splat_f64(0.5)).bits().into());
                    bits.push((!x.lt(b) | x.ne(a)).bits().into());
                    let chosen = x.or(a.le(b), b).narrow();
                    bits.extend(chosen.map(|x| u64::from(canonical(x).to_bits())));
                }
            }
            bits
        }
    }

    impl Task for &All {
        type Output = Vec<u64>;

        #[inline(always)]
        fn run(self) -> Vec<u64> {
            // SAFETY: run where there are these instructions only.
            self.of(unsafe { Avx2::new() })
        }
    }

    struct MultiplyAdd([[f32; LANES]; 3]);

    impl MultiplyAdd {
        fn of<S: Simd>(&self, simd: S) -> [f32; LANES] {
            let [a, b, c] = self.0.each_ref();
            let mut sums = [0.0; LANES];
            simd.load(a)
                .mul_add(simd.load(b), simd.load(c))
                .store(&mut sums);
            sums
        }
    }

    impl Task for MultiplyAdd {
        type Output = [f32; LANES];

        #[inline(always)]
        fn run(self) -> [f32; LANES] {
            // SAFETY: run where there are these instructions only.
            self.of(unsafe { Avx2::new() })
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
        fn avx2_does_what_arrays_do(rows in prop::array::uniform8(prop::array::uniform8(number()))) {
            if crate::Level::detect() == crate::Level::portable() {
                return Ok(());
            }
            let all = All { rows };
            // SAFETY: the fastest level is not the portable one, so it is AVX2.
            let found = unsafe { Avx2::new() }.apart(&all);
            prop_assert_eq!(found, all.of(Portable));
        }

        #[test]
        fn multiply_add_is_rounded_once_or_twice(
            rows in prop::array::uniform3(prop::array::uniform8(-10.0_f32..10.0)),
        ) {
            let [a, b, c] = rows;
            let exact: Vec<f64> = (0..LANES)
                .map(|lane| f64::from(a[lane]) * f64::from(b[lane]) + f64::from(c[lane]))
                .collect();
            let mut found = vec![MultiplyAdd(rows).of(Portable)];
            if crate::Level::detect() != crate::Level::portable() {
                // SAFETY: the fastest level is not the portable one, so it is AVX2.
                found.push(unsafe { Avx2::new() }.apart(MultiplyAdd(rows)));
            }
            for (sums, lane) in found.iter().flat_map(|sums| (0..LANES).map(move |lane| (sums, lane))) {
                prop_assert!((f64::from(sums[lane]) - exact[lane]).abs() < 2e-5, "{sums:?}");
            }
        }
    }
}
