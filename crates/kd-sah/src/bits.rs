//! Sets of small numbers as bits of an integer.

/// The numbers of the set bits below `MOST`, lowest first. The compiler can prove that they index an array of `MOST`.
#[inline(always)]
pub(crate) fn numbers<const MOST: usize>(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let number = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (number < MOST).then_some(number)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_in_order() {
        let all = |bits| numbers::<64>(bits).collect::<Vec<_>>();
        assert_eq!(all(0), [], "none");
        assert_eq!(all(1 << 63 | 0b1101), [0, 2, 3, 63], "the last one, too");
        assert_eq!(numbers::<8>(1 << 8 | 1).collect::<Vec<_>>(), [0], "of 8");
    }
}
