//! The three coordinate axes.

/// A coordinate axis. The order `X < Y < Z` settles ties between planes of equal cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Axis {
    /// The first axis.
    X = 0,
    /// The second axis.
    Y = 1,
    /// The third axis.
    Z = 2,
}

impl Axis {
    /// The axes in the order X, Y, Z.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The index of this coordinate in a vector: 0, 1 or 2.
    #[inline]
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The axis after this one; `Z` is followed by `X`.
    #[inline]
    pub const fn next(self) -> Self {
        match self {
            Self::X => Self::Y,
            Self::Y => Self::Z,
            Self::Z => Self::X,
        }
    }
}
