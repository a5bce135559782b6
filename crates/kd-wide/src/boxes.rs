//! Wide nodes over the boxes of any items.

use kd_core::{Aabb, LayoutBytes};
use kd_simd::Level;
use kd_tasks::{Cancelled, Progress, Tracker};

use crate::box_tree::Item;
use crate::divide::boxes_of_objects;
use crate::emit::Boxes;
use crate::frame::Frame;
use crate::items::items_of_boxes;
use crate::tree::WideTree;
use crate::work::Work;

/// Wide nodes over items that are known by their boxes alone: primitives of any kind, or whole structures.
///
/// Items are divided by object splits, so each is in one leaf. A leaf consists of [blocks](crate::Block) of up to eight items: the first
/// corner of a lane is the lowest of the item's box, the other two are the highest, and the number of its triangle is that of the item.
///
/// `kd_trace::kit::walk_boxes` finds the items whose boxes a ray meets. What is in the boxes is the caller's.
///
/// Memory: 256 bytes a node and 320 bytes a block, together about 60 bytes an item.
///
/// ```
/// use kd_core::Aabb;
/// use kd_wide::WideBoxes;
///
/// let unit = |x: f32| Aabb { min: [x, 0.0, 0.0].into(), max: [x + 1.0, 1.0, 1.0].into() };
/// let boxes = WideBoxes::new(&[unit(0.0), Aabb::EMPTY, unit(5.0)], false, None)?;
/// assert_eq!(boxes.bytes().blocks, 320);
/// # Ok::<(), kd_tasks::Cancelled>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct WideBoxes(WideTree);

impl WideBoxes {
    /// Makes wide nodes over boxes. The number of an item is the place of its box. Items whose box is empty, or not finite, are in no
    /// leaf.
    ///
    /// The same boxes give the same nodes, bit for bit, on any number of threads: those of the pool in scope (rayon's), if
    /// `is_parallel`. `progress` is called as in [`Progress`]. O(N log N).
    ///
    /// # Errors
    ///
    /// [`Cancelled`] soon after `progress` has broken.
    ///
    /// # Panics
    ///
    /// If there are 2³² boxes or more.
    pub fn new(
        boxes: &[Aabb],
        is_parallel: bool,
        progress: Option<&Progress<'_>>,
    ) -> Result<Self, Cancelled> {
        assert!(
            u32::try_from(boxes.len()).is_ok(),
            "32 bits number the boxes"
        );
        let tracker = Tracker::new(progress);
        let [divide, rest] = Work::new(is_parallel, &tracker).divide([3, 1]);
        let items = items_of_boxes(boxes, is_parallel);
        let bounds = Item::around(&items);
        let (tree, _) = boxes_of_objects(items, &bounds, divide);
        let wide = WideTree::emitted(&tree, &Boxes(boxes), &[], &bounds, rest);
        tracker.finish().map(|()| Self(wide))
    }

    /// The same tree, traced at another level.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        Self(self.0.with_level(level))
    }

    /// The level that rays are traced at.
    #[inline(always)]
    pub fn level(&self) -> Level {
        self.0.level()
    }

    /// The box around all items, for error bounds of rays.
    #[inline(always)]
    pub fn frame(&self) -> &Frame {
        self.0.frame()
    }

    /// Bytes of nodes and of blocks.
    pub fn bytes(&self) -> LayoutBytes {
        self.0.bytes()
    }

    /// The nodes and blocks. Queries of triangles through them have no meaning.
    #[inline(always)]
    pub fn as_wide(&self) -> &WideTree {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn scattered(count: u16) -> Vec<Aabb> {
        let at = |i: u16| {
            let corner = Vec3::new(
                f32::from(i % 97),
                f32::from(i / 97),
                f32::from(i.wrapping_mul(31) % 89),
            );
            Aabb {
                min: corner,
                max: corner + f32::from(i % 3),
            }
        };
        (0..count).map(at).collect()
    }

    #[test]
    fn each_item_is_in_one_leaf_inside_all_boxes_above() {
        let mut boxes = scattered(3000);
        let nothing = [
            Aabb::EMPTY,
            Aabb {
                min: Vec3::ZERO,
                max: Vec3::new(1.0, -1.0, 1.0),
            },
            Aabb {
                min: Vec3::ZERO,
                max: Vec3::INFINITY,
            },
            Aabb {
                min: Vec3::NAN,
                max: Vec3::ONE,
            },
        ];
        boxes.splice(5..5, nothing);
        let tree = WideBoxes::new(&boxes, false, None).expect("nothing cancels it");
        let wide = tree.as_wide();
        let mut found = vec![0; boxes.len()];
        let mut pending = vec![(wide.root(), None::<Aabb>)];
        while let Some((child, above)) = pending.pop() {
            if child.is_leaf() {
                for block in &wide.blocks()[child.blocks()] {
                    for lane in 0..block.count() as usize {
                        let item = block.triangles[lane];
                        let [min, max, _] = block.corners_of(lane);
                        let own = Aabb { min, max };
                        assert_eq!(own, boxes[item as usize], "its box");
                        let above = above.expect("a leaf is in a node");
                        assert_eq!(above.union(&own), above, "within the box above");
                        found[item as usize] += 1;
                    }
                }
                continue;
            }
            let node = &wide.nodes()[child.index()];
            for lane in node.lanes() {
                let bounds = node.bounds(lane);
                assert!(
                    above.is_none_or(|above| above.union(&bounds) == above),
                    "within the box above"
                );
                pending.push((node.children[lane], Some(bounds)));
            }
        }
        for (item, (count, bounds)) in found.iter().zip(&boxes).enumerate() {
            let is_nothing = nothing.iter().any(|nothing| {
                nothing.min.to_array().map(f32::to_bits) == bounds.min.to_array().map(f32::to_bits)
                    && nothing.max == bounds.max
            });
            assert_eq!(*count, u32::from(!is_nothing), "item {item}, {bounds:?}");
        }
    }

    #[test]
    fn threads_do_not_show() {
        let boxes = scattered(30_000);
        let [one, many] = [false, true].map(|is_parallel| {
            WideBoxes::new(&boxes, is_parallel, None).expect("nothing cancels it")
        });
        assert!(one == many, "the same nodes and blocks");
    }

    #[test]
    fn nothing_is_a_tree() {
        for boxes in [&[][..], &[Aabb::EMPTY; 9]] {
            let tree = WideBoxes::new(boxes, false, None).expect("nothing cancels it");
            assert!(tree.as_wide().blocks().is_empty(), "no items");
        }
    }
}
