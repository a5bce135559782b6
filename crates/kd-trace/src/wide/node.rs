//! The 256-byte node.
//!
//! ```text
//! faces      3 x 2 x 8 f32   by axis: where the boxes of eight children begin, where they end
//! children   8 x u32         a node: its index, below 2³¹
//!                            a leaf: 1, number of blocks (3 bits), index of the first (28 bits)
//! orders     8 x u32         by octant of directions: the lanes from far to near, three bits each
//! ```
//! Lanes without a child have a box that is empty, and a leaf without blocks.

use bytemuck::{Pod, Zeroable};
use kd_core::Aabb;

/// How many children a node has at most.
pub(crate) const WIDTH: usize = 8;

/// A node, or the blocks of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    const COUNT_SHIFT: u32 = 28;
    /// How many blocks a leaf has at most.
    pub(crate) const MOST_BLOCKS: u32 = 7;
    /// A leaf without blocks.
    pub(crate) const NOTHING: Self = Self(Self::LEAF);

    /// # Panics
    ///
    /// From 2³¹ on. A tree has fewer references than 2³², and so fewer nodes than that by far.
    pub(crate) fn node(index: usize) -> Self {
        let index = u32::try_from(index)
            .ok()
            .filter(|index| index & Self::LEAF == 0);
        Self(index.expect("fewer than 2^31 nodes"))
    }

    /// # Panics
    ///
    /// From 2²⁸ blocks on, which is 80 GiB of them, or for more than a leaf has.
    pub(crate) fn leaf(first: usize, blocks: usize) -> Self {
        let first = u32::try_from(first)
            .ok()
            .filter(|first| first >> Self::COUNT_SHIFT == 0);
        let blocks = u32::try_from(blocks)
            .ok()
            .filter(|blocks| *blocks <= Self::MOST_BLOCKS);
        let blocks = blocks.expect("at most seven blocks");
        Self(Self::LEAF | blocks << Self::COUNT_SHIFT | first.expect("fewer than 2^28 blocks"))
    }

    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The index of a node.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }

    /// The blocks of a leaf.
    #[inline(always)]
    pub(crate) fn blocks(self) -> std::ops::Range<usize> {
        let first = (self.0 & ((1 << Self::COUNT_SHIFT) - 1)) as usize;
        first..first + (self.0 >> Self::COUNT_SHIFT & Self::MOST_BLOCKS) as usize
    }
}

/// Boxes of up to eight children. Four cache lines.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub(crate) struct WideNode {
    pub(crate) faces: [[[f32; WIDTH]; 2]; 3],
    pub(crate) children: [Child; WIDTH],
    pub(crate) orders: [u32; 8],
}

const _: () = assert!(size_of::<WideNode>() == 256, "four cache lines");

impl WideNode {
    /// No children, in the order of their lanes.
    pub(crate) const EMPTY: Self = Self {
        faces: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
        children: [Child::NOTHING; WIDTH],
        orders: [0o76_543_210; 8],
    };

    pub(crate) fn set(&mut self, lane: usize, bounds: &Aabb, child: Child) {
        for axis in 0..3 {
            self.faces[axis][0][lane] = bounds.min[axis];
            self.faces[axis][1][lane] = bounds.max[axis];
        }
        self.children[lane] = child;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_survive_packing() {
        for index in [0, 1, (1 << 31) - 1] {
            let node = Child::node(index);
            assert!(!node.is_leaf() && node.index() == index, "{node:?}");
        }
        for (first, blocks) in [(0, 1), (5, 7), ((1 << 28) - 1, 3)] {
            let leaf = Child::leaf(first, blocks);
            assert!(
                leaf.is_leaf() && leaf.blocks() == (first..first + blocks),
                "{leaf:?}"
            );
        }
        assert_eq!(Child::NOTHING.blocks().len(), 0, "nothing to visit");
    }

    #[test]
    #[should_panic(expected = "fewer than 2^28 blocks")]
    fn too_many_blocks_are_refused() {
        Child::leaf(1 << 28, 1);
    }
}
