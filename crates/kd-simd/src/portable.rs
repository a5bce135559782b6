//! The portable twin of AVX2: lanes in arrays, which the compiler may turn into the vector instructions of the target.

use std::array::from_fn;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Not, Sub};

use crate::{F32x8, F64x8, LANES, Mask, Number, Real, Simd, Task, Three, U32x8, each};

/// The portable level: eight values in an array, for every processor.
#[derive(Clone, Copy, Debug)]
pub struct Portable;

/// Lanes in an array.
#[derive(Clone, Copy, Debug)]
pub struct Array<T>([T; LANES]);

impl Simd for Portable {
    type F32 = Array<f32>;
    type F64 = Array<f64>;
    type Triple = Three<f64>;
    type U32 = Array<u32>;

    #[inline(always)]
    fn run<T: Task<Self>>(self, task: T) -> T::Output {
        task.run(self)
    }

    #[inline(never)]
    fn apart<T: Task<Self>>(self, task: T) -> T::Output {
        task.run(self)
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
    fn values(self, values: [f32; LANES]) -> Self::F32 {
        Array(values)
    }

    #[inline(always)]
    fn transpose(self, rows: [&[f32; LANES]; LANES]) -> [Self::F32; LANES] {
        from_fn(|column| Array(each(rows, |row| row[column])))
    }

    #[inline(always)]
    fn splat_f64(self, x: f64) -> Self::F64 {
        Array([x; LANES])
    }

    #[inline(always)]
    fn widen(self, from: &[f32; LANES]) -> Self::F64 {
        Array(each(*from, f64::from))
    }

    #[inline(always)]
    fn triple(self, [a, b, c]: [f32; 3]) -> Three<f64> {
        Three([a.into(), b.into(), c.into()])
    }

    #[inline(always)]
    fn splat_u32(self, x: u32) -> Self::U32 {
        Array([x; LANES])
    }

    #[inline(always)]
    fn to_f32(self, numbers: Self::U32) -> Self::F32 {
        // Signed, which is one instruction.
        Array(each(numbers.0, |x| x.cast_signed() as f32))
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
        Self(each(self.0, |is_set| !is_set))
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
                Self(each(self.0, <$number>::abs))
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
            #[allow(clippy::float_cmp, reason = "an exact comparison is the definition")]
            fn ne(self, other: Self) -> Self::Mask {
                self.with(other, |a, b| a != b)
            }

            #[inline(always)]
            #[allow(clippy::float_cmp, reason = "an exact comparison is the definition")]
            fn eq(self, other: Self) -> Self::Mask {
                self.with(other, |a, b| a == b)
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

    #[inline(always)]
    fn low_bytes(self) -> [u8; LANES] {
        each(self.0, |x| x.to_bits().to_le_bytes()[0])
    }
}

impl U32x8 for Array<u32> {
    type Mask = Array<bool>;

    #[inline(always)]
    fn count(self, mask: Self::Mask) -> Self {
        self.with(mask, |count, is_set| count.wrapping_add(u32::from(is_set)))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, u32::wrapping_add)
    }

    #[inline(always)]
    fn plus(self, number: u32) -> Self {
        Self(each(self.0, |x| x.wrapping_add(number)))
    }

    #[inline(always)]
    fn times(self, factor: u32) -> Self {
        Self(each(self.0, |x| x.wrapping_mul(factor)))
    }

    #[inline(always)]
    fn high_halves(self) -> Self {
        Self(each(self.0, |x| x >> 16))
    }

    #[inline(always)]
    fn is_zero(self) -> Self::Mask {
        Array(each(self.0, |x| x == 0))
    }

    #[inline(always)]
    fn to_array(self) -> [u32; LANES] {
        self.0
    }
}

impl Real for Array<f64> {
    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        Self(each(self.0, |x| factor * x))
    }

    #[inline(always)]
    fn is_at_least_zero(self) -> Self::Mask {
        Array(each(self.0, |x| x >= 0.0))
    }

    #[inline(always)]
    fn is_at_most_zero(self) -> Self::Mask {
        Array(each(self.0, |x| x <= 0.0))
    }

    #[inline(always)]
    fn is_not_zero(self) -> Self::Mask {
        Array(each(self.0, |x| x != 0.0))
    }

    #[inline(always)]
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self {
        Self(each(self.0, |x| {
            f64::from_bits(x.to_bits().wrapping_add(add) & mask)
        }))
    }
}

impl F64x8 for Array<f64> {
    #[inline(always)]
    #[allow(
        clippy::cast_possible_truncation,
        reason = "rounding is what is asked for"
    )]
    fn narrow(self) -> [f32; LANES] {
        each(self.0, |x| x as f32)
    }
}
