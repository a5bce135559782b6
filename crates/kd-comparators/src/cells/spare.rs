//! The references that may still be added below a cell.

/// The number of references that a cell may add to one per triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Spare(pub(crate) u64);

impl Spare {
    /// The rest after a division that adds `added` references; `None` if that exceeds the limit.
    pub(crate) fn after(self, added: usize) -> Option<Self> {
        self.0.checked_sub(added as u64).map(Self)
    }

    /// The share of a child that holds `own` of `whole` references. The shares of all children add up to at most `self`.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a share is no larger than the whole"
    )]
    pub(crate) fn share(self, own: usize, whole: usize) -> Self {
        let product = u128::from(self.0) * own as u128;
        Self((product / whole.max(1) as u128) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_do_not_exceed_the_whole() {
        let spare = Spare(100).after(3).expect("enough");
        let shares = [1, 2, 4].map(|own| spare.share(own, 7).0);
        assert_eq!(shares, [13, 27, 55], "of 97, rounded down");
        assert_eq!(Spare(2).after(3), None, "too many");
        assert_eq!(Spare(5).share(0, 0), Spare(0), "nothing below");
        let most = Spare(u64::MAX).share(usize::MAX, usize::MAX);
        assert_eq!(most, Spare(u64::MAX), "no overflow");
    }
}
