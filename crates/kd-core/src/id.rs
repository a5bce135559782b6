//! Index types that must not be confused.

use std::fmt;

/// A reference to a triangle as leaves store it: the number of a triangle in a frame, first slot of the part + triangle of the part.
///
/// In a tree over one mesh the slot is the triangle's number.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, bytemuck::Pod, bytemuck::Zeroable,
)]
#[repr(transparent)]
pub struct Slot(pub u32);

impl Slot {
    /// As an array index.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// The index of a [`Node`](crate::Node) in its arena.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeIndex(pub u32);

impl NodeIndex {
    /// As an array index.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// The node beside it in the same pair: the upper child, given the lower one.
    #[inline]
    #[must_use]
    pub const fn sibling(self) -> Self {
        Self(self.0 ^ 1)
    }
}

impl fmt::Display for Slot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for NodeIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
