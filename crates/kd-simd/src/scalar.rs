//! One lane: f32, f64 and bool as the numbers and the mask of a vector of one.
//!
//! Arithmetic that is generic over [`Number`] and [`Real`] runs on single numbers by the same body.

use crate::{Mask, Number, Real};

impl Mask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.into()
    }
}

macro_rules! number {
    ($number:ty) => {
        impl Number for $number {
            type Mask = bool;

            #[inline(always)]
            fn abs(self) -> Self {
                self.abs()
            }

            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if self < other { self } else { other }
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self > other { self } else { other }
            }

            #[inline(always)]
            fn le(self, other: Self) -> bool {
                self <= other
            }

            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }

            #[inline(always)]
            #[allow(clippy::float_cmp, reason = "an exact comparison is the definition")]
            fn ne(self, other: Self) -> bool {
                self != other
            }

            #[inline(always)]
            #[allow(clippy::float_cmp, reason = "an exact comparison is the definition")]
            fn eq(self, other: Self) -> bool {
                self == other
            }

            #[inline(always)]
            fn or(self, mask: bool, other: Self) -> Self {
                if mask { self } else { other }
            }
        }
    };
}

number!(f32);
number!(f64);

impl Real for f64 {
    #[inline(always)]
    fn scaled(self, factor: f64) -> Self {
        factor * self
    }

    #[inline(always)]
    fn is_at_least_zero(self) -> bool {
        self >= 0.0
    }

    #[inline(always)]
    fn is_at_most_zero(self) -> bool {
        self <= 0.0
    }

    #[inline(always)]
    fn is_not_zero(self) -> bool {
        self != 0.0
    }

    /// With branches: most often one or two comparisons decide.
    #[inline(always)]
    fn are_one_sided([a, b, c]: [Self; 3]) -> bool {
        (a >= 0.0 && b >= 0.0 && c >= 0.0) || (a <= 0.0 && b <= 0.0 && c <= 0.0)
    }

    #[inline(always)]
    fn add_and_mask_bits(self, add: u64, mask: u64) -> Self {
        Self::from_bits(self.to_bits().wrapping_add(add) & mask)
    }
}
