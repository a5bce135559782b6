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

/// The largest number of children of a node.
pub const WIDTH: usize = 8;

/// A child of a wide node: a node, or the blocks of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    const COUNT_SHIFT: u32 = 28;
    /// The largest number of blocks of a leaf.
    pub(crate) const MOST_BLOCKS: u32 = 7;
    /// A leaf without blocks.
    pub const NOTHING: Self = Self(Self::LEAF);

    /// A node.
    ///
    /// # Panics
    ///
    /// From 2³¹ on. A tree has fewer references than 2³², and so far fewer nodes.
    pub(crate) fn node(index: usize) -> Self {
        let index = u32::try_from(index)
            .ok()
            .filter(|index| index & Self::LEAF == 0);
        Self(index.expect("fewer than 2^31 nodes"))
    }

    /// The blocks of a leaf.
    ///
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

    /// Whether it is a leaf.
    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The index of a node; meaningless for a leaf.
    #[inline(always)]
    pub fn index(self) -> usize {
        self.0 as usize
    }

    /// Whether the child is among the first `nodes` nodes and `blocks` blocks.
    pub(crate) fn is_within(self, nodes: usize, blocks: usize) -> bool {
        if self.is_leaf() {
            self.blocks().end <= blocks
        } else {
            self.index() < nodes
        }
    }

    /// The child after all nodes and blocks have moved up by these numbers of places, modulo 2⁶⁴.
    ///
    /// # Panics
    ///
    /// As [`node`](Self::node) and [`leaf`](Self::leaf).
    pub(crate) fn moved(self, nodes: usize, blocks: usize) -> Self {
        if self == Self::NOTHING {
            self
        } else if self.is_leaf() {
            let own = self.blocks();
            Self::leaf(own.start.wrapping_add(blocks), own.len())
        } else {
            Self::node(self.index().wrapping_add(nodes))
        }
    }

    /// The indices of the blocks of a leaf.
    #[inline(always)]
    pub fn blocks(self) -> std::ops::Range<usize> {
        let first = (self.0 & ((1 << Self::COUNT_SHIFT) - 1)) as usize;
        first..first + (self.0 >> Self::COUNT_SHIFT & Self::MOST_BLOCKS) as usize
    }
}

/// A node: up to eight children and their boxes. Four cache lines.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct WideNode {
    /// By axis: the lower faces of the children's boxes, then the upper ones, in scene units. Empty boxes in lanes without a
    /// child.
    pub faces: [[[f32; WIDTH]; 2]; 3],
    /// [`Child::NOTHING`] in lanes without a child.
    pub children: [Child; WIDTH],
    /// By octant of directions (bit 0, 1, 2 set where x, y, z is negative): the lanes from far to near, three bits each.
    pub orders: [u32; 8],
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

    /// The box of a child; an empty box where there is none.
    pub fn bounds(&self, lane: usize) -> Aabb {
        let corner = |side: usize| self.faces.map(|faces| faces[side][lane]).into();
        Aabb {
            min: corner(0),
            max: corner(1),
        }
    }

    /// Sets the orders: rays meet the children by the centers of their boxes along the diagonal of each octant.
    pub(crate) fn order_by_centers(&mut self) {
        // Lanes without a child are never met, wherever they are.
        let centers: [[f32; WIDTH]; 3] = self.faces.map(|[starts, ends]| {
            std::array::from_fn(|lane| {
                let twice = starts[lane] + ends[lane];
                if twice.is_finite() { twice } else { 0.0 }
            })
        });
        for octant in 0..4 {
            let mut along = [0.0; WIDTH];
            for (axis, centers) in centers.iter().enumerate() {
                let sign = if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
                for (along, center) in along.iter_mut().zip(centers) {
                    *along += sign * center;
                }
            }
            let mut lanes: [u32; WIDTH] = [0, 1, 2, 3, 4, 5, 6, 7];
            // The farthest comes first. Few values, nearly in order.
            for next in 1..WIDTH {
                let mut at = next;
                while at > 0 && along[lanes[at - 1] as usize] < along[lanes[at] as usize] {
                    lanes.swap(at - 1, at);
                    at -= 1;
                }
            }
            // The other way round for the opposite octant.
            self.orders[octant] = lanes.iter().rev().fold(0, |order, lane| order << 3 | lane);
            self.orders[7 - octant] = lanes.iter().fold(0, |order, lane| order << 3 | lane);
        }
    }

    /// The box around all children; empty without any.
    pub(crate) fn around(&self) -> Aabb {
        let boxes = self.lanes().map(|lane| self.bounds(lane));
        boxes.fold(Aabb::EMPTY, |around, bounds| around.union(&bounds))
    }

    /// The lanes that have a child.
    pub fn lanes(&self) -> impl Iterator<Item = usize> + '_ {
        (0..WIDTH).filter(|lane| self.children[*lane] != Child::NOTHING)
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
    fn children_move_with_what_they_are() {
        assert_eq!(Child::node(7).moved(5, 1), Child::node(12), "a node");
        assert_eq!(Child::leaf(7, 2).moved(5, 1), Child::leaf(8, 2), "a leaf");
        let back = 3_usize.wrapping_neg();
        assert_eq!(Child::node(7).moved(back, 0), Child::node(4), "back");
        assert_eq!(Child::NOTHING.moved(5, 1), Child::NOTHING, "nothing");
    }

    #[test]
    fn nearer_centers_come_later() {
        let mut node = WideNode::EMPTY;
        for (lane, x) in [3.0_f32, -1.0, 2.0].into_iter().enumerate() {
            let corner = glam::Vec3::new(x, 0.0, 0.0);
            let bounds = Aabb {
                min: corner,
                max: corner + 1.0,
            };
            node.set(lane, &bounds, Child::leaf(0, 1));
        }
        node.order_by_centers();
        for octant in 0..8 {
            let order = node.orders[octant];
            let lanes = (0..8).map(|place| order >> (3 * place) & 7);
            let met: Vec<u32> = lanes.filter(|lane| *lane < 3).collect();
            let upwards = octant & 1 == 0;
            let expected = if upwards { [0, 2, 1] } else { [1, 2, 0] };
            assert_eq!(met, expected, "octant {octant}, from far to near");
        }
    }

    #[test]
    #[should_panic(expected = "fewer than 2^28 blocks")]
    fn too_many_blocks_are_refused() {
        Child::leaf(1 << 28, 1);
    }
}
