//! Three numbers together, one for each corner of a triangle.

use std::fmt::Debug;
use std::ops::{Add, Mul, Sub};

use crate::{Number, Real};

/// Numbers a, b and c, one for each corner of a triangle.
///
/// [`Three`] holds those of one triangle (of f64) or of eight ([`F64x8`](crate::F64x8)). A register of AVX2 holds those of one
/// triangle: [`Simd::triple`](crate::Simd::triple). All round alike.
pub trait Triple:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// One of the numbers.
    type Number: Real;

    /// Subtracts the same number from all.
    fn minus(self, number: Self::Number) -> Self;
    /// Multiplies all by the same number.
    fn times(self, factor: Self::Number) -> Self;
    /// (b, c, a).
    fn next(self) -> Self;
    /// (c, a, b).
    fn previous(self) -> Self;
    /// `a + b + c`, in this order.
    fn sum(self) -> Self::Number;
    /// The absolute values.
    fn abs(self) -> Self;
    /// The larger of each two; `other` if either is NaN.
    fn max(self, other: Self) -> Self;
    /// The largest of the three.
    fn max_element(self) -> Self::Number;
    /// Whether all are at least 0, or all are at most 0.
    fn is_one_sided(self) -> <Self::Number as Number>::Mask;
    /// `self` where the mask is true, elsewhere `other`.
    fn or(self, mask: <Self::Number as Number>::Mask, other: Self) -> Self;
    /// The bits of each number plus `add`, modulo 2⁶⁴, and with `mask`.
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self;
    /// (first, b, c).
    fn with_first(self, first: Self::Number) -> Self;
    /// Each divided by the same number.
    fn over(self, divisor: Self::Number) -> [Self::Number; 3];
}

/// A [`Triple`] of numbers in variables of their own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Three<N>(pub [N; 3]);

impl<N: Copy> Three<N> {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(N, N) -> N) -> Self {
        let (Self([a, b, c]), Self([d, e, g])) = (self, other);
        Self([f(a, d), f(b, e), f(c, g)])
    }

    #[inline(always)]
    fn each(self, f: impl Fn(N) -> N) -> Self {
        let Self([a, b, c]) = self;
        Self([f(a), f(b), f(c)])
    }
}

macro_rules! operators {
    ($($trait:ident $function:ident $operator:tt),*) => {$(
        impl<N: Copy + $trait<Output = N>> $trait for Three<N> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.with(other, |a, b| a $operator b)
            }
        }
    )*};
}

operators!(Add add +, Sub sub -, Mul mul *);

impl<N: Real> Triple for Three<N> {
    type Number = N;

    #[inline(always)]
    fn minus(self, number: N) -> Self {
        self.each(|x| x - number)
    }

    #[inline(always)]
    fn times(self, factor: N) -> Self {
        self.each(|x| x * factor)
    }

    #[inline(always)]
    fn next(self) -> Self {
        let Self([a, b, c]) = self;
        Self([b, c, a])
    }

    #[inline(always)]
    fn previous(self) -> Self {
        let Self([a, b, c]) = self;
        Self([c, a, b])
    }

    #[inline(always)]
    fn sum(self) -> N {
        let Self([a, b, c]) = self;
        a + b + c
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.each(|x| x.abs())
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, |a, b| a.max(b))
    }

    #[inline(always)]
    fn max_element(self) -> N {
        let Self([a, b, c]) = self;
        a.max(b).max(c)
    }

    #[inline(always)]
    fn is_one_sided(self) -> N::Mask {
        let Self([a, b, c]) = self;
        let above = a.is_at_least_zero() & b.is_at_least_zero() & c.is_at_least_zero();
        let below = a.is_at_most_zero() & b.is_at_most_zero() & c.is_at_most_zero();
        above | below
    }

    #[inline(always)]
    fn or(self, mask: N::Mask, other: Self) -> Self {
        self.with(other, |a, b| a.or(mask, b))
    }

    #[inline(always)]
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self {
        self.each(|x| x.add_and_mask_bits(add, mask))
    }

    #[inline(always)]
    fn with_first(self, first: N) -> Self {
        let Self([_, b, c]) = self;
        Self([first, b, c])
    }

    #[inline(always)]
    fn over(self, divisor: N) -> [N; 3] {
        let Self([a, b, c]) = self;
        [a / divisor, b / divisor, c / divisor]
    }
}
