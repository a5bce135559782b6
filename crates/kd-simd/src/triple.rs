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

// No closures here: they are not inlined always, and lanes are slow where something is not.

macro_rules! operators {
    ($($trait:ident $function:ident $operator:tt),*) => {$(
        impl<N: Copy + $trait<Output = N>> $trait for Three<N> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                let (Self([a, b, c]), Self([d, e, f])) = (self, other);
                Self([a $operator d, b $operator e, c $operator f])
            }
        }
    )*};
}

operators!(Add add +, Sub sub -, Mul mul *);

impl<N: Real> Triple for Three<N> {
    type Number = N;

    #[inline(always)]
    fn minus(self, number: N) -> Self {
        let Self([a, b, c]) = self;
        Self([a - number, b - number, c - number])
    }

    #[inline(always)]
    fn times(self, factor: N) -> Self {
        let Self([a, b, c]) = self;
        Self([a * factor, b * factor, c * factor])
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
        let Self([a, b, c]) = self;
        Self([a.abs(), b.abs(), c.abs()])
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        let (Self([a, b, c]), Self([d, e, f])) = (self, other);
        Self([a.max(d), b.max(e), c.max(f)])
    }

    #[inline(always)]
    fn max_element(self) -> N {
        let Self([a, b, c]) = self;
        a.max(b).max(c)
    }

    #[inline(always)]
    fn is_one_sided(self) -> N::Mask {
        N::are_one_sided(self.0)
    }

    #[inline(always)]
    fn or(self, mask: N::Mask, other: Self) -> Self {
        let (Self([a, b, c]), Self([d, e, f])) = (self, other);
        Self([a.or(mask, d), b.or(mask, e), c.or(mask, f)])
    }

    #[inline(always)]
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self {
        let Self([a, b, c]) = self;
        Self([
            a.add_and_mask_bits(add, mask),
            b.add_and_mask_bits(add, mask),
            c.add_and_mask_bits(add, mask),
        ])
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
